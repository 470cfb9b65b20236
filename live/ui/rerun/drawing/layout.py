"""The layout of the viewer, and what it shows besides pictures and maps.

The views, what each shows, and their sizes (rerun blueprint); the stress-strain (or load-strain) curve with its own
axes, since rerun has no x-y plot; the large figures, readable from two metres, red while an alarm is active.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import drawn_letters, load_cv2
from acquire.text import Message
from live.results.maps.colours import nice_above, number, ticks, unit_for
from live.ui.rerun.drawing.shapes import BACKGROUND, DIM, GREY, ORANGE, polylines, text_labels
from live.ui.rerun.messages import MAPS, LargeFigures, ViewSetup
from live.words.language import told

MAX_POINTS = 800
"""Of the curve, thinned; the newest point is always drawn."""

WIDTH, HEIGHT = 1600, 168
"""px of the picture; the digits are nearly half of the height."""

Colour = tuple[int, int, int]  # blue, green, red
WHITE, PALE, RED, GREEN, AMBER, BAR = (
    (248, 246, 244),
    (167, 157, 147),
    (30, 38, 179),
    (124, 207, 62),
    (61, 184, 245),
    (36, 29, 23),
)
_LABELS = (204, 195, 185)
_CELLS = ((14, 370), (400, 506), (920, 346), (1280, 306))  # left edge and width
_LABEL_Y, _VALUE_Y, _LINE_Y = 28, 116, 157  # base lines
_BEYOND = (106, 110, 255)  # red on the dark ground
_INKS = {
    "live": WHITE, "old": PALE, "beyond": _BEYOND,
    "REC": _BEYOND, "ARMED": AMBER, "NOT RECORDING": AMBER, "REPLAY": PALE, "PAUSED": AMBER,
}  # fmt: skip
"""Of a tone; other states are green."""

BAR_GAP, BAR_WIDTH, BAR_LABEL, BAR_END = 0.03, 0.035, 0.16, 0.275
"""Colour bar, right of the picture: its left edge, width, middle and right end of its labels.

In ``bar_unit``s, like everything that depends on the size of letters.
"""

BAR_TOP, BAR_HEIGHT = 0.12, 0.84
"""Its top edge (the unit stands above) and height, in heights of the picture."""

LETTER = 0.028
"""About half the height of a line of text, in ``bar_unit``s."""

CURVE_WIDTH = 1.6
"""Width of the curve's rectangle; its height is 1."""

_CAMERA = Message("Camera")
_TITLES = {"e1": Message("e1 (largest)"), "e2": Message("e2 (smallest)")}

_WIDE = 2.2
"""Pictures wider than so many heights are placed one above the other."""

ROWS = [2.4, 5.6, 3.8]
"""Shares of the height: the large figures, the pictures, plots and texts."""

VALUES = "/specimen/values"
"""Entity with the values of every ZOI, shown where one is pointed at or clicked."""


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


def paint(shown: LargeFigures) -> NDArray[np.uint8]:
    """(HEIGHT, WIDTH, 3) uint8, blue, green, red."""
    alarmed = shown.alarmed
    picture = np.empty((HEIGHT, WIDTH, 3), np.uint8)
    picture[:] = RED if alarmed else BAR
    labels = WHITE if alarmed else _LABELS
    for (x, width), (label, value, tone) in zip(_CELLS, shown.cells, strict=False):
        _write(picture, label, (x, _LABEL_Y), 24, width, labels)
        is_thin = tone in ("old", "REPLAY") and value != "-"
        ink = (_LABELS if is_thin else WHITE) if alarmed else _INKS.get(tone, GREEN)
        _write(picture, value, (x, _VALUE_Y), 76, width, ink, is_thin=is_thin)
    _write(picture, shown.line, (14, _LINE_Y), 29, WIDTH - 28, labels)
    return picture


