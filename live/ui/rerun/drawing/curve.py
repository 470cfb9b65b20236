"""Draws the stress-strain (or load-strain) curve with its own axes: rerun has no x-y plot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.text import Message
from live.results.maps.colours import nice_above, number, ticks, unit_for
from live.ui.rerun.drawing.layout import CURVE_WIDTH
from live.ui.rerun.drawing.shapes import DIM, GREY, ORANGE, polylines, text_labels
from live.ui.rerun.messages import ViewSetup
from live.words.language import told

MAX_POINTS = 800
"""Of the curve, thinned; the newest point is always drawn."""


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

    def position(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions along the axis, 0..1."""
        share: NDArray[np.float64] = (values - self.low) / (self.high - self.low)
        return share


def strain_axis(values: NDArray[np.float64]) -> Axis:
    """An axis for strains, in µm/m or %."""
    low, high = _range(values, 2e-4)
    unit = unit_for(float(np.abs(values).max(initial=0.0)))
    return _axis(low, high, unit.factor, unit.name)


def stress_axis(values: NDArray[np.float64]) -> Axis:
    """An axis for stresses in Pa, shown in MPa."""
    return _axis(*_range(values, 1e6), 1e-6, "MPa")


def force_axis(values: NDArray[np.float64]) -> Axis:
    """An axis for forces in N, shown in N or kN."""
    unit = unit_for(float(np.abs(values).max(initial=0.0)), "force")
    return _axis(*_range(values, 1.0), unit.factor, unit.name)


def _axis(low: float, high: float, factor: float, unit: str) -> Axis:
    marks = tuple(mark / factor for mark in ticks(low * factor, high * factor, 6))
    return Axis(low, high, factor, unit, marks)


def _range(values: NDArray[np.float64], min_size: float) -> tuple[float, float]:
    # Zero is always shown; a side with nothing but noise takes no space.
    top, bottom = max(float(np.max(values, initial=0.0)), 0.0), min(float(np.min(values, initial=0.0)), 0.0)
    size = max(top, -bottom, min_size)
    high = nice_above(top * 1.04) if top > 0.02 * size else 0.0
    low = -nice_above(-bottom * 1.04) if -bottom > 0.02 * size else 0.0
    return (0.0, nice_above(min_size)) if high == low else (low, high)


def rounded(value: float, axis: Axis) -> str:
    """A value with its unit, with three or four digits of the range of the axis."""
    digits = max(0, 2 - math.floor(math.log10(max(abs(axis.low), abs(axis.high)) * axis.factor)))
    return f"{number(round(value * axis.factor, digits))} {axis.unit}"


class CurveDrawing:
    """The curve in a rectangle ``CURVE_WIDTH`` wide and 1 high.

    Parameters
    ----------
    setup : ViewSetup
    """

    def __init__(self, setup: ViewSetup) -> None:
        self._setup = setup
        self._axes: tuple[Axis, Axis] | None = None

    def reset(self) -> None:
        """Draw the axes again with the next points."""
        self._axes = None

    def draw(self, points: NDArray[np.float64]) -> tuple[dict[str, Any], dict[str, Any]]:
        """What shows (N, 2) pairs of strain and force (N), by entity paths: the axes where they change, and the line.

        Pairs with NaN are left out.
        """
        import rerun as rr

        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            return {}, {}
        area = self._setup.area_m2
        vertical = points[:, 1] / area if area else points[:, 1]
        axes = strain_axis(points[:, 0]), (stress_axis if area else force_axis)(vertical)
        changed = {} if axes == self._axes else self._drawn_axes(*axes)
        self._axes = axes
        across, up = axes
        line = np.stack([across.position(points[:, 0]) * CURVE_WIDTH, 1.0 - up.position(vertical)], axis=1)
        right = line[-1, 0] > 0.7 * CURVE_WIDTH
        beside = line[-1] + [-0.3 if right else 0.3, 0.17 if line[-1, 1] < 0.7 else -0.25]
        label = f"{rounded(points[-1, 0], across)}, {rounded(vertical[-1], up)}"
        return changed, {
            "curve/line": rr.LineStrips2D(
                [line], colors=ORANGE, radii=rr.Radius.ui_points(1.25), draw_order=10
            ),
            "curve/tip": rr.Points2D(
                [line[-1]], colors=ORANGE, radii=rr.Radius.ui_points(4.0), draw_order=20
            ),
            "curve/value": text_labels([beside], [label], ORANGE),
        }

    def _drawn_axes(self, across: Axis, up: Axis) -> dict[str, Any]:
        x = across.position(np.array(across.ticks)) * CURVE_WIDTH
        y = 1.0 - up.position(np.array(up.ticks))
        rules = [[[xk, 0.0], [xk, 1.0]] for xk in x] + [[[0.0, yk], [CURVE_WIDTH, yk]] for yk in y]
        x0, y0 = float(across.position(np.array(0.0))) * CURVE_WIDTH, 1.0 - float(up.position(np.array(0.0)))
        cross = [[[0.0, y0], [CURVE_WIDTH, y0]], [[x0, 0.0], [x0, 1.0]]]
        # rerun draws a label below its position: a little higher puts it on the line.
        positions = [*([xk, 1.03] for xk in x), *([-0.13, yk - 0.05] for yk in y)]
        labels = [number(v * across.factor) for v in across.ticks] + [number(v * up.factor) for v in up.ticks]
        load, stress = Message("load ({unit})", up.unit), Message("stress ({unit})", up.unit)
        upward = stress if self._setup.area_m2 else load
        names = [told(Message("axial strain ({unit})", across.unit)), told(upward)]
        titles = [[CURVE_WIDTH / 2, 1.15], [0.0, -0.2]]
        return {
            "curve/grid": polylines(rules, DIM, 0.5),
            "curve/axes": polylines(cross, GREY, 0.75),
            "curve/ticks": text_labels([*positions, *titles], [*labels, *names]),
        }
