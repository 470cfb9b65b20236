"""Compiling ahead of a test in separate processes, each ``python -m live.setup.compiling PART KINDS PHASE``.

The process that compiles a loop may sum in another order than one that loads it from the cache. Therefore a run
or a replay does not measure with loops that it has compiled itself, unless numba's cache cannot be written.
"""

from __future__ import annotations

import contextlib
import logging
import math
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from types import FrameType
from typing import Protocol

from acquire.errors import ConfigError, Interrupted
from acquire.system import (
    blocked_signals,
    python_command,
    python_environment,
    signal_handler,
    unblock_signals,
)
from acquire.text import Message
from live.pipeline.consumer import Screen

log = logging.getLogger(__name__)
_POLL_S, _MODULE = 0.25, "live.setup.compiling"
BAR_LENGTH, KNOWN_SHARE = 30, 0.1  # an estimate from less is none
_INTERRUPTED = (
    "interrupted while the loops were compiled; what is compiled is kept, the next start goes on from there"
)


class Stopping(Protocol):
    """What ends a step before its time: a ``threading.Event``, or the stop of a run."""

    def is_set(self) -> bool: ...


def compile_ahead(
    kinds: Sequence[str],
    *,
    phase: bool = False,
    screen: Screen | None = None,
    stopping: Stopping | None = None,
) -> float:
    """Compile what pictures of these kinds need and the cache lacks; returns the seconds that took.

    Parameters
    ----------
    kinds : sequence of str
        Of ``analysis.PICTURE_KINDS``.
    phase : bool
        Also for the phase estimator.
    screen : Screen, optional
        Its status line shows the progress several times a second.
    stopping : Stopping, optional
        Looked at several times a second; once set it ends the compilation.

    Raises
    ------
    Interrupted
        ``stopping`` was set, or Ctrl-C or SIGTERM came; handlers of these signals are called too.
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
                if over or interrupted.is_set() or (stopping and stopping.is_set()):
                    raise Interrupted(_INTERRUPTED)
                share = share_compiled(kinds, began_file, phase=phase)
                if screen:
                    screen.status(progress_text(share, time.monotonic() - began))
    except KeyboardInterrupt:  # from the handler of a command that has no other
        raise Interrupted(_INTERRUPTED) from None
    finally:
        for process in processes:
            if process.poll() is None:
                process.terminate()
            process.wait()
    if not_compiled(kinds, phase=phase):
        log.warning(Message("compiled code could not be kept; set NUMBA_CACHE_DIR to a writable folder"))
    return time.monotonic() - began


def progress_text(share: float, seconds: float) -> str:
    """A bar of what is compiled after so many seconds, and about how long the rest takes."""
    full = round(BAR_LENGTH * share)
    left = Message("about a minute")
    if share >= KNOWN_SHARE:
        left = Message("about {s} s left", math.ceil(seconds * (1 / share - 1)) + 1)
    bar = "#" * full + "." * (BAR_LENGTH - full)
    return Message("compiling for this processor, once: [{bar}] {s:.0f} s, {left}", bar, seconds, left)


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
