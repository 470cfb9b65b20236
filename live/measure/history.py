"""The means of all measured instants, kept in memory for the summary and the status line; the axis they tell."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from acquire.load_cell import LoadLog
from analysis.evaluate import LoadAxis, load_axis
from live.measure.instant import Instant

Array = NDArray[np.float64]
MOST_INSTANTS = 2000
"""That are kept, evenly thinned."""
_FIRST, _GROWTH = 8, 1.1  # looked at first, and again whenever there are so many times more


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

    def axis(self, given: str) -> LoadAxis:
        """Of the load: "x" or "y" as ``given``, or what all instants tell where that is "auto"."""
        return load_axis(self.column("exx"), self.column("eyy"), self.column("exy"), given)

    def along(self, axis: str) -> tuple[Array, Array]:
        """Strain along and across the load: the gauges ``axial`` and ``transverse``, or else the means."""
        chosen = axis if axis in ("x", "y") else self.axis(axis).axis
        names = ("eyy", "exx") if chosen == "y" else ("exx", "eyy")
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


class AxisFinder:
    """Given the same instants it tells the same, in a test and in its replay.

    Parameters
    ----------
    given : "x", "y" or "auto"

    Attributes
    ----------
    axis : "x" or "y"
        As given, or as the strains tell it; y until they do.
    """

    def __init__(self, given: str) -> None:
        self.axis: Literal["x", "y"] = "x" if given == "x" else "y"
        self._seeks = given not in ("x", "y")
        self._kept: list[tuple[float, float, float]] = []
        self._count, self._every, self._next = 0, 1, _FIRST
        self._t = -math.inf

    def add(self, instant: Instant) -> Literal["x", "y"]:
        """The axis with one instant more; one that is told again counts once."""
        if self._seeks and instant.t > self._t:
            self._t = instant.t
            self._keep(instant)
            if self._count >= self._next:
                self._next = math.ceil(self._count * _GROWTH)
                exx, eyy, exy = np.array(self._kept, np.float64).T
                self.axis = load_axis(exx, eyy, exy).axis
        return self.axis

    def _keep(self, instant: Instant) -> None:
        if self._count % self._every == 0:
            self._kept.append((instant.exx, instant.eyy, instant.exy))
        self._count += 1
        if len(self._kept) > MOST_INSTANTS:
            del self._kept[1::2]
            self._every *= 2
