"""The means of all measured instants, kept in memory for the summary and the status line; the axis they tell."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from acquire.load_cell import LoadLog
from analysis.evaluate import LoadAxis, load_axis
from live.measure.instant import AXIAL, TRANSVERSE, Instant, strains_along
from live.measure.kept import Instants
from live.measure.thinned import Thinned

Array = NDArray[np.float64]
MOST_INSTANTS = 2000
"""That are kept, evenly thinned."""
_FIRST, _GROWTH = 8, 1.1  # looked at first, and again whenever there are so many times more


class History:
    """All instants so far: added by one thread, read by any.

    Parameters
    ----------
    axis : "x", "y" or "auto"
        Of the load, as given.
    """

    def __init__(self, axis: str = "y") -> None:
        self.instants, self._finder = Instants(), AxisFinder(axis)

    def add(self, instant: Instant) -> None:
        """Keep ``instant``."""
        self.instants.append(instant)
        self._finder.add(instant)

    @property
    def axis_by_now(self) -> Literal["x", "y"]:
        """Of the load: as given, or as the strains so far show it; y until they do."""
        return self._finder.axis

    @property
    def told_something(self) -> bool:
        """Whether any ZOI had a value at any instant."""
        return bool(self.column("n_valid").any())

    def column(self, name: str) -> Array:
        """One quantity over time, (N,) float64."""
        return self.instants.column(name)

    def forces(self, loads: LoadLog) -> Array:
        """The force at each instant with all samples that have come by now, (N,) float64, N.

        As if the zero of the first instant had held to the end: a tare in mid-test is no unloading.
        """
        return loads.forces_one_zero(self.column("t").tolist())

    def tared_in_mid_test(self, loads: LoadLog) -> float:
        """What tares after the first instant have taken off the force by the last one, N."""
        t = self.column("t")
        return loads.zero_at(t[-1]) - loads.zero_at(t[0]) if t.size else 0.0

    def axis(self, given: str) -> LoadAxis:
        """Of the load: "x" or "y" as ``given``, or what all instants tell where that is "auto"."""
        return load_axis(self.column("exx"), self.column("eyy"), self.column("exy"), given)

    def along(self, axis: str) -> tuple[Array, Array]:
        """Strain along and across the load: the gauges ``axial`` and ``transverse``, or else the means."""
        chosen = axis if axis in ("x", "y") else self.axis(axis).axis
        axial, transverse = strains_along(self.instants.gauges, chosen)
        return self._strain(axial), self._strain(transverse)

    def _strain(self, name: str) -> Array:
        gauge = self.gauge(name) if name in (AXIAL, TRANSVERSE) else None
        return self.column(name) if gauge is None else gauge

    def gauge(self, name: str) -> Array | None:
        """A gauge over time, (N,) float64; None where there is none of that name."""
        return self.instants.gauge(name)


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
        self._strains: Thinned[tuple[float, float, float]] = Thinned(MOST_INSTANTS)
        self._count, self._next = 0, _FIRST
        self._t = -math.inf

    def add(self, instant: Instant) -> Literal["x", "y"]:
        """The axis with one instant more; one that is told again counts once."""
        if self._seeks and instant.t > self._t:
            self._t, self._count = instant.t, self._count + 1
            self._strains.append((instant.exx, instant.eyy, instant.exy))
            if self._count >= self._next:
                self._next = math.ceil(self._count * _GROWTH)
                exx, eyy, exy = np.array(self._strains.kept, np.float64).T
                self.axis = load_axis(exx, eyy, exy).axis
        return self.axis
