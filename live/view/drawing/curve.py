"""The axes to draw the stress-strain (or load-strain) curve on. Plain numbers; nothing is drawn here."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from live.maps import nice_above, ticks, unit_for

MAX_POINTS = 800
"""Of the curve, thinned; the newest always there."""


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
