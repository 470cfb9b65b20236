"""The points of the curves, bounded: a long test is thinned evenly, and a page then asks for all of it anew."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any

from live.measure import Thinned

MOST_POINTS = 4000


class Curve:
    """Rows of numbers by growing time.

    Parameters
    ----------
    names : sequence of str
        Of the columns.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = list(names)
        self._rows: Thinned[Sequence[float]] = Thinned(MOST_POINTS)
        self._lock = threading.Lock()

    def add(self, row: Sequence[float]) -> None:
        """Take a row, or let it go where the curve has become long."""
        with self._lock:
            self._rows.append(row)

    @property
    def place(self) -> tuple[int, int]:
        """Edition (what a page has of another is of no use) and number of rows."""
        with self._lock:
            return self._rows.halvings, len(self._rows.kept)

    def since(self, edition: int, count: int) -> dict[str, Any]:
        """What a page lacks that has ``count`` rows of ``edition``."""
        with self._lock:
            first = count if edition == self._rows.halvings else 0
            return {
                "names": self._names,
                "edition": self._rows.halvings,
                "first": first,
                "rows": self._rows.kept[first:],
            }
