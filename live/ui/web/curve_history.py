"""The curves of a test for the page: rows of numbers by time, of which a page requests what it lacks."""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from typing import Any

from live.pipeline.queues import Thinned

MAX_POINTS = 4000


class CurveHistory:
    """Rows of numbers by time, bounded: a long test is thinned evenly, and a page then requests all rows again.

    Parameters
    ----------
    names : sequence of str
        Of the columns.
    colours : sequence of int or None
        Stored indices of the colours of those after the third; None: by their place.
    """

    def __init__(self, names: Sequence[str], colours: Sequence[int | None] = ()) -> None:
        self._names, self._colours = list(names), list(colours)
        self._rows: Thinned[Sequence[float]] = Thinned(MAX_POINTS)
        self._lock = threading.Lock()

    def add(self, row: Sequence[float]) -> None:
        """Add a row; a long curve is thinned."""
        with self._lock:
            self._rows.append(row)

    @property
    def position(self) -> tuple[int, int]:
        """Edition (rows of another edition are useless) and number of rows."""
        with self._lock:
            return self._rows.halvings, len(self._rows.kept)

    def outline(self, count: int) -> dict[str, Any]:
        """The curve of a finished test, to be drawn behind the next one: at most ``count`` of its points, SI units."""
        with self._lock:
            rows = [row for row in self._rows.kept if math.isfinite(row[1]) and math.isfinite(row[2])]
        rows = rows[:: max(1, math.ceil(len(rows) / count))]
        return {
            "stress": self._names[1] == "stress",
            "load": [row[1] for row in rows],
            "strain": [row[2] for row in rows],
        }

    def since(self, edition: int, count: int) -> dict[str, Any]:
        """The rows that a page with ``count`` rows of ``edition`` lacks."""
        with self._lock:
            first = count if edition == self._rows.halvings else 0
            return {
                "names": self._names,
                "colours": self._colours,
                "edition": self._rows.halvings,
                "first": first,
                "rows": self._rows.kept[first:],
            }
