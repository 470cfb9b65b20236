"""Opening a device in a thread of its own, since a driver or a network may take as long as it likes."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Opened = TypeVar("Opened")
RETRY_S, LOOK_S = 0.5, 0.1


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


def open_again(
    attempt: Callable[[], Opened],
    close: Callable[[Opened], object],
    stopped: threading.Event,
    errors: tuple[type[Exception], ...],
    failed: Callable[[Exception], object] = lambda error: None,
) -> Opened | None:
    """Try in a thread until it works; None once ``stopped`` is set, however long the attempt still blocks.

    Parameters
    ----------
    attempt : callable
        Opens and returns the device.
    close : callable
        Closes what was opened too late.
    stopped : threading.Event
    errors : tuple of exceptions
        After which it is tried again; any other ends it, and is raised here.
    failed : callable taking an exception, optional
        Called after each such error.
    """

    def until_it_works() -> Opened | None:
        while not stopped.is_set():
            try:
                return attempt()
            except errors as error:
                failed(error)
            stopped.wait(RETRY_S)
        return None

    opening = Opening(until_it_works, lambda opened: opened is not None and close(opened))
    while not stopped.is_set():
        if opening.done(LOOK_S):
            return opening.take()
    opening.abandon()
    return None
