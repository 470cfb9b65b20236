"""Signals that a process does not get before it is ready for them."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator


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
