"""Compiling ahead of a test, by processes of its own; a test itself only loads what is compiled.

``python -m live.setup PART KINDS PHASE`` is one of the two processes. The process that compiles a loop
may sum in another order than one that loads it, so a run or a replay does not measure with what it has compiled
itself, unless numba's cache cannot be written.
"""

from __future__ import annotations

import logging
import subprocess
import sys
import time
from collections.abc import Callable, Sequence

from acquire.errors import ConfigError

log = logging.getLogger(__name__)
_POLL_S = 0.25


def compile_ahead(
    kinds: Sequence[str], *, phase: bool = False, say: Callable[[str], object] = lambda text: None
) -> float:
    """Have compiled what pictures of these kinds need, where it is not; the seconds that took.

    Parameters
    ----------
    kinds : sequence of str
        Of ``analysis.PICTURE_KINDS``.
    phase : bool
        Also for the estimator by phases.
    say : callable taking a text, optional
        Told again and again how far it is.
    """
    from analysis import COMPILE_PARTS, not_compiled

    if not not_compiled(kinds, phase=phase):
        return 0.0
    began = time.monotonic()
    words = [",".join(kinds), "phase" if phase else "-"]
    commands = [[sys.executable, "-m", "live.setup", part, *words] for part in COMPILE_PARTS]
    processes = [subprocess.Popen(command, stdout=subprocess.DEVNULL) for command in commands]
    try:
        while any(process.poll() is None for process in processes):
            time.sleep(_POLL_S)
            done = sum(process.poll() is not None for process in processes)
            seconds = time.monotonic() - began
            say(f"compiling for this processor, once: {seconds:.0f} s, {done} of {len(processes)} parts done")
    finally:
        for process in processes:
            if process.poll() is None:
                process.terminate()
            process.wait()
    if not_compiled(kinds, phase=phase):
        log.warning("what was compiled could not be kept; make numba's cache writable (NUMBA_CACHE_DIR)")
    return time.monotonic() - began


def main(part: str, kinds: str, phase: str) -> int:
    """One of the processes."""
    from acquire import burst, hdf5
    from analysis import COMPILE_PARTS, warm_up

    if part not in COMPILE_PARTS:
        raise ConfigError(f"{part}: no part of the compilation; there are {', '.join(COMPILE_PARTS)}")
    warm_up(part, kinds.split(","))
    if part == COMPILE_PARTS[0]:  # so that both take the same time
        hdf5.compile_loops()
        return 0
    burst.compile_loops(tuple(kind for kind in kinds.split(",") if kind != "float32"))
    if phase == "phase":
        warm_up("phase")
    return 0
