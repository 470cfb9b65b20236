"""How far a campaign is, in one line."""

from __future__ import annotations

import threading
from collections.abc import Callable

from live.batch.task import Progress
from live.tell import duration


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
        self._last: dict[str, Progress] = {}
        self._done: set[str] = set()
        self._lock = threading.Lock()

    def told(self, name: str, progress: Progress) -> None:
        """How far the test ``name`` is."""
        with self._lock:
            self._last[name] = progress

    def done(self, name: str) -> None:
        """It has come to its end."""
        with self._lock:
            self._done.add(name)

    def words(self) -> str:
        """Sessions, instants, ZOIs a second and the time that is left."""
        with self._lock:
            took = self._now() - self._began
            instants = sum(progress.done for progress in self._last.values())
            zois = sum(progress.zois for progress in self._last.values())
            share = self._share()
        left = f"  {duration(took * (1 - share) / share)} left" if 0 < share < 1 else ""
        rate = f"  {zois / took:,.0f} ZOI/s" if took > 0 else ""
        return f"{len(self._done)} of {self._tests} tests  {instants} instants{rate}{left}"

    def _share(self) -> float:
        """How much of all is done; tests count alike."""
        running = [progress for name, progress in self._last.items() if name not in self._done]
        parts = [min(1.0, one.done / one.expected) for one in running if one.expected]
        return (len(self._done) + sum(parts)) / self._tests
