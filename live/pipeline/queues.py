"""Bounded containers: two queues between threads, and ``Thinned``, a list of a whole test.

``LatestQueue`` keeps the newest item, ``BoundedQueue`` is bounded in bytes; both count the items that they cannot
pass on, nothing is dropped silently.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from itertools import pairwise
from statistics import median_low
from typing import Generic, TypeVar

CATCH_UP_S = 3.0
"""A reader that has not caught up after this time continues with the newest item."""

SLOW_S, IDLE = 1.0, 0.05
"""A reader without as large a share of spare time, behind which more items wait than so long ago, is too slow."""

Item = TypeVar("Item")
Stored = TypeVar("Stored")


class _Queue(Generic[Stored]):
    """Items between two threads, until it is closed."""

    def __init__(self) -> None:
        self._items: deque[Stored] = deque()
        self._change = threading.Condition()
        self._closed = False

    def close(self) -> None:
        """No more items; those in the queue can still be taken."""
        with self._change:
            self._closed = True
            self._change.notify_all()

    @property
    def finished(self) -> bool:
        """Closed and empty."""
        with self._change:
            return self._closed and not self._items


class LatestQueue(_Queue[Item]):
    """Holds few items, and where there are more only the newest: the measuring path never waits for old bursts.

    With ``waits=True`` ``put`` waits until the queue is empty, so that nothing is skipped: for
    sources that wait for their reader. Of skipped items ``brief`` is kept until ``take_skipped``.

    Parameters
    ----------
    waits : bool
    at_first : int
        Size of the queue until the reader, which has to prepare first, has caught up. It continues with the newest
        where the queue does not get shorter while as many items are taken, and after ``CATCH_UP_S`` in any case.
    keeps : int
        Size of the queue for a reader that is late now and then. One that lets it fill, or that has been slower than
        the items for ``SLOW_S``, gets the newest item each time, until it has time to spare again.
    brief : callable
        What is kept of an item that is skipped, without its pictures: many are while the reader prepares.

    Attributes
    ----------
    newest_only : bool
        The reader is too slow.
    """

    def __init__(
        self,
        *,
        waits: bool = False,
        at_first: int = 1,
        keeps: int = 1,
        brief: Callable[[Item], Item] = lambda item: item,
    ) -> None:
        super().__init__()
        self._waits, self._brief, self._keeps = waits, brief, keeps
        self._size = self._at_first = self._patience = at_first
        self._reading, self._catching_up, self._catch_up_t = False, True, 0.0
        self._fewest = math.inf
        self.newest_only, self._idle_s, self._puts = False, 0.0, 0
        self._takes: deque[tuple[float, float, int, int]] = deque()
        """Time, idle time so far, items that waited, items that had come: of the last ``SLOW_S``."""
        self._skipped: list[Item] = []
        self._woken = False

    def wake(self) -> None:
        """Let a reader that waits, or the next one, go on without an item."""
        with self._change:
            self._woken = True
            self._change.notify_all()

    def begin(self) -> None:
        """The reader is ready and begins to catch up."""
        self._reading, self._catch_up_t = True, time.monotonic() + CATCH_UP_S

    def put(self, item: Item) -> None:
        """Put ``item``; those that it replaces count as skipped. After ``close`` ``item`` itself is skipped."""
        with self._change:
            while self._waits and self._items and not self._closed:
                self._change.wait()
            if self._closed:
                self._skipped.append(self._brief(item))
                return
            self._items.append(item)
            self._puts += 1
            if len(self._items) > self._size:
                self._skip_oldest(self._size if self._catching_up else 1)
            self._change.notify_all()

    def get(self, timeout_s: float | None = None) -> Item | None:
        """Take an item, waiting up to ``timeout_s``; None where there is none, woken, or when closed and empty."""
        with self._change:
            began = time.monotonic()
            if self._reading:
                self._resize(began)
            self._change.wait_for(lambda: self._items or self._closed or self._woken, timeout_s)
            self._woken = False
            self._idle_s += time.monotonic() - began
            item = self._items.popleft() if self._items else None
            self._change.notify_all()
            return item

    def _resize(self, now: float) -> None:
        takes, waiting = self._takes, len(self._items)
        takes.append((now, self._idle_s, waiting, self._puts))
        while len(takes) > 1 and takes[1][0] <= now - SLOW_S:
            takes.popleft()
        spare = self._idle_s - takes[0][1] > IDLE * (now - takes[0][0])
        if not waiting and (spare or not self.newest_only):
            self._size, self._catching_up, self.newest_only = self._keeps, False, False
        elif self._catching_up and waiting and not self._gets_shorter():
            self._catching_up = False
            self._skip_oldest(1)
        elif not (self._catching_up or spare) and self._is_slower():
            self._skip_oldest(1)

    def _is_slower(self) -> bool:
        """Whether more items wait than ``SLOW_S`` ago and most took longer than from one to the next: no hiccup."""
        (since, _, waited, puts), (now, _, waiting, all_puts) = self._takes[0], self._takes[-1]
        if waiting <= waited or now - since < SLOW_S or len(self._takes) < 3:
            return False
        busy = (after[0] - after[1] - one[0] + one[1] for one, after in pairwise(self._takes))
        return median_low(busy) > (now - since) / max(all_puts - puts, 1)

    def _gets_shorter(self) -> bool:
        """Whether a reader that is behind comes nearer to the newest item."""
        self._patience -= 1
        if len(self._items) < self._fewest:
            self._fewest, self._patience = len(self._items), self._at_first
        return self._patience >= 0 and time.monotonic() <= self._catch_up_t

    def _skip_oldest(self, size: int) -> None:
        """Skip all but the newest ``size`` items; the queue holds no more from now on."""
        self._size, self.newest_only = size, self._reading and size == 1 < self._keeps
        while len(self._items) > size:
            self._skipped.append(self._brief(self._items.popleft()))

    def take_skipped(self) -> list[Item]:
        """The items skipped since the last call."""
        with self._change:
            skipped, self._skipped = self._skipped, []
            return skipped


class BoundedQueue(_Queue[tuple[Item, int]], Generic[Item]):
    """A queue bounded in bytes; it refuses an item beyond the bound, and the caller counts that.

    Parameters
    ----------
    limit : int, bytes
    waits : bool
        Wait for free space instead of refusing (sources that wait for their reader).
    """

    def __init__(self, limit: int, *, waits: bool = False) -> None:
        super().__init__()
        self._limit, self._waits = limit, waits
        self._bytes = 0

    def put(self, item: Item, size: int, *, always: bool = False) -> bool:
        """Queue ``item`` of ``size`` bytes; False where it does not fit, or after ``close``.

        An empty queue takes any item; ``always`` is for small items that must not be lost.
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


class Thinned(Generic[Item]):
    """A bounded list, evenly thinned, and always the newest item: when full, every second item is dropped.

    Parameters
    ----------
    size : int
        Items kept at most (and one more, the newest).

    Attributes
    ----------
    kept : list
        Every ``2**halvings``-th item from the first on, oldest first.
    halvings : int
        How often every second item was dropped.
    """

    def __init__(self, size: int) -> None:
        self._size, self._count = size, 0
        self.kept, self.halvings = list[Item](), 0
        self._newest: list[Item] = []

    def append(self, item: Item) -> None:
        """Add the newest."""
        self._newest = [item]
        if self._count % (1 << self.halvings) == 0:
            self.kept.append(item)
            if len(self.kept) > self._size:
                self.kept, self.halvings = self.kept[::2], self.halvings + 1
        self._count += 1

    def items(self) -> list[Item]:
        """Oldest first, the newest always included."""
        is_kept = (self._count - 1) % (1 << self.halvings) == 0
        return self.kept + self._newest * (not is_kept)
