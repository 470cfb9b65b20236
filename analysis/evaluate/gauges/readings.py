"""How gauges are read: what each takes of its ZOIs, and all of them from a field in one pass.

What a gauge takes follows from the reference, and from which of its ZOIs have a value: it is prepared once, and anew
where these are others. A field is then read in one pass over the ZOIs of all gauges.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from acquire.text import Message, joined
from analysis.evaluate.affine import Places
from analysis.evaluate.area_strain import GRADIENTS
from analysis.evaluate.gauges.geometry import Mask
from analysis.evaluate.gauges.taken import (
    NOTHING,
    AffineTaken,
    EndsTaken,
    ExtremeTaken,
    MeanTaken,
    Now,
    Row,
    Taken,
    overlaps,
)
from analysis.field import VALUES, Status, StrainField, ZoiGrid, area_share

Statistic = Literal["affine", "mean", "largest", "smallest"]

MIN_SHARE = 0.5
"""A gauge has a value as long as this share of the ZOIs of an area, or of each of its ends, has one."""


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
        Of its area that the value stands for: of that which is measured, of the ZOIs that have a value at either end
        (``analysis.field.area_share``).
    """

    value: float
    sigma: float
    reason: str = ""
    share: float = 1.0


@dataclass(frozen=True, slots=True)
class GaugeReading:
    """How a gauge is read.

    Attributes
    ----------
    statistic : "affine", "mean", "largest", "smallest" or "ends"
        Of an area: by its affine field (u and v: their mean), or of the values of its ZOIs, by sign. Of two ends: the
        change of the distance between their mean places, over that distance.
    value : str
        Of an area, one of ``analysis.field.VALUES``.
    along : "x", "y" or ""
        Ends that are strips are read where the other one has values too, so that their line is not tilted; those that
        hardly face each other, as of a specimen that leans, are read whole.
    """

    statistic: Statistic | Literal["ends"]
    value: str = "u"
    along: str = ""

    def taken(self, ends: Sequence[Mask], field: StrainField, before: Taken) -> Taken:
        """What it takes of its ZOIs, (R, C) bool of one area or of each of two ends, in the place of ``before``."""
        if why := _missing(ends, field):
            return Taken(reason=why)
        if self.along and facing(ends, self.along) is not None:
            side = 1 if self.along == "x" else 0
            first, second = ((end & field.ok).any(axis=side, keepdims=True) for end in ends)
            ends = [end & first & second for end in ends]
            if not (ends[0] & field.ok).any():
                return Taken(reason=Message("the ZOIs with a value at its two ends do not face each other"))
        valid = [np.flatnonzero(end & field.ok) for end in ends]
        if self.statistic == "ends":
            return EndsTaken.of(valid[0], valid[1], field)
        if self.statistic == "affine" and self.value in GRADIENTS:
            return AffineTaken.of(self.value, ends[0], field, before)
        if self.statistic in ("affine", "mean"):
            return MeanTaken.of(self.value, ends[0], field)
        sign = 1 if self.statistic == "largest" else -1
        return ExtremeTaken(value=self.value, at=valid[0], sign=sign)


class Readable(Protocol):
    """A name, what is read, and of which ZOIs, (R, C) bool: of one area, or of each of two ends."""

    @property
    def name(self) -> str: ...

    @property
    def reading(self) -> GaugeReading: ...

    def zois(self, grid: ZoiGrid) -> tuple[Mask, ...]: ...

    def share(self, grid: ZoiGrid) -> float: ...


