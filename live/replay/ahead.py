"""Reading ahead of the kernel: the next bursts are read and averaged while one is measured."""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Generator, Iterable
from dataclasses import dataclass
from typing import Generic, TypeVar

Item = TypeVar("Item")
_LOOK_S = 0.1


@dataclass(frozen=True, slots=True)
class _End:
    """Nothing follows; ``error`` is what ended it early."""

    error: BaseException | None = None


class _Reader(Generic[Item]):
    """A thread that takes items and puts them in a queue with bounded room."""

    def __init__(self, items: Iterable[Item], room: int) -> None:
        self._items = items
        self.queue: queue.Queue[Item | _End] = queue.Queue(room)
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._read, name="read ahead", daemon=True)
        self._thread.start()

    def _read(self) -> None:
        end = _End()
        try:
            for item in self._items:
                if not self._put(item):
                    return
        except BaseException as error:  # raised again where the items are taken
            end = _End(error)
        self._put(end)

    def _put(self, item: Item | _End) -> bool:
        """Whether there was room before the end."""
        while not self._stopped.is_set():
            with contextlib.suppress(queue.Full):
                self.queue.put(item, timeout=_LOOK_S)
                return True
        return False

    def close(self) -> None:
        """Take nothing more, and let go of the source."""
        self._stopped.set()
        self._thread.join()


def ahead(items: Iterable[Item], room: int = 1) -> Generator[Item]:
    """The same items in the same order, taken ahead by a thread of their own: ``room`` wait, and it has one at hand.

    What ``items`` raises is raised here, after those that came before. Closing the iterator ends the thread.
    """
    reader = _Reader(items, room)
    try:
        while not isinstance(item := reader.queue.get(), _End):
            yield item
        if item.error is not None:
            raise item.error
    finally:
        reader.close()
