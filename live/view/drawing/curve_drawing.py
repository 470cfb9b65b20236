"""Draws the stress-strain (or load-strain) curve with axes of its own; rerun has no x-y plot."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from live.maps import number
from live.view.drawing.curve import Axis, force_axis, strain_axis, stress_axis
from live.view.drawing.layout import CURVE_WIDTH
from live.view.drawing.marks import DIM, GREY, ORANGE, lines, rounded, words
from live.view.exchange.setup import ViewSetup


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
        placed = np.stack([across.place(points[:, 0]) * CURVE_WIDTH, 1.0 - up.place(vertical)], axis=1)
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
        x = across.place(np.array(across.ticks)) * CURVE_WIDTH
        y = 1.0 - up.place(np.array(up.ticks))
        rules = [[[xk, 0.0], [xk, 1.0]] for xk in x] + [[[0.0, yk], [CURVE_WIDTH, yk]] for yk in y]
        self._log_change("curve/grid", lines(rules, DIM, 0.5))
        x0, y0 = float(across.place(np.array(0.0))) * CURVE_WIDTH, 1.0 - float(up.place(np.array(0.0)))
        self._log_change(
            "curve/axes", lines([[[0.0, y0], [CURVE_WIDTH, y0]], [[x0, 0.0], [x0, 1.0]]], GREY, 0.75)
        )
        # rerun hangs a label below its place: a little higher puts it on the line.
        places = [*([xk, 1.03] for xk in x), *([-0.13, yk - 0.05] for yk in y)]
        labels = [number(v * across.factor) for v in across.ticks] + [number(v * up.factor) for v in up.ticks]
        what = "stress" if self._setup.area_m2 else "load"
        names = [f"axial strain ({across.unit})", f"{what} ({up.unit})"]
        titles = [[CURVE_WIDTH / 2, 1.15], [0.0, -0.2]]
        self._log_change("curve/ticks", words([*places, *titles], [*labels, *names]))
