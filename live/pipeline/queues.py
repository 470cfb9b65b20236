"""The two channels between threads: a one-place mailbox and a byte-bounded buffer.

Both count what they could not pass on; nothing is dropped silently.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import Generic, TypeVar

CATCH_UP_S = 2.0
"""What is shown is what happens now: a reader far too slow for the pace is not kept among the first bursts."""

Item = TypeVar("Item")
Stored = TypeVar("Stored")


class _Channel(Generic[Stored]):
    """What lies between two threads, and the end of it."""

    def __init__(self) -> None:
        self._items: deque[Stored] = deque()
        self._change = threading.Condition()
        self._closed = False

    def close(self) -> None:
        """No more items; what lies there can still be taken."""
        with self._change:
            self._closed = True
            self._change.notify_all()

    @property
    def finished(self) -> bool:
        """Closed and empty."""
        with self._change:
            return self._closed and not self._items


class LatestQueue(_Channel[Item]):
    """One place, newest wins: the measuring path never waits for old bursts.

    With ``waits=True`` ``put`` waits until the place is free, so that nothing is skipped: for
    sources that wait for their reader. What was replaced before anybody took it is kept until
    ``take_skipped`` fetches it.

    Parameters
    ----------
    waits : bool
    at_first : int
        Places until the reader, who has things to prepare, has caught up; one who has not after as many
        items, or after ``CATCH_UP_S``, goes on with the newest.
    """

    def __init__(self, *, waits: bool = False, at_first: int = 1) -> None:
        super().__init__()
        self._waits = waits
        self._places = self._patience = at_first
        self._reading, self._until = False, 0.0
        self._skipped: list[Item] = []

    def begin(self) -> None:
        """The reader is ready: from now on it is behind, or has caught up."""
        self._reading, self._until = True, time.monotonic() + CATCH_UP_S

    def put(self, item: Item) -> None:
        """Place ``item``; what lay there untaken is counted as skipped. Ignored after ``close``."""
        with self._change:
            while self._waits and self._items and not self._closed:
                self._change.wait()
            if self._closed:
                self._skipped.append(item)
                return
            while len(self._items) >= self._places:
                self._skipped.append(self._items.popleft())
            self._items.append(item)
            self._change.notify_all()

    def get(self, timeout_s: float | None = None) -> Item | None:
        """Take what is there, waiting up to ``timeout_s``; None where nothing came or all is over."""
        with self._change:
            self._look_how_far()
            self._change.wait_for(lambda: self._items or self._closed, timeout_s)
            item = self._items.popleft() if self._items else None
            self._change.notify_all()
            return item

    def _look_how_far(self) -> None:
        if not self._reading or self._places == 1:
            return
        self._patience -= 1
        if not self._items or self._patience < 0 or time.monotonic() > self._until:
            self._places = 1
            while len(self._items) > 1:
                self._skipped.append(self._items.popleft())

    def take_skipped(self) -> list[Item]:
        """What was skipped since the last call."""
        with self._change:
            skipped, self._skipped = self._skipped, []
            return skipped


class BoundedQueue(_Channel[tuple[Item, int]], Generic[Item]):
    """A queue bounded in bytes; a put beyond the bound is refused and counted by the caller.

    Parameters
    ----------
    limit : int, bytes
    waits : bool
        Wait for room instead of refusing (sources that wait for their reader).
    """

    def __init__(self, limit: int, *, waits: bool = False) -> None:
        super().__init__()
        self._limit, self._waits = limit, waits
        self._bytes = 0

    def put(self, item: Item, size: int, *, always: bool = False) -> bool:
        """Queue ``item`` of ``size`` bytes; False where there is no room, or after ``close``.

        An empty buffer takes anything; ``always`` is for small things that must not be lost.
        """
        with self._change:
            if self._waits and not always:
                self._change.wait_for(lambda: self._fits(size) or self._closed)
            if self._closed or not (always or self._fits(size)):
                return False
            self._items.append((item, size))
            self._bytes += size
            self._change.notify_all()
            return True

    def _fits(self, size: int) -> bool:
        return not self._items or self._bytes + size <= self._limit

    def get(self, timeout_s: float | None = None) -> Item | None:
        """The oldest item; None after ``timeout_s``, or when closed and empty."""
        with self._change:
            self._change.wait_for(lambda: self._items or self._closed, timeout_s)
            if not self._items:
                return None
            item, size = self._items.popleft()
            self._bytes -= size
            self._change.notify_all()
            return item

    @property
    def waiting_bytes(self) -> int:
        """Bytes queued now."""
        return self._bytes
