"""Extensometers: along a line, across a box, and (L - L0)/L0 between strips at the two ends of a region."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from analysis.evaluate.gauges import geometry
from analysis.evaluate.gauges.gauge import OFF_REGION, Gauge, Parameter
from analysis.evaluate.gauges.readings import GaugeReading, distance
from analysis.field import ZoiGrid

BOX = Parameter("box", "x, y, width, height of an area, extension or transverse gauge")
START, END = Parameter("point", "x, y of one end of a line"), Parameter("point", "x, y of the other")
RADIUS = Parameter("length", "ZOIs this far around an end of a line (half a ZOI)", 0.1, 1e5)
_ALONG = Parameter(
    "choice",
    "direction of an extension (along the load) or transverse gauge (across it)",
    choices=("x", "y"),
    by_axis={"x": "y", "y": "x"},
)
_ALONG_LOAD = replace(_ALONG, by_axis={"x": "x", "y": "y"})
_STRIP = 1 / 6


@dataclass(frozen=True, slots=True)
class LineGauge(Gauge):
    """An extensometer: (L - L0)/L0 between two points.

    Each end is the ZOIs whose centres lie within ``radius_px`` of the point (without: half the side of a
    ZOI), at least the nearest one; L0 is the distance of their mean places, so that a uniform strain is met exactly.

    Attributes
    ----------
    start, end : (x, y), px
    radius_px : float or None, px
    """

    start: geometry.Point = field(metadata=START.metadata)
    end: geometry.Point = field(metadata=END.metadata)
    radius_px: float | None = field(default=None, metadata=RADIUS.metadata)
    kind, label, default_name, gesture = "line", "Extensometer", "axial", "line"
    hint = "Drag from one end of the extensometer to the other."

    def __post_init__(self) -> None:
        if self.start == self.end:
            raise ValueError(f"gauge {self.name}: the two ends of a line are one point, {self.start}")
        if self.radius_px is not None and not self.radius_px > 0:
            raise ValueError(f"gauge {self.name}: the radius must be positive, got {self.radius_px}")

    def select(self, grid: ZoiGrid) -> tuple[geometry.Mask, ...]:
        reach = self.radius_px or grid.size / 2
        return tuple(geometry.zois_near(grid, end, reach) for end in (self.start, self.end))

    @property
    def reading(self) -> GaugeReading:
        return GaugeReading("ends")

    def outline(self, zoi: float) -> tuple[geometry.Line, ...]:
        reach = self.radius_px or zoi / 2
        return (self.start, self.end), geometry.circle(self.start, reach), geometry.circle(self.end, reach)

    def share(self, grid: ZoiGrid) -> float:
        """Of its length, that between the ZOIs at its ends; 1 where that is nearly all."""
        found = distance(grid, self.zois(grid)) / math.dist(self.start, self.end)
        return found if found <= 1 - OFF_REGION else 1.0

    def handles(self) -> tuple[geometry.Point, ...]:
        return self.start, self.end

    @classmethod
    def from_handles(cls, handles: Sequence[geometry.Point]) -> dict[str, Any]:
        return {"start": geometry.near_px(handles[0]), "end": geometry.near_px(handles[-1])}


@dataclass(frozen=True, slots=True)
class TransverseGauge(Gauge):
    """An extensometer across a strip: the mean extension of a box between its first and its last third.

    Thirds are the division that loses the least against a straight line through all points
    (M. S. Bartlett, Biometrics 5 (1949) 207-212, doi:10.2307/3001936).

    Attributes
    ----------
    box : (x, y, width, height), px
    along : "x" or "y"
        The direction whose extension is measured, across the load.
    """

    box: geometry.Box = field(metadata=BOX.metadata)
    along: Literal["x", "y"] = field(default="x", metadata=_ALONG.metadata)
    kind, label, default_name, gesture = "transverse", "Transverse", "transverse", "box"
    hint = "Drag a rectangle: strain across the load."

    def __post_init__(self) -> None:
        if not (self.box[2] > 0 and self.box[3] > 0):
            raise ValueError(f"gauge {self.name}: width and height must be positive")
        if self.along not in ("x", "y"):
            raise ValueError(f"gauge {self.name}: along is x or y, got {self.along!r}")

    def select(self, grid: ZoiGrid) -> tuple[geometry.Mask, ...]:
        return tuple(
            geometry.zois_inside(grid, geometry.corners_of(box))
            for box in geometry.ends_of(self.box, self.along, 1 / 3)
        )

    @property
    def reading(self) -> GaugeReading:
        return GaugeReading("ends")

    def outline(self, zoi: float) -> tuple[geometry.Line, ...]:
        return (geometry.closed(geometry.corners_of(self.box)),)

    def handles(self) -> tuple[geometry.Point, ...]:
        return geometry.corners_of(self.box)[::2]

    @classmethod
    def from_handles(cls, handles: Sequence[geometry.Point]) -> dict[str, Any]:
        return {"box": geometry.box_between(handles[0], handles[-1])}


@dataclass(frozen=True, slots=True)
class ExtensionGauge(TransverseGauge):
    """An extensometer along a strip: (L - L0)/L0 between the first and the last sixth of a box.

    Each end is as wide as the box, as the definition of extension has it, and right in any field: a neck or a band
    between the ends counts as it does for a clip-on extensometer. In a uniform field its noise is a quarter above
    that of all ZOIs.
    """

    along: Literal["x", "y"] = field(default="y", metadata=_ALONG_LOAD.metadata)
    kind, label, default_name, gesture = "extension", "Extension", "extension", "box"
    hint = "Drag a rectangle: extension between its two ends."

    def select(self, grid: ZoiGrid) -> tuple[geometry.Mask, ...]:
        side = self.box[2 if self.along == "x" else 3]
        ends = geometry.ends_of(self.box, self.along, max(_STRIP, grid.step / side))
        return tuple(geometry.zois_inside(grid, geometry.corners_of(box)) for box in ends)

    @property
    def length(self) -> float:
        """From the middle of one strip to that of the other, px."""
        k = 0 if self.along == "x" else 1
        first, last = (box[k] + box[k + 2] / 2 for box in geometry.ends_of(self.box, self.along, _STRIP))
        return last - first

    @property
    def reading(self) -> GaugeReading:
        return GaugeReading("ends", along=self.along)


@dataclass(frozen=True, slots=True)
class RegionStrips:
    """(L - L0)/L0 between strips at the two ends of all active ZOIs, as of an ``ExtensionGauge``."""

    along: Literal["x", "y"]

    @property
    def name(self) -> str:
        return f"extension_{self.along}"

    @property
    def reading(self) -> GaugeReading:
        return GaugeReading("ends", along=self.along)

    def zois(self, grid: ZoiGrid) -> tuple[geometry.Mask, ...]:
        """The two strips, (R, C) bool each."""
        rows, columns = (np.flatnonzero(grid.active.any(axis=axis)) for axis in (1, 0))
        if not rows.size:
            return grid.active, grid.active
        x, y = grid.x[columns[0]] - grid.step / 2, grid.y[rows[0]] - grid.step / 2
        width, height = (float(np.ptp(found) + 1) * grid.step for found in (columns, rows))
        return ExtensionGauge("", (float(x), float(y), width, height), self.along).zois(grid)

    def share(self, grid: ZoiGrid) -> float:
        """All of it."""
        return 1.0


REGION = RegionStrips("x"), RegionStrips("y")
"""The extensions of a region, ``extension_x`` and ``extension_y``."""
