"""What a virtual gauge is: a name and a geometry in px of the reference picture, read from a strain field.

A kind of gauge is one class in ``gauge_kinds``: its parameters with their bounds, the ZOIs it takes, its value, its
outline, and how it is made from the places that a person drags on a picture. Uncertainties contain the noise of the
reference and the correlation of overlapping ZOIs.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, replace
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from analysis.evaluate.area.strain import GRADIENTS, AreaStrain
from analysis.field import PAIR_INDEX, VALUES, Status, StrainField, ZoiGrid, area_share, variance_of_sum

Point = tuple[float, float]
Box = tuple[float, float, float, float]
Line = tuple[Point, ...]
Mask = NDArray[np.bool_]
Floats = NDArray[np.float64]
Statistic = Literal["affine", "mean", "largest", "smallest"]

MIN_SHARE = 0.5
"""A gauge has a value as long as this share of the ZOIs of an area, or of each of its ends, has one."""
_ROUND = 24  # corners of a circle that is drawn
_U, _V = 0, 3  # among the affine parameters


@dataclass(frozen=True, slots=True)
class Parameter:
    """The kind, bounds and choices of a parameter of a gauge, in the metadata of its field.

    Attributes
    ----------
    kind : "point", "box", "corners", "length" or "choice"
        (x, y); (x, y, width, height); at least three (x, y); a number; a word. Places and lengths in px.
    words : str
        Its meaning.
    low, high : float, px
        Bounds of a length.
    choices : tuple of str
    by_axis : mapping of "x" and "y" to a word
        What it is by the axis of the load where it is not given.
    """

    kind: Literal["point", "box", "corners", "length", "choice"]
    words: str
    low: float = 0.0
    high: float = math.inf
    choices: tuple[str, ...] = ()
    by_axis: Mapping[str, str] | None = None

    @property
    def metadata(self) -> dict[str, Any]:
        """Of its field."""
        return {"parameter": self}


@dataclass(frozen=True, slots=True)
class GaugeValue:
    """What a gauge reads from one field.

    Attributes
    ----------
    value, sigma : float
        Strain, or the unit of the gauge's value; NaN where there is none.
    reason : str
        Why there is none; empty where there is one.
    share : float
        Of its area that the value stands for, at either end (``analysis.field.area_share``).
    """

    value: float
    sigma: float
    reason: str = ""
    share: float = 1.0


@dataclass(frozen=True, slots=True)
class Gauge(ABC):
    """A virtual gauge; raises ValueError where its parameters are impossible.

    Attributes
    ----------
    name : str
    kind : str
        As a configuration has it.
    label, hint : str
        Of its button on a page, and what to do with the mouse.
    gesture : "click", "line" or "box"
        How it is drawn: at one place, from one place to another, or between two opposite corners.
    default_name : str
        Of a new one.
    """

    name: str
    kind: ClassVar[str]
    label: ClassVar[str]
    hint: ClassVar[str]
    gesture: ClassVar[Literal["click", "line", "box"]]
    default_name: ClassVar[str]

    @abstractmethod
    def select(self, grid: ZoiGrid) -> tuple[Mask, ...]:
        """The ZOIs that lie where the gauge is, (R, C) bool: one mask, or one for each of its two ends."""

    @abstractmethod
    def measure(self, field: StrainField) -> GaugeValue:
        """Its value with its standard uncertainty.

        NaN with a reason where fewer than ``MIN_SHARE`` of its ZOIs, or of those of one end, have a value.
        """

    @abstractmethod
    def outline(self, zoi: float) -> tuple[Line, ...]:
        """Lines to be drawn, px, with ZOIs of a side of ``zoi`` px; a closed one ends where it begins."""

    @abstractmethod
    def handles(self) -> tuple[Point, ...]:
        """The places that a person can drag, px."""

    @classmethod
    @abstractmethod
    def from_handles(cls, handles: Sequence[Point]) -> dict[str, Any]:
        """The parameters of a gauge with these handles, or drawn from the first to the second of them."""

    @classmethod
    def parameters(cls) -> dict[str, Parameter]:
        """By their names, as a configuration has them."""
        return {f.name: f.metadata["parameter"] for f in fields(cls) if "parameter" in f.metadata}

    @classmethod
    def of(cls, name: str, table: Mapping[str, Any], axis: str) -> Gauge:
        """Made of the keys of ``table`` that are its own, with what follows from the ``axis`` of the load.

        Raises
        ------
        ValueError
            One is missing or impossible.
        """
        known = cls.parameters()
        given = {key: value for key, value in table.items() if key in known and value is not None}
        by_axis = {key: one.by_axis[axis] for key, one in known.items() if one.by_axis is not None}
        needed = (f.name for f in fields(cls) if f.name in known and f.default is MISSING)
        for key in needed:
            if key not in given:
                raise ValueError(f"a gauge of kind {cls.kind!r} needs {key!r}")
        return cls(name, **(by_axis | given))

    def read(self, field: StrainField) -> GaugeValue:
        """Its value with the share of its area that the value stands for."""
        share = min(area_share(field, mask) for mask in self.zois(field.grid))
        return replace(self.measure(field), share=share)

    def zois(self, grid: ZoiGrid) -> tuple[Mask, ...]:
        """The active ZOIs that it takes, (R, C) bool: one mask, or one for each of its two ends."""
        return tuple(mask & grid.active for mask in self.select(grid))


# -- what kinds are made of ------------------------------------------------------------------------


def read_area(chosen: Mask, field: StrainField, value: str, statistic: Statistic = "affine") -> GaugeValue:
    """A value of the affine field of some ZOIs, or their mean, largest or smallest value; of u and v the mean."""
    if missing := _missing(chosen, field):
        return GaugeValue(math.nan, math.nan, missing)
    found = AreaStrain.of(field, chosen) if statistic == "affine" and value in GRADIENTS else None
    if found is not None:
        return GaugeValue(found.value(value), found.sigma(value))
    if statistic in ("affine", "mean"):
        return GaugeValue(*field.mean(value, chosen))
    sign = 1 if statistic == "largest" else -1
    values = np.where(chosen & field.ok, sign * field.value(value), -np.inf)
    k = np.unravel_index(int(np.argmax(values)), values.shape)
    return GaugeValue(float(sign * values[k]), float(field.sigma(value)[k]))


def read_ends(chosen: Sequence[Mask], field: StrainField) -> GaugeValue:
    """The change of the distance between the mean places of two groups of ZOIs, over that distance.

    From displacements, not from gradients: a rigid rotation changes nothing.
    """
    for number, end in enumerate(chosen, 1):
        if missing := _missing(end, field):
            return GaugeValue(math.nan, math.nan, f"end {number}: {missing}")
    found = extension(field, Ends(chosen[0] & field.ok, chosen[1] & field.ok))
    if not found.length > 0:
        return GaugeValue(math.nan, math.nan, "both ends are the same ZOIs; make the gauge longer")
    return GaugeValue(found.strain, found.sigma)


def read_strips(chosen: Sequence[Mask], field: StrainField, along: str) -> GaugeValue:
    """``read_ends`` of two strips, each where the other has values too, so that their line is not tilted.

    Strips that hardly face each other, as those of a specimen that leans, are read whole.
    """
    side = 1 if along == "x" else 0
    sides = [end.any(axis=side) for end in chosen]
    if np.sum(sides[0] & sides[1]) < MIN_SHARE * min(one.sum() for one in sides):
        return read_ends(chosen, field)
    for number, end in enumerate(chosen, 1):
        if missing := _missing(end, field):
            return GaugeValue(math.nan, math.nan, f"end {number}: {missing}")
    first, second = ((end & field.ok).any(axis=side, keepdims=True) for end in chosen)
    both = first & second & field.ok
    if not both.any():
        return GaugeValue(math.nan, math.nan, "the ZOIs with a value at its two ends do not face each other")
    return read_ends([end & both for end in chosen], field)


def _missing(chosen: Mask, field: StrainField) -> str:
    """Why there is no value; empty where enough of the ZOIs have one."""
    total = int(chosen.sum())
    if total == 0:
        grid = field.grid
        return (
            f"no ZOI is there; their centres reach from {grid.x[0]:g}, {grid.y[0]:g} to {grid.x[-1]:g},"
            f" {grid.y[-1]:g} px; move the gauge there"
        )
    status = field.status[chosen]
    lost = Counter(Status(s) for s in status[status != Status.OK].tolist())
    if total - lost.total() >= max(MIN_SHARE * total, 1):
        return ""
    words = ", ".join(f"{n} {status.name}" for status, n in lost.most_common())
    return f"{lost.total()} of {total} ZOIs have no value ({words})"


def check_value(name: str, value: str) -> None:
    """Raises ValueError unless ``value`` is one of a strain field."""
    if value not in VALUES:
        raise ValueError(f"gauge {name}: unknown value {value!r}; known: {', '.join(VALUES)}")


def zois_near(grid: ZoiGrid, place: Point, reach: float) -> Mask:
    """Centres within ``reach``, or else the nearest one if it is at most a step away along x and y."""
    x, y = np.meshgrid(grid.x, grid.y)
    distance = np.hypot(x - place[0], y - place[1])
    here = distance <= reach
    if not here.any():
        k = np.unravel_index(int(np.argmin(distance)), distance.shape)
        here[k] = max(abs(x[k] - place[0]), abs(y[k] - place[1])) <= grid.step
    return np.asarray(here)


def zois_inside(grid: ZoiGrid, corners: Sequence[Point]) -> Mask:
    """Centres inside a polygon."""
    x, y = np.meshgrid(grid.x, grid.y)
    return inside_polygon(x, y, corners)


def inside_polygon(x: Floats, y: Floats, corners: Sequence[Point] | Floats) -> Mask:
    """Points inside a polygon: a ray to the left crosses its sides an odd number of times."""
    odd = np.zeros(x.shape, bool)
    for (x0, y0), (x1, y1) in zip(corners, (*corners[1:], corners[0]), strict=True):
        if y0 == y1:
            continue
        between = (np.minimum(y0, y1) <= y) & (y < np.maximum(y0, y1))
        odd ^= between & (x0 + (y - y0) * (x1 - x0) / (y1 - y0) <= x)
    return odd


def corners_of(box: Box) -> tuple[Point, ...]:
    """Of x, y, width, height."""
    x, y, width, height = box
    return (x, y), (x + width, y), (x + width, y + height), (x, y + height)


def ends_of(box: Box, along: str, share: float) -> tuple[Box, Box]:
    """The first and the last ``share`` of a box along x or y."""
    x, y, width, height = box
    if along == "x":
        end = share * width
        return (x, y, end, height), (x + width - end, y, end, height)
    end = share * height
    return (x, y, width, end), (x, y + height - end, width, end)


def closed(corners: Line) -> Line:
    """A line around ``corners``."""
    return (*corners, corners[0])


def circle(place: Point, radius: float) -> Line:
    """A closed line around ``place``."""
    angles = np.linspace(0, 2 * math.pi, _ROUND + 1)
    return tuple((place[0] + radius * math.cos(a), place[1] + radius * math.sin(a)) for a in angles)


def near_px(place: Point) -> Point:
    """To a tenth of a pixel: as exact as a person drags."""
    return round(float(place[0]), 1), round(float(place[1]), 1)


def box_between(one: Point, other: Point) -> Box:
    """The box between two opposite corners, whole px within the picture."""
    (x0, x1), (y0, y1) = (sorted((round(one[k]), round(other[k]))) for k in (0, 1))
    x0, y0 = max(x0, 0), max(y0, 0)
    return float(x0), float(y0), float(max(x1 - x0, 1)), float(max(y1 - y0, 1))


@dataclass(frozen=True, slots=True, eq=False)
class Ends:
    """The ZOIs of the two ends, (R, C) bool each; all of them have a value, and none is empty."""

    first: NDArray[np.bool_]
    second: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Extension:
    """(L - L0)/L0 with its standard uncertainty, and L0 in px (0 where the ends lie upon each other)."""

    strain: float
    sigma: float
    length: float


def extension(field: StrainField, ends: Ends) -> Extension:
    """The strain between the mean places of two ends.

    Parameters
    ----------
    field : StrainField
    ends : Ends

    Returns
    -------
    Extension
        sigma is that of the displacement difference along the line, reference noise included.
    """
    share = ends.second / ends.second.sum() - ends.first / ends.first.sum()
    used = share != 0
    weights = share[used]
    x, y = np.meshgrid(field.grid.x, field.grid.y)
    before = np.array([_sum(weights * x[used]), _sum(weights * y[used])])
    length = float(np.hypot(*before))
    if length == 0:
        return Extension(math.nan, math.nan, 0.0)
    # The difference of the lengths loses no digits where the extension is small.
    moved = np.array([_sum(weights * field.u[used]), _sum(weights * field.v[used])])
    now = float(np.hypot(*(before + moved)))
    strain = float(moved @ (2 * before + moved)) / (now + length) / length
    spread = np.where(used, share * _sigma_along(field, (before + moved) / now), 0.0)
    variance = variance_of_sum(spread, "u", field.grid, field.window)
    if field.common is not None:
        along = np.zeros((6, *field.grid.shape))
        along[_U], along[_V] = np.multiply.outer((before + moved) / now, share)
        variance += field.common.variance_of_sum(along)
    return Extension(strain, math.sqrt(max(variance, 0.0)) / length, length)


def _sum(values: Floats) -> float:
    """The sum, in the order of the values: the same bits wherever they lie in memory."""
    return float(np.cumsum(values)[-1]) if values.size else 0.0


def _sigma_along(field: StrainField, direction: Floats) -> Floats:
    """Standard uncertainty of the displacement along a unit vector, (R, C), px."""
    nx, ny = direction
    uu, uv, vv = (
        field.covariance[PAIR_INDEX[pair]].astype(np.float64) for pair in ((_U, _U), (_U, _V), (_V, _V))
    )
    return np.asarray(np.sqrt(np.maximum(nx * nx * uu + 2 * nx * ny * uv + ny * ny * vv, 0)))