def _write(
    picture: NDArray[Any],
    text: str,
    at: tuple[int, int],
    height: int,
    width: int,
    colour: Colour,
    *,
    is_thin: bool = False,
) -> None:
    """Write text of ``height`` px on a base line, smaller where it would be wider than ``width``."""
    cv2 = load_cv2()
    font, thick = cv2.FONT_HERSHEY_SIMPLEX, 1 if is_thin else max(2, height // 12)
    text = drawn_letters(text)
    scale = cv2.getFontScaleFromHeight(font, height, thick)
    (wide, _), _ = cv2.getTextSize(text, font, scale, thick)
    if wide > width:
        scale, thick = scale * width / wide, 1 if is_thin else max(2, int(thick * width / wide))
    cv2.putText(picture, text, at, font, scale, colour, thick, cv2.LINE_AA)


def gauge_path(name: str) -> str:
    """Entity with the strain of a gauge over time."""
    return f"gauges/{name}"


def bar_unit(setup: ViewSetup) -> float:
    """A length that has about the same size on the screen for all shapes of picture, px."""
    return math.sqrt(setup.width * setup.height)


def blueprint(setup: ViewSetup) -> Any:
    """The layout for a test: the pictures on the left, curves, status and events on the right."""
    import rerun.blueprint as rrb

    return rrb.Blueprint(
        rrb.Vertical(
            *([] if setup.finished else [_large_figures()]),
            _middle(setup),
            _below(setup),
            row_shares=ROWS[1:] if setup.finished else ROWS,
        ),
        rrb.TimePanel(
            state="collapsed", timeline="time", play_state="paused" if setup.finished else "following"
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="expanded" if setup.finished else "collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def _large_figures() -> Any:
    """The large figures."""
    import rerun.blueprint as rrb

    bounds = rrb.VisualBounds2D(x_range=[0, WIDTH], y_range=[0, HEIGHT])
    return rrb.Spatial2DView(
        origin="/figures", name=told(Message("Now")), visual_bounds=bounds, background=[*BACKGROUND, 255]
    )


def _middle(setup: ViewSetup) -> Any:
    """Picture, maps as tabs (the strain along the load in front), and the curve where there is a load."""
    import rerun.blueprint as rrb

    axial = "eyy" if setup.axis == "y" else "exx"
    maps = rrb.Tabs(*(_map(setup, name) for name in (*MAPS, *setup.whole)), active_tab=MAPS.index(axial))
    curve = [_curve(setup)] if setup.with_load else []
    if setup.width > _WIDE * setup.height:
        return rrb.Horizontal(
            rrb.Vertical(_camera(setup), maps), *curve, column_shares=[5, 3][: 1 + len(curve)]
        )
    return rrb.Horizontal(_camera(setup), maps, *curve)


def _below(setup: ViewSetup) -> Any:
    import rerun.blueprint as rrb

    plots = [_strains(setup), *([_load()] if setup.with_load else [])]
    status = rrb.TextDocumentView(origin="/status", name=told(Message("Status")))
    shares = [4, 3, 3, 4] if setup.with_load else [6, 3, 4]
    return rrb.Horizontal(*plots, status, _events(), column_shares=shares)


def _camera(setup: ViewSetup) -> Any:
    return _picture_view(setup, _CAMERA, ["/camera/**", "/zoi/**", "/specimen/zoi/**", "/specimen/gauges/**"])


def _map(setup: ViewSetup, name: str) -> Any:
    return _picture_view(
        setup,
        _TITLES.get(name, name),
        [
            *("/camera/picture", f"/specimen/map/{name}", "/specimen/gauges/**", f"/bar/{name}/**"),
            *[VALUES] * setup.finished,
        ],
    )


def _picture_view(setup: ViewSetup, name: str, contents: list[str]) -> Any:
    import rerun.blueprint as rrb

    w, h = setup.width, setup.height
    margin, unit = 0.02 * max(w, h), bar_unit(setup)
    if name == _CAMERA:
        # Space for a line of text above.
        x_range, y_range = [-margin, w + margin], [-0.1 * unit, h + margin]
    else:
        x_range, y_range = [-margin, w + BAR_END * unit], [-margin, h + margin]
    bounds = rrb.VisualBounds2D(x_range=x_range, y_range=y_range)
    return rrb.Spatial2DView(
        origin="/", contents=contents, name=told(name), visual_bounds=bounds, background=[*BACKGROUND, 255]
    )


def _strain() -> Any:
    return _plot("/strain", Message("Mean strain ± sigma, µm/m"), legend=True)


def _strains(setup: ViewSetup) -> Any:
    """The mean strain; where there are gauges, theirs in a tab in front of it."""
    import rerun.blueprint as rrb

    if not setup.gauges:
        return _strain()
    gauges = _plot("/gauges", Message("Gauges ± sigma, µm/m"), legend=True)
    return rrb.Tabs(gauges, _strain(), active_tab=0)


def _load() -> Any:
    return _plot("/load", Message("Load, N"), legend=False)


def _plot(origin: str, name: str, *, legend: bool) -> Any:
    import rerun as rr
    import rerun.blueprint as rrb

    # Without this only the last half minute of a running test is shown.
    whole = rr.TimeRange(rr.TimeRangeBoundary.infinite(), rr.TimeRangeBoundary.infinite())
    return rrb.TimeSeriesView(
        origin=origin,
        name=told(name),
        axis_x=rrb.TimeAxis(view_range=whole),
        plot_legend=rrb.PlotLegend("LeftTop", visible=legend),
    )


def _events() -> Any:
    import rerun.blueprint as rrb

    # The time column of rerun is too narrow to be read; the text begins with the time instead.
    hidden = rrb.encodings.TimelineColumn("time", visible=False)
    columns = rrb.TextLogColumns(timeline_columns=[hidden], text_log_columns=["LogLevel", "Body"])
    return rrb.TextLogView(origin="/events", name=told(Message("Events")), columns=columns)


def _curve(setup: ViewSetup) -> Any:
    import rerun.blueprint as rrb

    title = Message("Stress – strain") if setup.area_m2 else Message("Load – strain")
    bounds = rrb.VisualBounds2D(x_range=[-0.3, CURVE_WIDTH + 0.17], y_range=[-0.25, 1.3])
    return rrb.Spatial2DView(
        origin="/curve", name=told(title), visual_bounds=bounds, background=[*BACKGROUND, 255]
    )
