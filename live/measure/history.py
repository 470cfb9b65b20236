"""The means of all measured instants, kept in memory for the summary and the status line."""

from __future__ import annotations

from collections.abc import Iterator

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

    @property
    def told_something(self) -> bool:
        """Whether any ZOI had a value at any instant."""
        return any(instant.n_valid for instant in self.instants)

    def column(self, name: str) -> Array:
        """One quantity over time, (N,) float64."""
        return np.array([getattr(instant, name) for instant in self.instants], np.float64)

    def forces(self, loads: LoadLog) -> Array:
        """The force at each instant with all samples that have come by now, (N,) float64, N.

        As if the zero of the first instant had held to the end: a tare in mid-test is no unloading.
        """
        return np.array(
            [loads.force_at(i.t) + loads.zero_at(i.t) - zero for i, zero in self._with_first_zero(loads)],
            np.float64,
        )

    def _with_first_zero(self, loads: LoadLog) -> Iterator[tuple[Instant, float]]:
        zero = loads.zero_at(self.instants[0].t) if self.instants else 0.0
        return ((instant, zero) for instant in self.instants)

    def tared_in_mid_test(self, loads: LoadLog) -> float:
        """What tares after the first instant have taken off the force by the last one, N."""
        if not self.instants:
            return 0.0
        return loads.zero_at(self.instants[-1].t) - loads.zero_at(self.instants[0].t)

    def along(self, axis: str) -> tuple[Array, Array]:
        """Strain along and across the load: the gauges ``axial`` and ``transverse``, or else the means."""
        names = ("eyy", "exx") if axis == "y" else ("exx", "eyy")
        axial, transverse = self.gauge("axial"), self.gauge("transverse")
        return (
            self.column(names[0]) if axial is None else axial,
            self.column(names[1]) if transverse is None else transverse,
        )

    def gauge(self, name: str) -> Array | None:
        """A gauge over time, (N,) float64; None where there is none of that name."""
        if not self.instants or name not in self.instants[0].gauges:
            return None
        return np.array([instant.gauges[name].value for instant in self.instants], np.float64)
