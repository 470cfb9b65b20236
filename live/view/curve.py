"""The stress-strain (or load-strain) curve as points, and the axes to draw it on.

Joins each strain to the force at its time, which may become known only later. Arrays and plain
numbers only; nothing is drawn here.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from live.maps import nice_above, ticks, unit_for
from live.view.thinned import Thinned

MAX_POINTS = 800
_MAX_GAP_S = 0.5
_LOADS = 4000


class ForceStrain:
    """Pairs of strain and force.

    A force that came with the strain counts; else it is interpolated from the load samples
    around its time, as soon as there are some on both sides.
    """

    def __init__(self) -> None:
        self._loads: deque[tuple[float, float]] = deque(maxlen=_LOADS)
        self._waiting: deque[tuple[float, float]] = deque(maxlen=_LOADS)
        self._points: Thinned[tuple[float, float]] = Thinned(MAX_POINTS)

    def load(self, t: float, force: float) -> None:
        """One load sample (s, N)."""
        if self._loads and t < self._loads[-1][0]:
            return
        self._loads.append((t, force))

    def strain(self, t: float, strain: float, force: float) -> None:
        """One measured strain, with its force (N) where it is known, else NaN."""
        if not math.isfinite(strain):
            return
        if math.isfinite(force):
            self._add(strain, force)
        else:
            self._waiting.append((t, strain))

    def points(self) -> NDArray[np.float64]:
        """(N, 2) strain, force; thinned to at most ``MAX_POINTS``, the newest always there."""
        while self._waiting and self._loads and self._loads[-1][0] >= self._waiting[0][0]:
            t, strain = self._waiting.popleft()
            self._add(strain, self._force_at(t))
        return np.array(self._points.items(), np.float64).reshape(-1, 2)

    def _add(self, strain: float, force: float) -> None:
        if math.isfinite(force):
            self._points.append((strain, force))

    def _force_at(self, t: float) -> float:
        times = [sample[0] for sample in self._loads]
        after = bisect_left(times, t)
        if after == 0:
            return self._loads[0][1] if times[0] == t else math.nan
        (t0, f0), (t1, f1) = self._loads[after - 1], self._loads[after]
        return math.nan if t1 - t0 > _MAX_GAP_S else f0 + (f1 - f0) * (t - t0) / (t1 - t0)


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis: range in base units, ticks and labels as shown.

    Attributes
    ----------
    low, high : float
        In base units (dimensionless strain, Pa or N).
    factor : float
        shown = base * factor
    unit : str
    ticks : tuple of float
        In base units.
    """

    low: float
    high: float
    factor: float
    unit: str
    ticks: tuple[float, ...]

    def place(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """0..1 along the axis."""
        placed: NDArray[np.float64] = (values - self.low) / (self.high - self.low)
        return placed


def strain_axis(values: NDArray[np.float64]) -> Axis:
    """An axis for strains; microstrain, or percent from 2 % on."""
    low, high = _range(values, 2e-4)
    unit = unit_for(float(np.abs(values).max(initial=0.0)))
    return _axis(low, high, unit.factor, unit.name)


def stress_axis(values: NDArray[np.float64]) -> Axis:
    """An axis for stresses in Pa, shown in MPa."""
    return _axis(*_range(values, 1e6), 1e-6, "MPa")


def force_axis(values: NDArray[np.float64]) -> Axis:
    """An axis for forces in N, shown in kN from 10 kN on."""
    low, high = _range(values, 1.0)
    large = float(np.abs(values).max(initial=0.0)) >= 1e4
    return _axis(low, high, 1e-3 if large else 1.0, "kN" if large else "N")


def _axis(low: float, high: float, factor: float, unit: str) -> Axis:
    marks = tuple(mark / factor for mark in ticks(low * factor, high * factor, 6))
    return Axis(low, high, factor, unit, marks)


def _range(values: NDArray[np.float64], least: float) -> tuple[float, float]:
    # Zero is always in the picture; a side that is only noise gets no room of its own.
    top, bottom = max(float(np.max(values, initial=0.0)), 0.0), min(float(np.min(values, initial=0.0)), 0.0)
    size = max(top, -bottom, least)
    high = nice_above(top * 1.04) if top > 0.02 * size else 0.0
    low = -nice_above(-bottom * 1.04) if -bottom > 0.02 * size else 0.0
    return (0.0, nice_above(least)) if high == low else (low, high)
