"""Virtual gauges on a strain field: a point, an area, an extensometer along a line or across a strip.

A gauge is a name and a geometry in px of the reference picture. ``measure_gauge`` gives its value with its
standard uncertainty, or NaN with the reason. Uncertainties contain the noise of the reference and the
correlation of overlapping ZOIs.

Extensions come from displacements, not from gradients: the mean displacement of the ZOIs around each end,
and the change of the distance between the two. A rigid rotation changes nothing.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from analysis.evaluate.extension import Ends, extension
from analysis.field import VALUES, Status, StrainField, ZoiGrid

Point = tuple[float, float]
Mask = NDArray[np.bool_]
Floats = NDArray[np.float64]
Statistic = Literal["mean", "largest", "smallest"]

LEAST_SHARE = 0.5
"""A gauge has a value as long as this share of the ZOIs of an area, or of each of its ends, has one."""


@dataclass(frozen=True, slots=True)
class ZoiGauge:
    """One value of the ZOI whose centre is nearest to a point.

    Attributes
    ----------
    name : str
    x, y : float, px
        At most one step of the grid away from the centre of a ZOI.
    value : str
        One of ``analysis.field.VALUES``.
    """

    name: str
    x: float
    y: float
    value: str = "eyy"

    def __post_init__(self) -> None:
        _check_value(self.name, self.value)


@dataclass(frozen=True, slots=True)
class AreaGauge:
    """Mean, largest or smallest value of the ZOIs whose centres lie in a polygon.

    Of the largest and the smallest, sigma is that of the ZOI which has it: right for a peak that stands
    out of the noise. In a flat field noise alone lifts the largest of n values above the mean, by 2 to 3
    sigma for 20 to 400 of them.

    Attributes
    ----------
    name : str
    corners : tuple of (x, y), px
        At least three; ``rectangle`` makes one of a box.
    value : str
        One of ``analysis.field.VALUES``.
    statistic : "mean", "largest" or "smallest"
        By sign, not by magnitude.
    """

    name: str
    corners: tuple[Point, ...]
    value: str = "eyy"
    statistic: Statistic = "mean"

    def __post_init__(self) -> None:
        _check_value(self.name, self.value)
        if len(self.corners) < 3:
            raise ValueError(f"gauge {self.name}: an area needs at least 3 corners, got {len(self.corners)}")
        if self.statistic not in ("mean", "largest", "smallest"):
            raise ValueError(
                f"gauge {self.name}: unknown statistic {self.statistic!r}; known: mean, largest, smallest"
            )

    @classmethod
    def rectangle(
        cls,
        name: str,
        box: tuple[float, float, float, float],
        value: str = "eyy",
        statistic: Statistic = "mean",
    ) -> AreaGauge:
        """The area of a box x, y, width, height (px)."""
        return cls(name, _corners(*box), value, statistic)


@dataclass(frozen=True, slots=True)
class LineGauge:
    """An extensometer: (L - L0)/L0 between two points.

    Each end is the ZOIs whose centres lie within ``radius`` of the point (without: half the side of a
    ZOI), at least the nearest one; L0 is the distance of their mean places, so that a uniform strain is met exactly.

    Attributes
    ----------
    name : str
    start, end : (x, y), px
    radius : float or None, px
    """

    name: str
    start: Point
    end: Point
    radius: float | None = None

    def __post_init__(self) -> None:
        if self.start == self.end:
            raise ValueError(f"gauge {self.name}: the two ends of a line are one point, {self.start}")
        if self.radius is not None and not self.radius > 0:
            raise ValueError(f"gauge {self.name}: the radius must be positive, got {self.radius}")


@dataclass(frozen=True, slots=True)
class TransverseGauge:
    """An extensometer across a strip: the mean extension of a box between its first and its last third.

    Thirds are the division that loses the least against a straight line through all points
    (M. S. Bartlett, Biometrics 5 (1949) 207-212, doi:10.2307/3001936).

    Attributes
    ----------
    name : str
    x, y, width, height : float, px
    along : "x" or "y"
        The direction whose extension is measured, across the load.
    """

    name: str
    x: float
    y: float
    width: float
    height: float
    along: Literal["x", "y"] = "x"

    def __post_init__(self) -> None:
        if not (self.width > 0 and self.height > 0):
            raise ValueError(f"gauge {self.name}: width and height must be positive")
        if self.along not in ("x", "y"):
            raise ValueError(f"gauge {self.name}: along is x or y, got {self.along!r}")


Gauge = ZoiGauge | AreaGauge | LineGauge | TransverseGauge


@dataclass(frozen=True, slots=True)
class GaugeValue:
    """What a gauge says of one field.

    Attributes
    ----------
    value, sigma : float
        Strain, or the unit of the value asked for; NaN where there is none.
    reason : str
        Why there is none; empty where there is one.
    """

    value: float
    sigma: float
    reason: str = ""


def measure_gauge(gauge: Gauge, field: StrainField) -> GaugeValue:
    """The value of a gauge on a field, with its standard uncertainty.

    Parameters
    ----------
    gauge : ZoiGauge, AreaGauge, LineGauge or TransverseGauge
    field : StrainField

    Returns
    -------
    GaugeValue
        NaN with a reason where fewer than ``LEAST_SHARE`` of its ZOIs, or of those of one end, have a value.
    """
    match gauge:
        case ZoiGauge():
            return _of_zoi(gauge, field)
        case AreaGauge():
            return _of_area(gauge, field)
        case _:
            return _of_ends(gauge_zois(gauge, field.grid), field)


def gauge_zois(gauge: Gauge, grid: ZoiGrid) -> tuple[Mask, ...]:
    """The active ZOIs that a gauge takes, (R, C) bool each: one mask, or one for each of its two ends."""
    return tuple(mask & grid.active for mask in _chosen(gauge, grid))


def _of_zoi(gauge: ZoiGauge, field: StrainField) -> GaugeValue:
    (chosen,) = gauge_zois(gauge, field.grid)
    if missing := _missing(chosen, field):
        return GaugeValue(math.nan, math.nan, missing)
    k = np.unravel_index(int(np.argmax(chosen)), chosen.shape)
    return GaugeValue(float(field.value(gauge.value)[k]), float(field.sigma(gauge.value)[k]))


def _of_area(gauge: AreaGauge, field: StrainField) -> GaugeValue:
    (chosen,) = gauge_zois(gauge, field.grid)
    if missing := _missing(chosen, field):
        return GaugeValue(math.nan, math.nan, missing)
    if gauge.statistic == "mean":
        return GaugeValue(*field.mean(gauge.value, chosen))
    sign = 1 if gauge.statistic == "largest" else -1
    values = np.where(chosen & field.ok, sign * field.value(gauge.value), -np.inf)
    k = np.unravel_index(int(np.argmax(values)), values.shape)
    return GaugeValue(float(sign * values[k]), float(field.sigma(gauge.value)[k]))


def _of_ends(chosen: tuple[Mask, ...], field: StrainField) -> GaugeValue:
    for number, end in enumerate(chosen, 1):
        if missing := _missing(end, field):
            return GaugeValue(math.nan, math.nan, f"end {number}: {missing}")
    found = extension(field, Ends(chosen[0] & field.ok, chosen[1] & field.ok))
    if not found.length > 0:
        return GaugeValue(math.nan, math.nan, "both ends are the same ZOIs; make the gauge longer")
    return GaugeValue(found.strain, found.sigma)


def _missing(chosen: Mask, field: StrainField) -> str:
    """Why there is no value; empty where enough of the ZOIs have one."""
    total = int(chosen.sum())
    if total == 0:
        grid = field.grid
        return (
            f"no ZOI is there; their centres reach from {grid.x[0]:g}, {grid.y[0]:g} to {grid.x[-1]:g},"
            f" {grid.y[-1]:g} px"
        )
    lost = Counter(Status(int(s)) for s in field.status[chosen] if s != Status.OK)
    if total - lost.total() >= max(LEAST_SHARE * total, 1):
        return ""
    words = ", ".join(f"{n} {status.name}" for status, n in lost.most_common())
    return f"{lost.total()} of {total} ZOIs have no value ({words})"


def _check_value(name: str, value: str) -> None:
    if value not in VALUES:
        raise ValueError(f"gauge {name}: unknown value {value!r}; known: {', '.join(VALUES)}")


def _chosen(gauge: Gauge, grid: ZoiGrid) -> tuple[Mask, ...]:
    x, y = np.meshgrid(grid.x, grid.y)
    match gauge:
        case ZoiGauge():
            return (_near(grid, x, y, (gauge.x, gauge.y), 0),)
        case AreaGauge():
            return (_inside(x, y, gauge.corners),)
        case LineGauge():
            reach = gauge.radius or grid.size / 2
            return tuple(_near(grid, x, y, end, reach) for end in (gauge.start, gauge.end))
        case TransverseGauge():
            return tuple(_inside(x, y, _corners(*box)) for box in _outer_thirds(gauge))


def _near(grid: ZoiGrid, x: Floats, y: Floats, place: Point, reach: float) -> Mask:
    """Centres within ``reach``, or else the nearest one if it is at most a step away along x and y."""
    distance = np.hypot(x - place[0], y - place[1])
    here = distance <= reach
    if not here.any():
        k = np.unravel_index(int(np.argmin(distance)), distance.shape)
        here[k] = max(abs(x[k] - place[0]), abs(y[k] - place[1])) <= grid.step
    return np.asarray(here)


def _corners(x: float, y: float, width: float, height: float) -> tuple[Point, ...]:
    return (x, y), (x + width, y), (x + width, y + height), (x, y + height)


def _outer_thirds(g: TransverseGauge) -> tuple[tuple[float, float, float, float], ...]:
    if g.along == "x":
        third = g.width / 3
        return (g.x, g.y, third, g.height), (g.x + 2 * third, g.y, third, g.height)
    third = g.height / 3
    return (g.x, g.y, g.width, third), (g.x, g.y + 2 * third, g.width, third)


def _inside(x: Floats, y: Floats, corners: tuple[Point, ...]) -> Mask:
    """Points inside a polygon: a ray to the left crosses its sides an odd number of times."""
    odd = np.zeros(x.shape, bool)
    for (x0, y0), (x1, y1) in zip(corners, (*corners[1:], corners[0]), strict=True):
        if y0 == y1:
            continue
        between = (np.minimum(y0, y1) <= y) & (y < np.maximum(y0, y1))
        odd ^= between & (x0 + (y - y0) * (x1 - x0) / (y1 - y0) <= x)
    return odd
