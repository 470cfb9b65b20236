"""Virtual gauges of the configuration: a table ``[gauges.NAME]`` each, made into gauges on a grid."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, cast

from acquire.errors import ConfigError
from live.setup.checks import CORNERS, POINT, RECTANGLE, choice, key, length, number

if TYPE_CHECKING:
    from analysis import ZoiGrid
    from analysis.evaluate import Gauge
    from live.setup.config import Config

Point = tuple[float, float]

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,31}")
"""A gauge's name stands in the columns of files."""


@dataclass(frozen=True, slots=True)
class GaugeConfig:
    """[gauges.NAME]; the gauges called ``axial`` and ``transverse`` make the stress-strain curve."""

    kind: str = key(choice("zoi", "area", "line", "transverse"), "line", "kind of gauge")
    at: tuple[float, float] | None = key(POINT, None, "x, y of the ZOI of a zoi, px", optional=True)
    start: tuple[float, float] | None = key(POINT, None, "x, y of one end of a line, px", optional=True)
    end: tuple[float, float] | None = key(POINT, None, "x, y of the other", optional=True)
    radius_px: float | None = key(
        length(number(0.1, 1e5)), None, "ZOIs this far around an end of a line (half a ZOI)", optional=True
    )
    box: tuple[float, float, float, float] | None = key(
        RECTANGLE, None, "x, y, width, height of an area or transverse gauge, px", optional=True
    )
    corners: tuple[tuple[float, float], ...] | None = key(
        CORNERS, None, "x, y of the corners of an area, px", optional=True
    )
    value: str | None = key(
        choice("exx", "eyy", "exy", "gamma_xy"),
        None,
        "strain of a zoi or area (along the load)",
        optional=True,
    )
    statistic: str = key(choice("mean", "largest", "smallest"), "mean", "of an area")
    along: str | None = key(
        choice("x", "y"), None, "direction of a transverse gauge (across the load)", optional=True
    )


def gauges_for(config: Config, grid: ZoiGrid) -> tuple[Gauge, ...]:
    """The gauges of the configuration, in its order.

    Raises
    ------
    ConfigError
        A key is missing or impossible, or no ZOI lies where a gauge is.
    """
    gauges = tuple(_gauge(name, table, config.specimen.first_axis) for name, table in config.gauges.items())
    for gauge in gauges:
        _check_place(gauge, grid)
    return gauges


def describe(table: GaugeConfig) -> dict[str, Any]:
    """What was said of a gauge, fit for JSON."""
    return {name: value for name, value in dataclasses.asdict(table).items() if value is not None}


def _gauge(name: str, g: GaugeConfig, axis: str) -> Gauge:
    from analysis.evaluate import AreaGauge, LineGauge, TransverseGauge, ZoiGauge

    value = g.value or ("exx" if axis == "x" else "eyy")
    try:
        if g.kind == "zoi":
            x, y = _said(name, g, "at")
            return ZoiGauge(name, x, y, value)
        if g.kind == "line":
            return LineGauge(name, _said(name, g, "start"), _said(name, g, "end"), g.radius_px)
        if g.kind == "transverse":
            x, y, width, height = _said(name, g, "box")
            across = cast(Literal["x", "y"], g.along or ("y" if axis == "x" else "x"))
            return TransverseGauge(name, x, y, width, height, across)
        if g.corners:
            return AreaGauge(name, g.corners, value, cast(Any, g.statistic))
        return AreaGauge.rectangle(name, _said(name, g, "box"), value, cast(Any, g.statistic))
    except ValueError as error:
        raise ConfigError(f"gauges.{name}: {error}") from None


def _said(name: str, g: GaugeConfig, field: str) -> Any:
    value = getattr(g, field)
    if value is None:
        raise ConfigError(f"gauges.{name}: a gauge of kind {g.kind!r} needs {field!r}")
    return value


def _check_place(gauge: Gauge, grid: ZoiGrid) -> None:
    from analysis.evaluate import gauge_zois

    if all(mask.any() for mask in gauge_zois(gauge, grid)):
        return
    raise ConfigError(
        f"gauges.{gauge.name}: no ZOI is there; the centres of ZOIs reach from {grid.x[0]:g}, {grid.y[0]:g} to"
        f" {grid.x[-1]:g}, {grid.y[-1]:g} px, and a mask may leave some out"
    )


def outlines(gauges: Mapping[str, GaugeConfig]) -> dict[str, tuple[Point, ...]]:
    """Where gauges lie, as lines to be drawn, px: an extensometer, the outline of an area, a cross on a ZOI."""
    drawn = {name: _outline(gauge) for name, gauge in gauges.items()}
    return {name: points for name, points in drawn.items() if points}


def _outline(gauge: GaugeConfig) -> tuple[Point, ...]:
    if gauge.start is not None and gauge.end is not None:
        return gauge.start, gauge.end
    if gauge.at is not None:
        (x, y), r = gauge.at, 8.0
        return (x - r, y), (x + r, y), (x, y), (x, y - r), (x, y + r)
    if gauge.corners is not None:
        return (*gauge.corners, gauge.corners[0])
    if gauge.box is not None:
        x0, y0, width, height = gauge.box
        x1, y1 = x0 + width, y0 + height
        return (x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)
    return ()
