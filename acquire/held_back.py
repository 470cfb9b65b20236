"""What is done with signals for a while: held back until a process is ready for them, or handled."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Callable, Iterator
from types import FrameType


@contextlib.contextmanager
def held_back(*signals: signal.Signals) -> Iterator[None]:
    """A process started inside does not get ``signals``, however quick a hand is at Ctrl-C, until ``let_through``."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def let_through(*signals: signal.Signals) -> None:
    """What was held back, by the process itself."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, signals)


@contextlib.contextmanager
def handled(
    handler: Callable[[int, FrameType | None], object] | signal.Handlers, *signals: int
) -> Iterator[None]:
    """``signals`` call ``handler``, and what they called before once this is left; in the main thread alone."""
    before = {number: signal.signal(number, handler) for number in signals}
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)
