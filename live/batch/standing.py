"""How far a campaign is, in one line."""

from __future__ import annotations

import threading
from collections.abc import Callable

from acquire.printable import duration
from live.batch.work import Progress


class Standing:
    """Counts what workers tell, from any thread.

    Parameters
    ----------
    tests : int
        To be replayed.
    now : callable giving s
    """

    def __init__(self, tests: int, now: Callable[[], float]) -> None:
        self._tests, self._now, self._began = tests, now, now()
        self._ended = 0
        self._shares: dict[str, float] = {}
        self._last: dict[str, Progress] = {}
        self._done: set[str] = set()
        self._lock = threading.Lock()

    def expect(self, title: str, share: float = 1.0) -> None:
        """The task ``title`` is that share of a test."""
        with self._lock:
            self._shares[title] = share

    def told(self, title: str, progress: Progress) -> None:
        """How far that task is."""
        with self._lock:
            self._last[title] = progress

    def done(self, title: str) -> None:
        """It has come to its end."""
        with self._lock:
            self._done.add(title)

    def ended(self) -> None:
        """A test has."""
        with self._lock:
            self._ended += 1

    def words(self) -> str:
        """Sessions, instants, ZOIs a second and the time that is left."""
        with self._lock:
            took = self._now() - self._began
            instants = sum(progress.done for progress in self._last.values())
            zois = sum(progress.zois for progress in self._last.values())
            share = sum(share * self._part(title) for title, share in self._shares.items()) / self._tests
        left = f"  {duration(took * (1 - share) / share)} left" if 0 < share < 1 else ""
        rate = f"  {zois / took:,.0f} ZOI/s" if took > 0 else ""
        return f"{self._ended} of {self._tests} tests  {instants} instants{rate}{left}"

    def _part(self, title: str) -> float:
        """How much of a task is done."""
        last = self._last.get(title)
        if title in self._done or last is None or not last.expected:
            return float(title in self._done)
        return min(1.0, last.done / last.expected)
