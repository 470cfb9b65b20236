"""Compiling ahead of a test in separate processes, each ``python -m live.setup.compiling PART KINDS PHASE``.

The process that compiles a loop may sum in another order than one that loads it from the cache. Therefore a run
or a replay does not measure with loops that it has compiled itself, unless numba's cache cannot be written.
"""

from __future__ import annotations

import contextlib
import gc
import logging
import math
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from types import FrameType

from acquire.errors import ConfigError, Interrupted
from acquire.system import (
    blocked_signals,
    python_command,
    python_environment,
    signal_handler,
    unblock_signals,
)

log = logging.getLogger(__name__)
_POLL_S, _MODULE = 0.25, "live.setup.compiling"
BAR_LENGTH, KNOWN_SHARE = 30, 0.1  # an estimate from less is none
_INTERRUPTED = (
    "interrupted while the loops were compiled; what is compiled is kept, the next start goes on from there"
)


def compile_ahead(
    kinds: Sequence[str],
    *,
    phase: bool = False,
    show: Callable[[str], object] = lambda text: None,
    stopped: Callable[[], bool] = lambda: False,
) -> float:
    """Compile what pictures of these kinds need and the cache lacks; returns the seconds that took.

    Parameters
    ----------
    kinds : sequence of str
        Of ``analysis.PICTURE_KINDS``.
    phase : bool
        Also for the phase estimator.
    show : callable taking a text, optional
        Receives the progress several times a second.
    stopped : callable, optional
        Polled several times a second; True ends the compilation.

    Raises
    ------
    Interrupted
        ``stopped`` returned True, or Ctrl-C or SIGTERM came; handlers of these signals are called too.
    """
    from analysis import COMPILE_PARTS, not_compiled, share_compiled

    if not not_compiled(kinds, phase=phase):
        return 0.0
    began, began_file = time.monotonic(), time.time()
    words = [",".join(kinds), "phase" if phase else "-"]
    commands = [python_command(_MODULE, part, *words) for part in COMPILE_PARTS]
    with blocked_signals(signal.SIGINT):
        processes = [
            subprocess.Popen(command, stdout=subprocess.DEVNULL, env=python_environment())
            for command in commands
        ]
    try:
        with _interruptions() as interrupted:
            while any(process.poll() is None for process in processes):
                interrupted.wait(_POLL_S)
                over = any(process.poll() == -signal.SIGINT for process in processes)
                if over or interrupted.is_set() or stopped():
                    raise Interrupted(_INTERRUPTED)
                show(progress_text(share_compiled(kinds, began_file, phase=phase), time.monotonic() - began))
    except KeyboardInterrupt:  # from the handler of a command that has no other
        raise Interrupted(_INTERRUPTED) from None
    finally:
        for process in processes:
            if process.poll() is None:
                process.terminate()
            process.wait()
    if not_compiled(kinds, phase=phase):
        log.warning("what was compiled could not be kept; make numba's cache writable (NUMBA_CACHE_DIR)")
    return time.monotonic() - began


def progress_text(share: float, seconds: float) -> str:
    """A bar of what is compiled after so many seconds, and about how long the rest takes."""
    full = round(BAR_LENGTH * share)
    left = (
        "about a minute"
        if share < KNOWN_SHARE
        else f"about {math.ceil(seconds * (1 / share - 1)) + 1} s left"
    )
    bar = "#" * full + "." * (BAR_LENGTH - full)
    return f"compiling for this processor, once: [{bar}] {seconds:.0f} s, {left}"


@contextlib.contextmanager
def _interruptions() -> Iterator[threading.Event]:
    """An event that Ctrl-C and SIGTERM set, besides their own handlers; outside the main thread nothing sets it."""
    interrupted = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield interrupted
        return
    now = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    before = {number: handler for number, handler in now.items() if handler not in (signal.SIG_IGN, None)}

    def handle(number: int, frame: FrameType | None) -> None:
        interrupted.set()
        handler = before[signal.Signals(number)]
        if callable(handler):
            handler(number, frame)

    with signal_handler(handle, *before):
        yield interrupted


def main(part: str, kinds: str, phase: str) -> int:
    """One of the compiling processes; returns the exit code."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # end without a message
    unblock_signals(signal.SIGINT)
    gc.disable()  # a tenth of the time, and the process ends soon
    from acquire import burst, hdf5
    from analysis import COMPILE_PARTS, warm_up

    if part not in COMPILE_PARTS:
        raise ConfigError(
            "{part}: no part of the compilation; there are {known}", part, ", ".join(COMPILE_PARTS)
        )
    warm_up(part, kinds.split(","))
    if part == COMPILE_PARTS[0]:  # so that both take the same time
        hdf5.compile_loops()
        return 0
    burst.compile_loops(tuple(kind for kind in kinds.split(",") if kind != "float32"))
    if phase == "phase":
        warm_up("phase")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
