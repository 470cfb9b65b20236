"""Devices and files opened and closed: ``with`` closes at the end, and a driver or a network that takes as long as it
likes is opened and closed by a thread of its own.
"""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from types import TracebackType
from typing import Generic, Self, TypeVar

from acquire.clock import Clock

Opened = TypeVar("Opened")
RETRY_S, LOOK_S = 0.5, 0.1


class Closing(ABC):
    """Base of context managers that end by ``close``; one that begins something on entry overrides that."""

    @abstractmethod
    def close(self) -> None:
        """Release what is held; idempotent."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Opening(Generic[Opened]):
    """A device being opened by a thread.

    Parameters
    ----------
    opener : callable
        Opens and returns it.
    close : callable
        Closes what was opened when nobody waited for it any more.
    """

    def __init__(self, opener: Callable[[], Opened], close: Callable[[Opened], object]) -> None:
        self._opener, self._close = opener, close
        self._lock, self._done, self._abandoned = threading.Lock(), threading.Event(), False
        self._opened: list[Opened] = []
        self._error: Exception | None = None
        threading.Thread(target=self._work, name="opening", daemon=True).start()

    def _work(self) -> None:
        try:
            self._opened.append(self._opener())
        except Exception as error:
            self._error = error
        with self._lock:
            self._done.set()
            unwanted = self._abandoned
        if unwanted:
            self._close_opened()

    def done(self, seconds: float) -> bool:
        """Whether it is decided, after waiting so long at most."""
        return self._done.wait(seconds)

    def take(self) -> Opened:
        """The device, once it is done; raises what opening it raised."""
        if self._error is not None:
            raise self._error
        return self._opened.pop()

    def abandon(self) -> None:
        """Nobody waits for it any more."""
        with self._lock:
            self._abandoned = True
            done = self._done.is_set()
        if done:
            self._close_opened()

    def _close_opened(self) -> None:
        while self._opened:
            self._close(self._opened.pop())


class Reopening(Generic[Opened]):
    """A lost device that is opened again: one attempt after the other, until one works.

    Parameters
    ----------
    attempt, close : callable
        As of ``Opening``.
    errors : tuple of exceptions
        After which it is tried again; any other ends it.
    sleep : callable
        Waits so many seconds, less when nobody waits for the device any more.
    failed : callable taking an exception, optional
        Called after each such error.
    after_s : float, s
        Until the first attempt.
    clock : callable giving monotonic s
    """

    def __init__(
        self,
        attempt: Callable[[], Opened],
        close: Callable[[Opened], object],
        errors: tuple[type[Exception], ...],
        sleep: Callable[[float], object],
        failed: Callable[[Exception], object] = lambda error: None,
        *,
        after_s: float = 0.0,
        clock: Clock = time.monotonic,
    ) -> None:
        self._attempt, self._close, self._errors = attempt, close, errors
        self._sleep, self._failed, self._clock = sleep, failed, clock
        self._next = clock() + after_s
        self._opening: Opening[Opened] | None = None

    def look(self) -> Opened | None:
        """The device once it is open; waits ``LOOK_S`` at most. Raises what an attempt raised beside ``errors``."""
        if self._opening is None:
            left = self._next - self._clock()
            if left > 0:
                self._sleep(min(left, LOOK_S))
                return None
            self._opening = Opening(self._attempt, self._close)
        if not self._opening.done(LOOK_S):
            return None
        opening, self._opening = self._opening, None
        try:
            return opening.take()
        except self._errors as error:
            self._failed(error)
            self._next = self._clock() + RETRY_S
            return None

    def abandon(self) -> None:
        """Nobody waits for it any more, however long an attempt still blocks."""
        if self._opening is not None:
            self._opening.abandon()
            self._opening = None


def close_within(seconds: float, close: Callable[[], object]) -> threading.Thread:
    """Close in a thread, and wait so long for it: a device that is gone may block for seconds."""
    thread = threading.Thread(target=close, name="closing", daemon=True)
    thread.start()
    thread.join(seconds)
    return thread
