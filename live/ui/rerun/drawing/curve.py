"""Draws the stress-strain (or load-strain) curve with axes of its own; rerun has no x-y plot.

The axes to draw the stress-strain (or load-strain) curve on. Plain numbers; nothing is drawn here.

What the scene is made of: words, lines, rounded numbers and encoded pictures.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2
from live.results.maps.colours import nice_above, number, ticks, unit_for
from live.ui.rerun.drawing.layout import CURVE_WIDTH
from live.ui.rerun.messages import ViewSetup

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

    def sink(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
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


GREY, DIM = (170, 175, 185), (62, 66, 74)
ORANGE, CYAN, YELLOW = (255, 169, 64), (64, 224, 255), (255, 212, 59)


def words(sinks: Any, labels: list[str], colour: Any = GREY) -> Any:
    """Text hung below its places."""
    import rerun as rr

    return rr.Points2D(sinks, labels=labels, colors=colour, radii=0.0, show_labels=True, draw_order=40)


def lines(strips: Any, colour: tuple[int, int, int], radius: float) -> Any:
    """Polylines; the thicker lie above."""
    import rerun as rr

    return rr.LineStrips2D(strips, colors=colour, radii=rr.Radius.ui_points(radius), draw_order=radius)


def rounded(value: float, axis: Axis) -> str:
    """A value with its unit, in three or four digits of the axis."""
    digits = max(0, 2 - math.floor(math.log10(max(abs(axis.low), abs(axis.high)) * axis.factor)))
    return f"{number(round(value * axis.factor, digits))} {axis.unit}"


def reduced(image: NDArray[Any], bits: int, longest_px: int) -> tuple[NDArray[np.uint8], int]:
    """An 8-bit picture of at most ``longest_px``, and the whole factor it was reduced by."""
    cv2 = load_cv2()

    factor = max(1, math.ceil(max(image.shape) / longest_px))
    if factor > 1:
        size = image.shape[1] // factor, image.shape[0] // factor
        image = cv2.resize(image[: size[1] * factor, : size[0] * factor], size, interpolation=cv2.INTER_AREA)
    if bits != 8:
        image = cv2.convertScaleAbs(image, alpha=255.0 / (2**bits - 1))
    return image, factor


def encode(kind: str, image: NDArray[np.uint8], quality: int) -> bytes:
    """The file ``kind`` (".jpg", ".png") of an image in OpenCV's order of colours."""
    cv2 = load_cv2()

    flag = cv2.IMWRITE_JPEG_QUALITY if kind == ".jpg" else cv2.IMWRITE_PNG_COMPRESSION
    _, data = cv2.imencode(kind, image, [flag, quality])
    return bytes(data)


class CurveDrawing:
    """The curve in a rectangle ``CURVE_WIDTH`` wide and 1 high.

    Parameters
    ----------
    log : callable
        Takes an entity path and what to show there.
    log_change : callable
        The same for what is drawn only where it changes.
    setup : ViewSetup
    """

    def __init__(
        self, log: Callable[[str, Any], None], log_change: Callable[[str, Any], None], setup: ViewSetup
    ) -> None:
        self._log, self._log_change, self._setup = log, log_change, setup
        self._axes: tuple[Axis, Axis] | None = None

    def forget(self) -> None:
        """Draw the axes anew with the next points."""
        self._axes = None

    def draw(self, points: NDArray[np.float64]) -> None:
        """Draw (N, 2) pairs of strain and force (N); those that have both."""
        import rerun as rr

        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            return
        area = self._setup.area_m2
        vertical = points[:, 1] / area if area else points[:, 1]
        axes = strain_axis(points[:, 0]), (stress_axis if area else force_axis)(vertical)
        if axes != self._axes:
            self._axes = axes
            self._draw_axes(*axes)
        across, up = axes
        placed = np.stack([across.sink(points[:, 0]) * CURVE_WIDTH, 1.0 - up.sink(vertical)], axis=1)
        self._log(
            "curve/line",
            rr.LineStrips2D([placed], colors=ORANGE, radii=rr.Radius.ui_points(1.25), draw_order=10),
        )
        tip = rr.Points2D([placed[-1]], colors=ORANGE, radii=rr.Radius.ui_points(4.0), draw_order=20)
        self._log("curve/tip", tip)
        right = placed[-1, 0] > 0.7 * CURVE_WIDTH
        beside = placed[-1] + [-0.3 if right else 0.3, 0.17 if placed[-1, 1] < 0.7 else -0.25]
        label = f"{rounded(points[-1, 0], across)}, {rounded(vertical[-1], up)}"
        self._log("curve/value", words([beside], [label], ORANGE))

    def _draw_axes(self, across: Axis, up: Axis) -> None:
        x = across.sink(np.array(across.ticks)) * CURVE_WIDTH
        y = 1.0 - up.sink(np.array(up.ticks))
        rules = [[[xk, 0.0], [xk, 1.0]] for xk in x] + [[[0.0, yk], [CURVE_WIDTH, yk]] for yk in y]
        self._log_change("curve/grid", lines(rules, DIM, 0.5))
        x0, y0 = float(across.sink(np.array(0.0))) * CURVE_WIDTH, 1.0 - float(up.sink(np.array(0.0)))
        self._log_change(
            "curve/axes", lines([[[0.0, y0], [CURVE_WIDTH, y0]], [[x0, 0.0], [x0, 1.0]]], GREY, 0.75)
        )
        # rerun hangs a label below its place: a little higher puts it on the line.
        sinks = [*([xk, 1.03] for xk in x), *([-0.13, yk - 0.05] for yk in y)]
        labels = [number(v * across.factor) for v in across.ticks] + [number(v * up.factor) for v in up.ticks]
        what = "stress" if self._setup.area_m2 else "load"
        names = [f"axial strain ({across.unit})", f"{what} ({up.unit})"]
        titles = [[CURVE_WIDTH / 2, 1.15], [0.0, -0.2]]
        self._log_change("curve/ticks", words([*sinks, *titles], [*labels, *names]))
