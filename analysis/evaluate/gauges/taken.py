"""What gauges take of the ZOIs that have a value, prepared; and their values from sums over the maps of a field."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquire.text import Message
from analysis.evaluate.affine import AffineFit, Places, affine_fit
from analysis.evaluate.area_strain import GRADIENT, STRAINS, affine_values, strain_of
from analysis.evaluate.gauges.geometry import Floats, Mask, Point
from analysis.field import PAIR_INDEX, StrainField, combination, overlap, products

Flat = NDArray[np.intp]
Read = tuple[float, float, str]

COME_APART = Message("the region has come apart")
"""Why an area has no strain."""
_U, _V = 0, 3  # among the affine values
_VARIANCES = 6, 7  # of u and v, behind the affine values among the maps
_ALONG_LINE = PAIR_INDEX[_U, _U], PAIR_INDEX[_U, _V], PAIR_INDEX[_V, _V]


class Now:
    """What all gauges use of a field of N ZOIs.

    Attributes
    ----------
    field : StrainField
    maps : (1 + K, 8 N) float64
        That are summed: first the affine values and the variances of u and v, then the shapes of the error that all
        ZOIs have in common.
    covariance : (21, N) float32
    """

    def __init__(self, field: StrainField) -> None:
        self.field, self.covariance = field, field.covariance.reshape(len(field.covariance), -1)
        shapes = np.empty((0, 1)) if field.common is None else field.common.shapes
        count, zois = len(shapes), field.status.size
        self.maps = np.zeros((1 + count, 8 * zois))
        self.maps[0, : 6 * zois] = affine_values(field).ravel()
        self.maps[0, 6 * zois :] = self.covariance[[_ALONG_LINE[0], _ALONG_LINE[-1]]].ravel()
        if count:
            self.maps[1:, : 6 * zois] = shapes.reshape(count, -1)
        self._named: dict[str, Floats] = {}

    def named(self, name: str) -> Floats:
        """A value of all ZOIs or its sigma, by the names of the attributes of a field, (N,)."""
        if name not in self._named:
            self._named[name] = np.asarray(getattr(self.field, name)).ravel()
        return self._named[name]

    def common(self, made: Floats) -> float:
        """Variance of a sum by the error that all ZOIs have in common, from the sums of its shapes (K,)."""
        return 0.0 if self.field.common is None else float(made @ self.field.common.covariance @ made)


class Row(NamedTuple):
    """A sum: flat places, in one map or one after the other, and weights."""

    at: Flat
    weights: Floats

    @classmethod
    def of(cls, maps: Sequence[int], at: Flat, weights: Floats, count: int) -> Row:
        """What is taken of the ZOIs ``at`` (n,) of ``count`` in some maps, by ``weights`` (maps, n)."""
        return cls(np.add.outer(count * np.array(maps), at).ravel(), weights.ravel())


NOTHING = Row(np.empty(0, np.intp), np.empty(0))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Taken:
    """What a gauge takes of the ZOIs that have a value; of none, with a reason.

    Attributes
    ----------
    reason : str
    sums : sequence of Row
        Over the maps of ``Now``.
    noise : Row
        ZOIs whose shares make a sum, the variance of which follows from how they overlap.
    pairs : three of the 21 covariances
        That make the variance of each of these ZOIs.
    kind : int
        Of their correlation (``overlaps``).
    """

    reason: str = ""
    sums: Sequence[Row] = ()
    noise: Row = NOTHING
    pairs: Sequence[int] = (0, 0, 0)
    kind: int = 0

    def factors(self, sums: Floats) -> Sequence[float]:
        """Factors of the covariances of ``pairs``, in a field with these ``sums`` (S, 1 + K)."""
        return 0.0, 0.0, 0.0

    def read(self, now: Now, sums: Floats, variance: float) -> Read:
        """Value, sigma and why there is none, from its ``sums`` (S, 1 + K) and the variance of its ``noise``."""
        return math.nan, math.nan, self.reason


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AffineTaken(Taken):
    """A strain of the affine field of an area, whose variance is a sum of those of u and v."""

    value: str
    area: Mask
    fit: AffineFit

    @classmethod
    def of(cls, value: str, area: Mask, field: StrainField, before: Taken) -> AffineTaken:
        """``before``: what it took when other ZOIs had a value."""
        fit = before.fit if isinstance(before, AffineTaken) else affine_fit(field, area, area & field.ok)
        valid = field.ok.ravel()[fit.at]
        weights = [fit.weights(value, valid)]
        if field.measure != "small" and value in STRAINS:
            weights += [fit.weights(gradient, valid) for gradient in GRADIENT]
        rows = [Row.of(range(6), fit.at[valid], one[:, valid], area.size) for one in weights]
        noise = fit.noise_weights(value, field, valid)[:, valid]
        rows.insert(1, Row.of(_VARIANCES, fit.at[valid], noise, area.size))
        return cls(value=value, area=area, fit=fit, sums=rows)

    def read(self, now: Now, sums: Floats, variance: float) -> Read:
        if now.field.n_parts(self.area) > 1:
            return math.nan, math.nan, COME_APART
        strain, variance, *gradient = sums[:, 0].tolist()
        if gradient:
            strain = strain_of(self.value, now.field.measure, gradient)
        variance += now.common(sums[0, 1:])
        return strain, math.sqrt(variance) if variance > 0 else 0.0, ""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MeanTaken(Taken):
    """The mean of a value over ZOIs; ``beyond`` is the factor of its noise by their patterns (``Sums``)."""

    value: str
    at: Flat
    by: Sequence[float]
    beyond: float

    @classmethod
    def of(cls, value: str, area: Mask, field: StrainField) -> MeanTaken:
        at, terms, pairs = np.flatnonzero(area & field.ok), combination(value), dict[int, float]()
        for pair, factor in products(value):
            pairs[pair] = pairs.get(pair, 0.0) + factor
        which, by = ([*column, 0, 0][:3] for column in (pairs.keys(), pairs.values()))
        shares = np.repeat([list(terms.values())], len(at), axis=0).T / len(at)
        return cls(
            value=value, at=at, by=by,
            beyond=1.0 if field.sums is None else field.sums.factor(value, area),
            sums=[Row.of(list(terms), at, shares, area.size)],
            noise=Row(at, np.full(len(at), 1 / len(at))), pairs=which, kind=_KINDS[frozenset(i % 3 for i in terms)],
        )  # fmt: skip

    def factors(self, sums: Floats) -> Sequence[float]:
        return self.by

    def read(self, now: Now, sums: Floats, variance: float) -> Read:
        value = float(sums[0, 0])
        if now.field.measure != "small" and self.value in STRAINS:
            value = float(np.cumsum(now.named(self.value)[self.at])[-1]) / len(self.at)
        return value, math.sqrt(max(variance, 0.0) * self.beyond**2 + now.common(sums[0, 1:])), ""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ExtremeTaken(Taken):
    """The largest value of some ZOIs by ``sign``, with the sigma of the ZOI that has it."""

    value: str
    at: Flat
    sign: int

    def read(self, now: Now, sums: Floats, variance: float) -> Read:
        k = self.at[np.argmax(self.sign * now.named(self.value)[self.at])]
        return float(now.named(self.value)[k]), float(now.named(f"sigma_{self.value}")[k]), ""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class EndsTaken(Taken):
    """(L - L0)/L0 of the line ``before`` (x, y), px, between the mean places of two ends."""

    before: Point

    @classmethod
    def of(cls, first: Flat, second: Flat, field: StrainField) -> Taken:
        """What is taken of the ZOIs of two ends, at least one each."""
        share = np.zeros(field.status.size)
        share[second] += 1 / len(second)
        share[first] -= 1 / len(first)
        at = np.flatnonzero(share)
        row, column = np.divmod(at, field.grid.shape[1])
        places = field.grid.x[column], field.grid.y[row]
        x, y = (math.fsum(share[at] * along) for along in places)
        if not (x or y):
            return Taken(reason=Message("both ends are the same ZOIs; make the gauge longer"))
        sums = [Row.of((i,), at, share[at], share.size) for i in (_U, _V)]
        return cls(before=(x, y), sums=sums, noise=Row(at, share[at]), pairs=_ALONG_LINE)

    def factors(self, sums: Floats) -> Sequence[float]:
        x, y = self.direction(sums)
        return x * x, 2 * x * y, y * y

    def direction(self, sums: Floats) -> Point:
        """Direction of the line in this field, a unit vector."""
        (x, y), (u, v) = self.before, sums[:, 0].tolist()
        now = math.hypot(x + u, y + v)
        return (x + u) / now, (y + v) / now

    def read(self, now: Now, sums: Floats, variance: float) -> Read:
        (x, y), (u, v) = self.before, sums[:, 0].tolist()
        before, after = math.hypot(x, y), math.hypot(x + u, y + v)
        # The difference of the lengths loses no digits where the extension is small.
        strain = (u * (2 * x + u) + v * (2 * y + v)) / (after + before) / before
        if now.field.common is not None:
            variance += now.common(np.array(self.direction(sums)) @ sums[:, 1:])
        return strain, math.sqrt(max(variance, 0.0)) / before, ""


_KINDS = {frozenset({0}): 0, frozenset({1}): 1, frozenset({2}): 2, frozenset({1, 2}): 3}


@lru_cache(maxsize=16)
def overlaps(places: Places) -> Floats:
    """Correlation of values of ZOIs so many rows and columns apart, (4, Y, X).

    Of displacements, of changes along x, along y, and of sums of both, whose two parts are equally strong and
    uncorrelated for a pattern without direction.
    """
    reach = (places.size - 1) // places.step + 1
    still, steep = (overlap(places.window, places.size, places.step, reach, moment) for moment in (0, 1))
    along_x, along_y = np.outer(still, steep), np.outer(steep, still)
    return np.array([np.outer(still, still), along_x, along_y, (along_x + along_y) / 2])
