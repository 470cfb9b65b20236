"""The initial layout of the viewer: the views, what each shows, and their sizes (rerun blueprint).

Paints the large figures, readable from two metres; red while an alarm is active.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import drawn_letters, load_cv2
from acquire.text import Message
from live.ui.rerun.drawing.shapes import BACKGROUND
from live.ui.rerun.messages import MAPS, LargeFigures, ViewSetup
from live.words.language import told

WIDTH, HEIGHT = 1600, 168
"""px of the picture; the digits are nearly half of the height."""

Colour = tuple[int, int, int]  # blue, green, red
WHITE, GREY, RED, GREEN, AMBER, BAR = (
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
    "live": WHITE, "old": GREY, "beyond": _BEYOND,
    "REC": _BEYOND, "ARMED": AMBER, "NOT RECORDING": AMBER, "REPLAY": GREY, "PAUSED": AMBER,
}  # fmt: skip
"""Of a tone; other states are green."""


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
