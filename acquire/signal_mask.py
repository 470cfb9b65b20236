"""Signals for a while: blocked until a process is ready for them, or sent to a handler."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Callable, Iterator
from types import FrameType


@contextlib.contextmanager
def blocked_signals(*signals: signal.Signals) -> Iterator[None]:
    """A process started inside receives ``signals`` only after its own ``unblock_signals``: no early Ctrl-C."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def unblock_signals(*signals: signal.Signals) -> None:
    """Deliver what ``blocked_signals`` of the parent process keeps back; called by the child."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, signals)


@contextlib.contextmanager
def signal_handler(
    handler: Callable[[int, FrameType | None], object] | signal.Handlers, *signals: int
) -> Iterator[None]:
    """``signals`` call ``handler`` within the context, and then what they called before; in the main thread only."""
    before = {number: signal.signal(number, handler) for number in signals}
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)
