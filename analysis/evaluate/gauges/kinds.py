"""The kinds of virtual gauges: a point, an area, a circle, a strip, and the extensometers.

A new kind is a class here and its name in ``GAUGE_KINDS``; configuration, report, view and page take it from there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from analysis.evaluate.gauges import geometry
from analysis.evaluate.gauges.extensometers import (
    BOX,
    END,
    RADIUS,
    START,
    ExtensionGauge,
    LineGauge,
    TransverseGauge,
)
from analysis.evaluate.gauges.gauge import Gauge, Parameter
from analysis.evaluate.gauges.readings import GaugeReading, Statistic, check_value
from analysis.field import ZoiGrid

_VALUE = Parameter(
    "choice",
    "strain of a zoi or area (along the load)",
    choices=("exx", "eyy", "exy", "gamma_xy"),
    by_axis={"x": "exx", "y": "eyy"},
)
_STATISTIC = Parameter(
    "choice", "of an area: affine fit, or of its ZOIs", choices=("affine", "mean", "largest", "smallest")
)
_AT = Parameter("point", "x, y of a zoi")
_CORNERS = Parameter("corners", "x, y of the corners of an area")
_CENTRE = Parameter("point", "x, y of the centre of a circle")
_WIDTH = Parameter("length", "width of a strip (one ZOI)", 0.1, 1e5)


@dataclass(frozen=True, slots=True)
class ZoiGauge(Gauge):
    """One value of the ZOI whose centre is nearest to a point.

    Attributes
    ----------
    at : (x, y), px
        At most one step of the grid away from the centre of a ZOI.
    value : str
        One of ``analysis.field.VALUES``.
    """

    at: geometry.Point = field(metadata=_AT.metadata)
    value: str = field(default="eyy", metadata=_VALUE.metadata)
    kind, label, default_name, gesture = "zoi", "Point", "point", "click"
    hint = "Click a place."

    def __post_init__(self) -> None:
        check_value(self.name, self.value)

    def select(self, grid: ZoiGrid) -> tuple[geometry.Mask, ...]:
        return (geometry.zois_near(grid, self.at, 0),)

    def share(self, grid: ZoiGrid) -> float:
        return 1.0

    @property
    def reading(self) -> GaugeReading:
        return GaugeReading("largest", self.value)

    def outline(self, zoi: float) -> tuple[geometry.Line, ...]:
        x, y = self.at
        return (geometry.closed(geometry.corners_of((x - zoi / 2, y - zoi / 2, zoi, zoi))),)

    def handles(self) -> tuple[geometry.Point, ...]:
        return (self.at,)

    @classmethod
    def from_handles(cls, handles: Sequence[geometry.Point]) -> dict[str, Any]:
        return {"at": geometry.near_px(handles[0])}


@dataclass(frozen=True, slots=True)
class AreaGauge(Gauge):
    """The strain of the ZOIs whose centres lie in a box or polygon, by their affine field; or of single ZOIs.

    Of the largest and the smallest, sigma is that of the ZOI which has it: right for a peak that stands
    out of the noise. In a flat field noise alone lifts the largest of n values above the mean, by 2 to 3
    sigma for 20 to 400 of them.

    Attributes
    ----------
    box : (x, y, width, height), px
    corners : tuple of (x, y), px
        At least three, in place of the box.
    value : str
        One of ``analysis.field.VALUES``.
    statistic : "affine", "mean", "largest" or "smallest"
        By ``AreaStrain``; else of the values of the ZOIs, by sign, not by magnitude.
    """

    box: geometry.Box | None = field(default=None, metadata=BOX.metadata)
    corners: tuple[geometry.Point, ...] | None = field(default=None, metadata=_CORNERS.metadata)
    value: str = field(default="eyy", metadata=_VALUE.metadata)
    statistic: Statistic = field(default="affine", metadata=_STATISTIC.metadata)
    kind, label, default_name, gesture = "area", "Area", "area", "box"
    hint = "Drag a rectangle: its mean strain."

    def __post_init__(self) -> None:
        check_value(self.name, self.value)
        if self.box is None and self.corners is None:
            raise ValueError("a gauge of kind 'area' needs 'box' or 'corners'")
        if self.corners is not None and len(self.corners) < 3:
            raise ValueError(f"gauge {self.name}: an area needs at least 3 corners, got {len(self.corners)}")
        if self.statistic not in _STATISTIC.choices:
            known = ", ".join(_STATISTIC.choices)
            raise ValueError(f"gauge {self.name}: unknown statistic {self.statistic!r}; known: {known}")

    def select(self, grid: ZoiGrid) -> tuple[geometry.Mask, ...]:
        return (geometry.zois_inside(grid, self._polygon()),)

    @property
    def reading(self) -> GaugeReading:
        return GaugeReading(self.statistic, self.value)

    def outline(self, zoi: float) -> tuple[geometry.Line, ...]:
        return (geometry.closed(self._polygon()),)

    def handles(self) -> tuple[geometry.Point, ...]:
        return self.corners or self._polygon()[::2]

    @classmethod
    def from_handles(cls, handles: Sequence[geometry.Point]) -> dict[str, Any]:
        if len(handles) == 2:
            return {"box": geometry.box_between(*handles)}
        return {"corners": tuple(geometry.near_px(place) for place in handles)}

    def _polygon(self) -> geometry.Line:
        return self.corners or geometry.corners_of(self.box or (0, 0, 0, 0))


@dataclass(frozen=True, slots=True)
class CircleGauge(Gauge):
    """Mean value of the ZOIs whose centres lie in a circle.

    Attributes
    ----------
    centre : (x, y), px
    radius_px : float, px
    value : str
        One of ``analysis.field.VALUES``.
    """

    centre: geometry.Point = field(metadata=_CENTRE.metadata)
    radius_px: float = field(metadata=RADIUS.metadata)
    value: str = field(default="eyy", metadata=_VALUE.metadata)
    kind, label, default_name, gesture = "circle", "Circle", "circle", "line"
    hint = "Drag from the centre of a circle to its rim: its mean strain."

    def __post_init__(self) -> None:
        check_value(self.name, self.value)
        if not self.radius_px > 0:
            raise ValueError(f"gauge {self.name}: the radius must be positive, got {self.radius_px}")

    def select(self, grid: ZoiGrid) -> tuple[geometry.Mask, ...]:
        return (geometry.zois_near(grid, self.centre, self.radius_px),)

    @property
    def reading(self) -> GaugeReading:
        return GaugeReading("affine", self.value)

    def outline(self, zoi: float) -> tuple[geometry.Line, ...]:
        return (geometry.circle(self.centre, self.radius_px),)

    def handles(self) -> tuple[geometry.Point, ...]:
        return self.centre, (self.centre[0] + self.radius_px, self.centre[1])

    @classmethod
    def from_handles(cls, handles: Sequence[geometry.Point]) -> dict[str, Any]:
        radius = max(round(math.dist(handles[0], handles[-1]), 1), 0.1)
        return {"centre": geometry.near_px(handles[0]), "radius_px": radius}


@dataclass(frozen=True, slots=True)
class StripGauge(Gauge):
    """Mean value of the ZOIs whose centres lie in a strip along a line, at any angle.

    Attributes
    ----------
    start, end : (x, y), px
    width_px : float or None, px
        Of the strip; None: the side of a ZOI.
    value : str
        One of ``analysis.field.VALUES``.
    """

    start: geometry.Point = field(metadata=START.metadata)
    end: geometry.Point = field(metadata=END.metadata)
    width_px: float | None = field(default=None, metadata=_WIDTH.metadata)
    value: str = field(default="eyy", metadata=_VALUE.metadata)
    kind, label, default_name, gesture = "strip", "Strip", "strip", "line"
    hint = "Drag from one end of a strip to the other: its mean strain."

    def __post_init__(self) -> None:
        check_value(self.name, self.value)
        if self.start == self.end:
            raise ValueError(f"gauge {self.name}: the two ends of a strip are one point, {self.start}")
        if self.width_px is not None and not self.width_px > 0:
            raise ValueError(f"gauge {self.name}: the width must be positive, got {self.width_px}")

    def select(self, grid: ZoiGrid) -> tuple[geometry.Mask, ...]:
        return (geometry.zois_inside(grid, self._corners(grid.size)),)

    @property
    def reading(self) -> GaugeReading:
        return GaugeReading("affine", self.value)

    def outline(self, zoi: float) -> tuple[geometry.Line, ...]:
        return (geometry.closed(self._corners(zoi)),)

    def handles(self) -> tuple[geometry.Point, ...]:
        return self.start, self.end

    @classmethod
    def from_handles(cls, handles: Sequence[geometry.Point]) -> dict[str, Any]:
        return {"start": geometry.near_px(handles[0]), "end": geometry.near_px(handles[-1])}

    def _corners(self, zoi: float) -> geometry.Line:
        (x0, y0), (x1, y1) = self.start, self.end
        half = (self.width_px or zoi) / 2 / math.dist(self.start, self.end)
        across, down = (y0 - y1) * half, (x1 - x0) * half
        return (
            (x0 + across, y0 + down),
            (x1 + across, y1 + down),
            (x1 - across, y1 - down),
            (x0 - across, y0 - down),
        )


GAUGE_KINDS: Mapping[str, type[Gauge]] = {
    kind.kind: kind
    for kind in (LineGauge, TransverseGauge, AreaGauge, ZoiGauge, CircleGauge, StripGauge, ExtensionGauge)
}
"""By their names in a configuration, in the order of the buttons on a page."""
