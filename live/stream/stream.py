"""The stream: takes a record from any thread and gives it to all who take its kind, in the order they were added.

Nothing is queued here and no lock is held while records are passed on, so the records of one thread keep their order
and the thread that takes frames from a camera waits for nobody. Who takes a record returns at once; one that has work
to do has a queue of its own, with its policy and its counts.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable

from live.stream.record import ALL, Body, Record, Role


class Subscriber:
    """Takes the records of some kinds, in the thread that publishes them.

    Attributes
    ----------
    takes : iterable of type
        Kinds of bodies that it takes.
    """

    takes: Iterable[type] = ()

    def take(self, record: Record) -> None:
        """Take one record; returns at once, but for sources that wait for their readers, and does not raise."""
        raise NotImplementedError


class Stream:
    """Passes records on; may be called from any thread."""

    def __init__(self) -> None:
        self._takers: dict[type, tuple[tuple[str, Subscriber], ...]] = {}
        self._lock = threading.Lock()

    def add(self, subscriber: Subscriber, camera: str = ALL) -> None:
        """Give ``subscriber`` the records of ``camera`` (``ALL``: of each) from now on."""
        with self._lock:
            for kind in subscriber.takes:
                self._takers[kind] = (*self._takers.get(kind, ()), (camera, subscriber))

    def publish(self, body: Body, camera: str = ALL, role: Role = "plain") -> None:
        """Give ``body`` to all who take it; of ``ALL`` cameras to the subscribers of each."""
        record = Record(camera, body, role)
        for subscriber in self._takers_of(type(body), camera):
            subscriber.take(record)

    def wants(self, kind: type, camera: str = ALL) -> bool:
        """Whether anyone takes bodies of this kind: what nobody takes need not be made."""
        return bool(self._takers_of(kind, camera))

    def _takers_of(self, kind: type, camera: str) -> list[Subscriber]:
        takers = self._takers.get(kind, ())
        return [one for wanted, one in takers if ALL in (wanted, camera) or wanted == camera]
