"""The means of all measured instants, kept in memory for the summary and the status line."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acquire.load_cell import LoadLog
from live.measure.instant import Instant

Array = NDArray[np.float64]


class History:
    """All instants so far."""

    def __init__(self) -> None:
        self.instants: list[Instant] = []

    def add(self, instant: Instant) -> None:
        """Keep ``instant``."""
        self.instants.append(instant)

    def column(self, name: str) -> Array:
        """One quantity over time, (N,) float64."""
        return np.array([getattr(instant, name) for instant in self.instants], np.float64)

    def forces(self, loads: LoadLog) -> Array:
        """The force at each instant with all samples that have come by now, (N,) float64, N."""
        return np.array([loads.force_at(instant.t) for instant in self.instants], np.float64)

    def along(self, axis: str) -> tuple[Array, Array]:
        """Mean strain along and across the load."""
        names = ("eyy", "exx") if axis == "y" else ("exx", "eyy")
        return self.column(names[0]), self.column(names[1])
