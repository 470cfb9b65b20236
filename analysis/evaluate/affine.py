"""Weights of an affine field through the displacements and gradients of ZOIs, as one fit over their pixels has them.

The six values of a ZOI, times the normal matrix of its fit, are sums over its pixels: of the gradient of its pattern
times what the picture has moved there, times the window, times 1, x and y. Such sums are added so that each pixel of
the area counts alike. How follows from the windows: it is the generalised least squares of an affine field to the
ZOIs of a pattern that is everywhere the same, whose covariance is a product of one correlation along x and one along
y, so that it is never laid out: conjugate gradients solve the normal equations with small matrices (M. R. Hestenes,
E. Stiefel, J. Res. NBS 49 (1952) 409-436).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.compiled.interruption import go_on
from analysis.field import (
    PAIR_INDEX,
    VALUES,
    StrainField,
    Window,
    ZoiGrid,
    combination,
    fixed_sum,
    fixed_sums,
    profile,
)

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

UNCORRELATED = 0.05
"""Share of the variance of a value that its neighbours do not have: the pattern differs from place to place."""
_RESIDUAL, _STEPS = 1e-5, 200  # where the conjugate gradients end
_HALF = 0.5  # of the ZOIs of an area: with fewer, pixels no longer count alike, and each ZOI counts by its own fit
_DISPLACEMENTS = [PAIR_INDEX[0, 0], PAIR_INDEX[3, 3]]  # variances of u and v among the 21 pairs
_KEPT = 8  # sets of valid ZOIs whose inverse is remembered


class Places(NamedTuple):
    """What of a grid the covariance depends on."""

    shape: tuple[int, int]
    size: int
    step: int
    window: Window

    @classmethod
    def of(cls, grid: ZoiGrid, window: Window) -> Places:
        """Places of the ZOIs of ``grid`` with a window."""
        return cls(grid.shape, grid.size, grid.step, window)


@dataclass(frozen=True, slots=True, eq=False)
class AffineFit:
    """How an affine field follows from the n ZOIs of an area, whichever of them are valid.

    Attributes
    ----------
    at : (n,) intp
        Flat places of the ZOIs on the grid.
    x, y : (n,) float64, px
        Their places about the middle of the area.
    sums : (6, 6, n) float64
        Weights of the six affine values of a ZOI (second axis) in six sums (first axis).
    normal : (6, 6, n) float64
        What the six parameters of an affine field (second axis) make of these sums.
    measurable : (n,) bool
        ZOIs that have a pattern.
    unit : (2, n) float64
        Variances of u and v of each ZOI where that of the noise is 1.
    """

    at: NDArray[np.intp]
    x: Floats
    y: Floats
    sums: Floats
    normal: Floats
    measurable: Bools
    unit: Floats
    _inverses: dict[bytes, Floats] = field(default_factory=dict, repr=False)
    _patterns: dict[str, float] = field(default_factory=dict, repr=False)
    _variances: dict[tuple[str, bytes], float] = field(default_factory=dict, repr=False)

    def inverse(self, valid: Bools) -> Floats:
        """Parameters of the affine field from the sums over the ``valid`` ZOIs (n,), (6, 6)."""
        key = valid.tobytes()
        if key not in self._inverses:
            if len(self._inverses) >= _KEPT:
                self._inverses.clear()
            normal = np.cumsum(np.where(valid, self.normal, 0.0), axis=2)[:, :, -1]  # in one order everywhere
            self._inverses[key] = np.asarray(np.linalg.inv(normal), np.float64)
        return self._inverses[key]

    def fitted(self, values: Floats, valid: Bools) -> Floats:
        """The six parameters of the affine field of ``values`` (6, n), finite, of the ``valid`` ZOIs (n,)."""
        products = self.sums.reshape(6, -1) * np.where(valid, values, 0.0).ravel()
        return np.asarray(np.sum(self.inverse(valid) * fixed_sums(products), axis=1))

    def variance(self, name: str, strain: StrainField, valid: Bools) -> float:
        """Variance of a value of the affine field of the ``valid`` ZOIs (n,) of ``strain``."""
        variances = strain.covariance[_DISPLACEMENTS].reshape(2, -1)[:, self.at].astype(np.float64)
        noise = np.sum(self.noise_weights(name, strain, valid) * variances, axis=0)
        return fixed_sum(np.where(valid, noise, 0.0))

    def noise_weights(self, name: str, strain: StrainField, valid: Bools) -> Floats:
        """Weights (2, n) in ``variance`` of the variances of u and v of the ``valid`` ZOIs (n,)."""
        q = _parameters(name)
        row = np.sum(q[:, None] * self.inverse(valid), axis=0)
        of_each = sum(
            share * np.sum(row[:, None] * self.normal[:, k], axis=0) for k, share in enumerate(q) if share
        )
        of_both = np.sum((q**2).reshape(2, 3), axis=1)[:, None] / np.sum(q**2) ** 2
        unit = np.where(self.unit > 0, self.unit, np.inf)  # 0 without a pattern, where nothing is valid
        return np.asarray(self._unit_variance(name, strain, valid) * of_each * of_both / unit)

    def weights(self, name: str, valid: Bools) -> Floats:
        """A value of the affine field of the ``valid`` ZOIs (n,) as a sum of their six values, (6, n)."""
        row = np.sum(_parameters(name)[:, None] * self.inverse(valid), axis=0)
        return np.where(valid, np.sum(row[:, None, None] * self.sums, axis=0), 0.0)

    def _unit_variance(self, name: str, strain: StrainField, valid: Bools) -> float:
        """Variance of a value for noise of 1: by the pattern where no ZOI is lost, and what windows make of a loss."""
        key = name, valid.tobytes()
        if key not in self._variances:
            if len(self._variances) >= _KEPT * len(VALUES):
                self._variances.clear()
            places = Places.of(strain.grid, strain.window)
            noise = noise_of_windows(places, self.at, self.weights(name, valid))
            self._variances[key] = noise * self._beyond_windows(name, strain)
        return self._variances[key]

    def _beyond_windows(self, name: str, strain: StrainField) -> float:
        """Variance of a value of all ZOIs with a pattern, over what follows from their windows alone."""
        pattern = strain.sums
        if pattern is None:
            return 1.0
        if name not in self._patterns:
            weights = self.weights(name, self.measurable)
            places = Places.of(strain.grid, strain.window)
            made = pattern.variance(self.at, weights)
            self._patterns[name] = made / noise_of_windows(places, self.at, weights)
        return self._patterns[name]


def _parameters(name: str) -> Floats:
    """A value as a sum of the six parameters, (6,)."""
    q = np.zeros(6)
    for parameter, share in combination(name).items():
        q[parameter] = share
    return q


def affine_fit(strain: StrainField, area: Bools, valid: Bools) -> AffineFit:
    """How the affine field of an ``area`` (R, C) follows from its ``valid`` ZOIs (R, C), at least one."""
    places, whole = Places.of(strain.grid, strain.window), bool(valid.sum() >= _HALF * area.sum())
    if strain.sums is None:
        return _of_windows(places, area.tobytes(), whole)
    pattern = strain.sums

    def made() -> AffineFit:
        at = np.flatnonzero(area)
        return _fit(places, at, pattern.information(at), pattern.unit_variances(at), whole)

    return pattern.kept(("affine", area.tobytes(), whole), made)


@lru_cache(maxsize=12)
def _of_windows(places: Places, area: bytes, whole: bool) -> AffineFit:
    """Where the patterns of the ZOIs are not known: all alike."""
    at = np.flatnonzero(np.frombuffer(area, np.bool_))
    information = np.repeat(np.diag(np.tile(_even(places), 2))[:, :, None], len(at), axis=2)
    return _fit(places, at, information, np.ones((2, len(at))), whole)


def noise_of_windows(places: Places, at: NDArray[np.intp], weights: Floats) -> float:
    """Variance of a sum of the values of ZOIs by ``weights`` (6, n), where a displacement has the variance 1."""
    model, flat = covariance_of(places), np.zeros((6, places.shape[0] * places.shape[1]))
    flat[:, at] = weights
    maps = flat.reshape(2, 3, *places.shape)
    return float(np.sum(maps * model.times(maps)) / model.displacement)


def _fit(places: Places, at: NDArray[np.intp], information: Floats, unit: Floats, whole: bool) -> AffineFit:
    """From the normal matrices (6, 6, n) of the ZOIs at ``at``; ``whole``: so that each pixel counts alike."""
    inside = np.zeros(places.shape[0] * places.shape[1], np.bool_)
    inside[at] = True
    solved = _solved(places, inside.tobytes())
    x, y = (values.ravel()[at] for values in (solved.x, solved.y))
    shares = solved.weights.reshape(3, 3, -1)[:, :, at] / _even(places)[:, None]
    sums = _weighted(shares, information) if whole else _plain(x, y, information)
    return AffineFit(at, x, y, sums, _of_affine(x, y, sums), information[0, 0] > 0, unit)


def _weighted(shares: Floats, information: Floats) -> Floats:
    """Sums over pixels in which each counts alike: ``shares`` (3, 3, n) of those of the ZOIs, for u and for v."""
    out = np.empty_like(information)
    for part in (slice(0, 3), slice(3, 6)):
        rows = information[part]
        out[part] = sum(shares[:, i, None] * rows[None, i] for i in range(3))
    return out


def _plain(x: Floats, y: Floats, information: Floats) -> Floats:
    """Least squares of an affine field, each ZOI by its normal matrix."""
    out = information.copy()
    for first in (0, 3):
        out[first + 1] += x * information[first]
        out[first + 2] += y * information[first]
    return out


def _of_affine(x: Floats, y: Floats, sums: Floats) -> Floats:
    out = sums.copy()
    for first in (0, 3):
        out[:, first + 1] += x * sums[:, first]
        out[:, first + 2] += y * sums[:, first]
    return out


def _even(places: Places) -> Floats:
    """Normal matrix of a pattern without direction, up to a factor: of displacement, change along x and y, (3,)."""
    line = profile(places.window, places.size)
    x = np.arange(places.size) - (places.size - 1) / 2
    mass, square = float(line.sum()), float(line @ x**2)
    return np.array([mass * mass, mass * square, mass * square])


class _Solved(NamedTuple):
    x: Floats
    y: Floats
    weights: Floats


@lru_cache(maxsize=12)
def _solved(places: Places, area: bytes) -> _Solved:
    """Weights (3, 3, R, C) of displacement, change along x and along y of all ZOIs of an area."""
    inside = np.frombuffer(area, np.bool_).reshape(places.shape)
    rows, columns = np.nonzero(inside)
    y, x = (
        places.step * (np.arange(n) - at.mean()) for n, at in zip(places.shape, (rows, columns), strict=True)
    )
    x, y = np.meshgrid(x, y)
    one, nothing = np.ones(places.shape), np.zeros(places.shape)
    design = np.array([[one, nothing, nothing], [x, one, nothing], [y, nothing, one]]) * inside
    return _Solved(x, y, covariance_of(places).solve(design, inside))


@dataclass(frozen=True, eq=False)
class Covariance:
    """Covariance of displacement and two gradients of all ZOIs of a grid, for pixel noise of 1.

    ``down`` and ``across`` have the matrices (R, R) and (C, C) of moments 0 and 0, 0 and 1, 1 and 1.
    """

    down: tuple[Floats, Floats, Floats]
    across: tuple[Floats, Floats, Floats]

    @property
    def displacement(self) -> float:
        """Variance of the displacement of one ZOI."""
        return float(self.down[0][0, 0] * self.across[0][0, 0])

    @cached_property
    def diagonal(self) -> Floats:
        """Variances of the three, (3, 1, 1)."""
        (y0, _, y1), (x0, _, x1) = ([m[0, 0] for m in side] for side in (self.down, self.across))
        return np.array([y0 * x0, y0 * x1, y1 * x0])[:, None, None]

    def times(self, maps: Floats) -> Floats:
        """The covariance times (..., 3, R, C)."""
        (y00, y01, y11), (x00, x01, x11) = self.down, self.across
        value, along_x, along_y = maps[..., 0, :, :], maps[..., 1, :, :], maps[..., 2, :, :]
        even, odd = y00 @ value + y01 @ along_y, y01.T @ value + y11 @ along_y
        crossed, mixed = y00 @ along_x, y01.T @ along_x
        return np.stack(
            [even @ x00 + crossed @ x01.T, even @ x01 + crossed @ x11, odd @ x00 + mixed @ x01.T], axis=-3
        )

    def solve(self, right: Floats, inside: Bools) -> Floats:
        """``right`` (..., 3, R, C) divided by the covariance of the ZOIs ``inside``, and what is not correlated."""
        unit = np.sqrt(self.diagonal)
        scaled = right / unit
        found, rest = np.zeros_like(scaled), scaled.copy()
        way, left = rest.copy(), _squares(rest)
        enough = _RESIDUAL**2 * left
        for _ in range(_STEPS):
            go_on()
            there = (self.times(way / unit) / unit + UNCORRELATED * way) * inside
            share = left / np.maximum(np.sum(way * there, axis=(-3, -2, -1), keepdims=True), 1e-300)
            found, rest = found + share * way, rest - share * there
            before, left = left, _squares(rest)
            if np.all(left <= enough):
                break
            way = rest + left / np.maximum(before, 1e-300) * way
        return found / unit


def _squares(maps: Floats) -> Floats:
    return np.asarray(np.sum(maps**2, axis=(-3, -2, -1), keepdims=True))


@lru_cache(maxsize=16)
def covariance_of(places: Places) -> Covariance:
    line = profile(places.window, places.size)
    x = np.arange(places.size) - (places.size - 1) / 2
    moments = line / line.sum(), line * x / (line @ x**2)
    down, across = (_along(moments, places.step, n) for n in places.shape)
    return Covariance(down, across)


def _along(moments: tuple[Floats, Floats], step: int, count: int) -> tuple[Floats, Floats, Floats]:
    """Covariance of the moments (i, j) of ZOIs in a row, (count, count) each, for (0, 0), (0, 1), (1, 1)."""
    size = len(moments[0])
    lag = step * np.subtract.outer(-np.arange(count), -np.arange(count))  # of the second from the first

    def matrix(i: int, j: int) -> Floats:
        full = np.correlate(moments[i], moments[j], mode="full")
        return np.where(np.abs(lag) < size, full[np.clip(lag, 1 - size, size - 1) + size - 1], 0.0)

    return matrix(0, 0), matrix(0, 1), matrix(1, 1)
