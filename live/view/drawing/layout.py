"""How the viewer opens: which view shows what, and where it stands (rerun blueprint)."""

from __future__ import annotations

import math
from typing import Any

from live.view.exchange.setup import STRAINS, ViewSetup

BAR_GAP, BAR_WIDTH, BAR_LABEL, BAR_ROOM = 0.03, 0.035, 0.16, 0.275
"""Colour bar, right of the picture: its left edge, width, middle and right end of its labels.

In ``bar_unit``s, like all that goes with the size of letters.
"""

BAR_TOP, BAR_HEIGHT = 0.12, 0.84
"""Its top edge (the unit stands above) and height, in heights of the picture."""

LETTER = 0.028
"""About half the height of a line of words, in ``bar_unit``s."""

CURVE_WIDTH = 1.6
"""Width of the curve's rectangle; its height is 1."""

BACKGROUND = (18, 20, 24)

VALUES = "/specimen/values"
"""Where every ZOI tells its values when it is pointed at or clicked."""


def bar_unit(setup: ViewSetup) -> float:
    """A length that has about the same size on the screen for all shapes of picture, px."""
    return math.sqrt(setup.width * setup.height)


def blueprint(setup: ViewSetup) -> Any:
    """The layout for a test: the pictures on the left, curves, status and events on the right."""
    import rerun.blueprint as rrb

    return rrb.Blueprint(
        rrb.Horizontal(_pictures(setup), _right(setup), column_shares=_shares(setup)),
        rrb.TimePanel(
            state="collapsed",
            timeline="time",
            play_state="paused" if setup.finished else "following",
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="expanded" if setup.finished else "collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def _shares(setup: ViewSetup) -> list[int]:
    square = 0.55 <= setup.width / setup.height <= 1.15
    return [5, 4] if square else [8, 5]


def _pictures(setup: ViewSetup) -> Any:
    import rerun.blueprint as rrb

    views = [_camera(setup), *(_map(setup, name) for name in STRAINS)]
    shape = setup.width / setup.height
    columns = 4 if shape < 0.55 else 1 if shape > 3.5 else 2
    return rrb.Grid(*views, grid_columns=columns)


def _camera(setup: ViewSetup) -> Any:
    return _picture_view(setup, "Camera", ["/camera/**", "/zoi/**", "/specimen/zoi/**"])


def _map(setup: ViewSetup, name: str) -> Any:
    return _picture_view(
        setup,
        f"Strain {name}",
        ["/camera/picture", f"/specimen/map/{name}", f"/bar/{name}/**", *[VALUES] * setup.finished],
    )


def _picture_view(setup: ViewSetup, name: str, contents: list[str]) -> Any:
    import rerun.blueprint as rrb

    w, h = setup.width, setup.height
    margin, unit = 0.02 * max(w, h), bar_unit(setup)
    if name == "Camera":
        # Room for a line of words above.
        x_range, y_range = [-margin, w + margin], [-0.1 * unit, h + margin]
    else:
        x_range, y_range = [-margin, w + BAR_ROOM * unit], [-margin, h + margin]
    bounds = rrb.VisualBounds2D(x_range=x_range, y_range=y_range)
    return rrb.Spatial2DView(
        origin="/", contents=contents, name=name, visual_bounds=bounds, background=[*BACKGROUND, 255]
    )


def _right(setup: ViewSetup) -> Any:
    import rerun.blueprint as rrb

    # Side by side they are high: rerun labels only whole decades where a plot is low.
    curves = rrb.Horizontal(_strain(), _load())
    middle = rrb.Horizontal(
        _curve(setup), rrb.TextDocumentView(origin="/status", name="Status"), column_shares=[5, 3]
    )
    return rrb.Vertical(curves, middle, _events(), row_shares=[10, 10, 5])


def _strain() -> Any:
    return _plot("/strain", "Mean strain ± sigma, µm/m", legend=True)


def _load() -> Any:
    return _plot("/load", "Load, N", legend=False)


def _plot(origin: str, name: str, *, legend: bool) -> Any:
    import rerun as rr
    import rerun.blueprint as rrb

    # Without this only the last half minute of a running test is shown.
    whole = rr.TimeRange(rr.TimeRangeBoundary.infinite(), rr.TimeRangeBoundary.infinite())
    return rrb.TimeSeriesView(
        origin=origin,
        name=name,
        axis_x=rrb.TimeAxis(view_range=whole),
        plot_legend=rrb.PlotLegend("LeftTop", visible=legend),
    )


def _events() -> Any:
    import rerun.blueprint as rrb

    # Rerun's own column of times is too narrow to be read; the text begins with the time instead.
    hidden = rrb.encodings.TimelineColumn("time", visible=False)
    columns = rrb.TextLogColumns(timeline_columns=[hidden], text_log_columns=["LogLevel", "Body"])
    return rrb.TextLogView(origin="/events", name="Events", columns=columns)


def _curve(setup: ViewSetup) -> Any:
    import rerun.blueprint as rrb

    what = "Stress" if setup.area_m2 else "Load"
    bounds = rrb.VisualBounds2D(x_range=[-0.3, CURVE_WIDTH + 0.17], y_range=[-0.25, 1.3])
    return rrb.Spatial2DView(
        origin="/curve", name=f"{what} – strain", visual_bounds=bounds, background=[*BACKGROUND, 255]
    )