class GaugeSet:
    """Reads gauges from field after field, all in one pass.

    Parameters
    ----------
    gauges : sequence of Readable
        Of different names.
    """

    def __init__(self, gauges: Sequence[Readable]) -> None:
        self._gauges, self._of = gauges, tuple[object, ...]()

    def read(self, field: StrainField) -> dict[str, GaugeValue]:
        """The value of each by its name.

        NaN with a reason where fewer than half of its ZOIs, or of those of one end, have a value.
        """
        if not self._gauges:
            return {}
        from analysis.compiled.sparse_sums import overlapping, row_sums

        grid, now, variances = field.grid, Now(field), np.empty(len(self._gauges))
        of = grid.roi, grid.size, grid.step, grid.active.tobytes(), field.window, field.sums, field.measure
        if of != self._of:
            self._begin(field)
            self._of = of
        self._prepare(field)
        sums = np.empty((len(self._sums[0]) - 1, len(now.maps)))
        row_sums(*self._sums, now.maps, sums)
        own = [sums[rows] for rows in self._own]
        factors = np.array([one.factors(found) for one, found in zip(self._taken, own, strict=True)])
        rho = overlaps(Places.of(grid, field.window)), grid.shape[1]
        overlapping(*self._noise, self._pairs, factors, self._kinds, *rho, now.covariance, variances)
        each = zip(self._gauges, self._taken, own, variances.tolist(), self._shares, strict=True)
        return {
            gauge.name: GaugeValue(*taken.read(now, found, variance), share)
            for gauge, taken, found, variance, share in each
        }

    def _begin(self, field: StrainField) -> None:
        """Find the ZOIs of each on the grid of ``field``."""
        self._zois = [gauge.zois(field.grid) for gauge in self._gauges]
        self._measured = [gauge.share(field.grid) for gauge in self._gauges]
        at = [np.flatnonzero(np.logical_or.reduce(ends)) for ends in self._zois]
        self._at, self._gauge = np.concatenate(at), np.repeat(np.arange(len(at)), [len(one) for one in at])
        self._status: NDArray[np.uint8] | None = None
        self._taken, self._shares = [Taken()] * len(at), [1.0] * len(at)

    def _prepare(self, field: StrainField) -> None:
        """Prepare anew the gauges of which another ZOI has a value than in the last field."""
        status = field.status.ravel()[self._at]
        changed = np.arange(len(self._gauges))
        if self._status is not None:
            changed = np.unique(self._gauge[status != self._status])
        if not changed.size:
            return
        for g in changed.tolist():
            ends = self._zois[g]
            self._taken[g] = self._gauges[g].reading.taken(ends, field, self._taken[g])
            self._shares[g] = self._measured[g] * min(area_share(field, end) for end in ends)
        self._status, taken = status, self._taken
        self._sums = _rows([row for one in taken for row in one.sums])
        self._noise = _rows([one.noise for one in taken])
        ends_of = np.cumsum([0, *(len(one.sums) for one in taken)]).tolist()
        self._own = [slice(first, end) for first, end in pairwise(ends_of)]
        self._pairs, self._kinds = (
            np.array([getattr(one, name) for one in taken], np.intp) for name in ("pairs", "kind")
        )


def _rows(rows: Sequence[Row]) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """Rows one behind the other: where each begins, places and weights."""
    first = np.cumsum([0, *(len(row.at) for row in rows)], dtype=np.intp)
    at, weights = (np.concatenate(column) for column in zip(NOTHING, *rows, strict=True))
    return first, at, weights


def _missing(ends: Sequence[Mask], field: StrainField) -> str:
    """Why there is no value; empty where enough of the ZOIs, or of those of each end, have one."""
    for number, end in enumerate(ends, 1):
        if why := _missing_in(end, field):
            return why if len(ends) == 1 else Message("end {number}: {missing}", number, why)
    return ""


def _missing_in(chosen: Mask, field: StrainField) -> str:
    total = int(np.count_nonzero(chosen))
    if total == 0:
        grid = field.grid
        return Message(
            "no ZOI is there; their centres reach from {x:g}, {y:g} to {x2:g}, {y2:g} px; move the gauge there",
            grid.x[0],
            grid.y[0],
            grid.x[-1],
            grid.y[-1],
        )
    lost = Counter(Status(s) for s in field.status[chosen & ~field.ok].tolist())
    if total - lost.total() >= MIN_SHARE * total:
        return ""
    words = joined(", ", (Message("{n} {name}", n, Message(status.name)) for status, n in lost.most_common()))
    return Message("{total} of {total2} ZOIs have no value ({words})", lost.total(), total, words)


def facing(strips: Sequence[Mask], along: str) -> list[Mask] | None:
    """Each of two strips where the other has ZOIs too; None where they hardly face each other."""
    sides = [end.any(axis=1 if along == "x" else 0, keepdims=True) for end in strips]
    both = sides[0] & sides[1]
    return (
        None if both.sum() < MIN_SHARE * min(one.sum() for one in sides) else [end & both for end in strips]
    )


def distance(grid: ZoiGrid, ends: Sequence[Mask]) -> float:
    """L0 between the mean places of two ends, px; NaN of a gauge with one area."""
    if len(ends) != 2 or not all(end.any() for end in ends):
        return math.nan
    x, y = np.meshgrid(grid.x, grid.y)
    (x0, y0), (x1, y1) = ((x[end].mean(), y[end].mean()) for end in ends)
    return float(np.hypot(x1 - x0, y1 - y0))


def check_value(name: str, value: str) -> None:
    """Raises ValueError unless ``value`` is one of a strain field."""
    if value not in VALUES:
        raise ValueError(f"gauge {name}: unknown value {value!r}; known: {', '.join(VALUES)}")
