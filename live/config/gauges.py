"""The virtual gauges of the configuration: each a table ``[gauges.NAME]``, made into a gauge on a grid.

The keys of a table are the parameters of its kind of gauge (``analysis.evaluate.GAUGE_KINDS``). The gauges with
the names ``axial`` and ``transverse`` give the stress-strain curve.
"""

from __future__ import annotations

import cmath
import math
import re
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from acquire.errors import ConfigError
from acquire.text import Message
from analysis.evaluate import GAUGE_KINDS, Gauge, LineGauge, Parameter
from live.config.values import CORNERS, POINT, RECTANGLE, Check, choice, integer, length, number

if TYPE_CHECKING:
    from analysis import ZoiGrid

Point = tuple[float, float]
GaugeTable = Mapping[str, Any]
"""``kind`` and the given parameters of one gauge, as plain values for JSON."""

NAME_PATTERN = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,31}")
"""The name of a gauge is part of column names in files."""
DEFAULT_KIND = "line"
"""The kind of a gauge without ``kind``."""
MAX_COLOUR = 999
_OFF_DEG = 10.0  # by which a line and its ZOIs may differ: 4 % of the strain of a tensile test
_POSITIONS = {"point": POINT, "box": RECTANGLE, "corners": CORNERS}


def gauge_checks(kind: object) -> dict[str, Check]:
    """The checks of the keys of a gauge; keys of other kinds are checked too, and have no effect."""
    own = [one for name, one in GAUGE_KINDS.items() if name == kind]
    checks = {"kind": choice(*GAUGE_KINDS), "colour": integer(0, MAX_COLOUR)}
    for one in (*GAUGE_KINDS.values(), *own):
        checks |= {key: _check(found) for key, found in one.parameters().items()}
    return checks


def _check(one: Parameter) -> Check:
    if one.kind == "choice":
        return choice(*one.choices)
    return length(number(one.low, one.high)) if one.kind == "length" else _POSITIONS[one.kind]


def with_colours(tables: Mapping[str, GaugeTable]) -> dict[str, GaugeTable]:
    """The tables, each with the index of its colour: the given one, else the first that is free.

    So a gauge keeps its colour when it is renamed, or when another one is removed.
    """
    taken = {table.get("colour") for table in tables.values()}
    free = (index for index in range(MAX_COLOUR + 1) if index not in taken)
    return {
        name: table if table.get("colour") is not None else {**table, "colour": next(free, 0)}
        for name, table in tables.items()
    }


def gauge_colours(tables: Mapping[str, GaugeTable]) -> dict[str, int]:
    """The index of the colour of each gauge."""
    return {name: table["colour"] for name, table in with_colours(tables).items()}


def make_gauge(name: str, table: GaugeTable, axis: str) -> Gauge:
    """The gauge of a table, for a load along ``axis`` ("x" or "y"); raises ConfigError."""
    try:
        return GAUGE_KINDS[table.get("kind", DEFAULT_KIND)].of(name, table, axis)
    except ValueError as error:
        raise ConfigError("gauges.{name}: {error}", name, error) from None


def gauges_for(tables: Mapping[str, GaugeTable], axis: str, grid: ZoiGrid) -> tuple[Gauge, ...]:
    """The gauges of a configuration on a grid, in its order, for a load along ``axis`` ("x" or "y").

    Raises
    ------
    ConfigError
        A key is missing or impossible, or a gauge covers no ZOI.
    """
    gauges = tuple(make_gauge(name, table, axis) for name, table in tables.items())
    for gauge in gauges:
        _check_zois(gauge, grid)
    return gauges


def _check_zois(gauge: Gauge, grid: ZoiGrid) -> None:
    if all(mask.any() for mask in gauge.zois(grid)):
        return _check_ends(gauge, grid) if isinstance(gauge, LineGauge) else None
    raise ConfigError(
        "gauges.{name}: no ZOI is there; their centres reach from {x:g}, {y:g} to {x2:g}, {y2:g} px, "
        "less the mask; move or widen the gauge",
        gauge.name,
        grid.x[0],
        grid.y[0],
        grid.x[-1],
        grid.y[-1],
    )


def _check_ends(gauge: LineGauge, grid: ZoiGrid) -> None:
    """A line of about the step between ZOIs has nearly the same at both ends, and those that differ lie aside."""
    length, asked = _lengths(gauge, grid)
    off = abs(math.degrees(cmath.phase(length / asked)))
    if abs(length) < grid.step / 2 or off > _OFF_DEG:
        raise ConfigError(
            "gauges.{name}: the ZOIs at its ends are {length:.3g} px apart, {off:.0f} degrees off the line: "
            "make it longer than a ZOI, within the region",
            gauge.name,
            abs(length),
            off,
        )


def partly(gauge: Gauge, grid: ZoiGrid) -> str:
    """What of a gauge lies off the region or over holes, in words; empty where that is little."""
    share = gauge.share(grid)
    if share == 1:
        return ""
    if not isinstance(gauge, LineGauge):
        return Message(
            "gauge {name}: {share:.0%} of its area lies where nothing is measured; its value is of the rest: move it",
            gauge.name,
            1 - share,
        )
    length, asked = (abs(one) for one in _lengths(gauge, grid))
    return Message(
        "gauge {name}: L0 is {length:.0f} px, {asked:.0f} were asked for: its ends lie off the ZOIs; move them",
        gauge.name,
        length,
        asked,
    )


def _lengths(gauge: LineGauge, grid: ZoiGrid) -> tuple[complex, complex]:
    """From the ZOIs at one end of a line to those at the other, and between the ends as given, px."""
    x, y = np.meshgrid(grid.x, grid.y)
    places = [complex(x[mask].mean(), y[mask].mean()) for mask in gauge.zois(grid)]
    return places[1] - places[0], complex(*gauge.end) - complex(*gauge.start)


def complete_gauges(gauges: Mapping[str, GaugeTable], axis: str = "y") -> Iterator[Gauge]:
    """The gauges of which no key is missing, for drawing."""
    for name, table in gauges.items():
        try:
            yield make_gauge(name, table, axis)
        except ConfigError:
            continue


def outlines(gauges: Mapping[str, GaugeTable], zoi: float) -> dict[str, tuple[tuple[Point, ...], ...]]:
    """The outline of each complete gauge, px, for ZOIs with a side of ``zoi`` px."""
    return {gauge.name: gauge.outline(zoi) for gauge in complete_gauges(gauges)}
