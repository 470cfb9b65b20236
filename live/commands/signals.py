"""What Ctrl-C, SIGTERM and the end of a terminal do to a command."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType

from acquire.signal_mask import signal_handler


@contextlib.contextmanager
def signals(stop: Callable[[], None], say: Callable[[str], None]) -> Iterator[None]:
    """SIGINT and SIGTERM call ``stop`` (the third time they kill); a lost terminal is ignored."""
    times = 0

    def handle(number: int, frame: FrameType | None) -> None:
        nonlocal times
        times += 1
        if times > 2:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)
        say("closing the files ..." if times == 1 else "still closing; once more ends it at once")
        stop()

    with signal_handler(handle, signal.SIGINT, signal.SIGTERM), signal_handler(signal.SIG_IGN, signal.SIGHUP):
        yield


@contextlib.contextmanager
def interrupts() -> Iterator[threading.Event]:
    """Set by the first Ctrl-C or SIGTERM; the second ends the program, for nothing is lost with it."""
    stop = threading.Event()

    def handle(number: int, frame: FrameType | None) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    with signal_handler(handle, signal.SIGINT, signal.SIGTERM):
        yield stop
