"""What is read from the ZOIs of a gauge: the value of an area, and (L - L0)/L0 between two ends."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from acquire.text import Message
from analysis.evaluate.area.strain import GRADIENTS, AreaStrain
from analysis.evaluate.gauges.gauge import GaugeValue
from analysis.evaluate.gauges.geometry import Floats, Mask
from analysis.field import PAIR_INDEX, VALUES, Status, StrainField, ZoiGrid, variance_of_sum

Statistic = Literal["affine", "mean", "largest", "smallest"]

COME_APART = Message("the region has come apart")
"""Why an area has no strain."""
MIN_SHARE = 0.5
"""A gauge has a value as long as this share of the ZOIs of an area, or of each of its ends, has one."""
_U, _V = 0, 3  # among the affine parameters


def read_area(chosen: Mask, field: StrainField, value: str, statistic: Statistic = "affine") -> GaugeValue:
    """A value of the affine field of some ZOIs, or their mean, largest or smallest value; of u and v the mean."""
    if missing := _missing(chosen, field):
        return GaugeValue(math.nan, math.nan, missing)
    affine = statistic == "affine" and value in GRADIENTS
    if affine and field.n_parts(chosen) > 1:
        return GaugeValue(math.nan, math.nan, COME_APART)
    found = AreaStrain.of(field, chosen) if affine else None
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
            return GaugeValue(math.nan, math.nan, Message("end {number}: {missing}", number, missing))
    found = extension(field, Ends(chosen[0] & field.ok, chosen[1] & field.ok))
    if not found.length > 0:
        return GaugeValue(math.nan, math.nan, Message("both ends are the same ZOIs; make the gauge longer"))
    return GaugeValue(found.strain, found.sigma)


def read_strips(chosen: Sequence[Mask], field: StrainField, along: str) -> GaugeValue:
    """``read_ends`` of two strips, each where the other has values too, so that their line is not tilted.

    Strips that hardly face each other, as those of a specimen that leans, are read whole.
    """
    if facing(chosen, along) is None:
        return read_ends(chosen, field)
    for number, end in enumerate(chosen, 1):
        if missing := _missing(end, field):
            return GaugeValue(math.nan, math.nan, Message("end {number}: {missing}", number, missing))
    side = 1 if along == "x" else 0
    first, second = ((end & field.ok).any(axis=side, keepdims=True) for end in chosen)
    both = first & second & field.ok
    if not both.any():
        return GaugeValue(
            math.nan, math.nan, Message("the ZOIs with a value at its two ends do not face each other")
        )
    return read_ends([end & both for end in chosen], field)


def facing(strips: Sequence[Mask], along: str) -> list[Mask] | None:
    """Each of two strips where the other has ZOIs too; None where they hardly face each other."""
    sides = [end.any(axis=1 if along == "x" else 0, keepdims=True) for end in strips]
    both = sides[0] & sides[1]
    return (
        None if both.sum() < MIN_SHARE * min(one.sum() for one in sides) else [end & both for end in strips]
    )


def _missing(chosen: Mask, field: StrainField) -> str:
    """Why there is no value; empty where enough of the ZOIs have one."""
    total = int(chosen.sum())
    if total == 0:
        grid = field.grid
        return Message(
            "no ZOI is there; their centres reach from {x:g}, {y:g} to {x2:g}, {y2:g} px; move the gauge there",
            grid.x[0],
            grid.y[0],
            grid.x[-1],
            grid.y[-1],
        )
    status = field.status[chosen]
    lost = Counter(Status(s) for s in status[status != Status.OK].tolist())
    if total - lost.total() >= MIN_SHARE * total:
        return ""
    words = ", ".join(Message("{n} {name}", n, status.name) for status, n in lost.most_common())
    return Message("{total} of {total2} ZOIs have no value ({words})", lost.total(), total, words)


def check_value(name: str, value: str) -> None:
    """Raises ValueError unless ``value`` is one of a strain field."""
    if value not in VALUES:
        raise ValueError(f"gauge {name}: unknown value {value!r}; known: {', '.join(VALUES)}")


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


def distance(grid: ZoiGrid, ends: Sequence[Mask]) -> float:
    """L0 between the mean places of two ends, px; NaN of a gauge with one area."""
    if len(ends) != 2 or not all(end.any() for end in ends):
        return math.nan
    x, y = np.meshgrid(grid.x, grid.y)
    (x0, y0), (x1, y1) = ((x[end].mean(), y[end].mean()) for end in ends)
    return float(np.hypot(x1 - x0, y1 - y0))


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
