"""Weights of the generalised least squares of an affine field to the displacements and gradients of ZOIs.

White pixel noise on a pattern without direction makes of each ZOI three moments of one noise under its window:
displacement, change along x, change along y. Their covariance between two ZOIs is a product of one correlation along
x and one along y, so that it is never laid out: conjugate gradients solve the normal equations with small matrices
(M. R. Hestenes, E. Stiefel, J. Res. NBS 49 (1952) 409-436). The weights are the same for u and v, and follow from the
grid alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.field import Window, ZoiGrid, profile

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

UNCORRELATED = 0.05
"""Share of the variance of a value that its neighbours do not have: the pattern differs from place to place."""
_RESIDUAL, _STEPS = 1e-5, 200  # where the conjugate gradients end


class Places(NamedTuple):
    """What of a grid the covariance depends on."""

    shape: tuple[int, int]
    size: int
    step: int
    window: Window

    @classmethod
    def of(cls, grid: ZoiGrid, window: Window) -> Places:
        """Of ``grid`` with a window."""
        return cls(grid.shape, grid.size, grid.step, window)


@dataclass(frozen=True, slots=True, eq=False)
class AffineWeights:
    """What makes an affine field of the values of ZOIs.

    Attributes
    ----------
    x, y : (R, C) float64, px
        Places of the ZOIs about the middle of the area.
    weights : (3, 3, R, C) float64
        Of displacement, change along x and along y (second axis), for the three of the field (first axis); zero
        where a ZOI is not valid.
    noise : (3, R, C) float64
        What the variance of the displacement of each ZOI, px^2, adds to the variance of the three.
    """

    x: Floats
    y: Floats
    weights: Floats
    noise: Floats


def affine_weights(places: Places, area: Bools, valid: Bools) -> AffineWeights:
    """The weights of the ``valid`` ZOIs (R, C) of an ``area`` (R, C), at least one.

    They are those of the whole area, without the ZOIs that are not valid, normalised: exact for affine fields
    whichever ZOIs are valid. The pattern of a ZOI does not count: weighted by it, the pixels of neighbours no longer
    count alike, and the strain of a region of 4,400 ZOIs of 32 px scattered 1.3 times as much (November 2026).
    """
    return _weights(places, area.tobytes(), (area & valid).tobytes())


@lru_cache(maxsize=12)
def _weights(places: Places, area: bytes, valid: bytes) -> AffineWeights:
    solved, model = _solved(places, area), covariance_of(places)
    kept = solved.weights * np.frombuffer(valid, np.bool_).reshape(places.shape)
    normal = np.einsum("ajyx,bjyx->ab", kept, solved.design)
    weights = np.einsum("ab,bjyx->ajyx", np.linalg.inv(normal), kept)
    noise = np.sum(weights * model.times(weights), axis=1) / model.displacement
    return AffineWeights(solved.x, solved.y, weights, noise)


class _Solved(NamedTuple):
    x: Floats
    y: Floats
    design: Floats
    weights: Floats


@lru_cache(maxsize=12)
def _solved(places: Places, area: bytes) -> _Solved:
    """Design and weights (3, 3, R, C) of all ZOIs of an area."""
    inside = np.frombuffer(area, np.bool_).reshape(places.shape)
    rows, columns = np.nonzero(inside)
    y, x = (
        places.step * (np.arange(n) - at.mean()) for n, at in zip(places.shape, (rows, columns), strict=True)
    )
    x, y = np.meshgrid(x, y)
    one, nothing = np.ones(places.shape), np.zeros(places.shape)
    design = np.array([[one, nothing, nothing], [x, one, nothing], [y, nothing, one]]) * inside
    return _Solved(x, y, design, covariance_of(places).solve(design, inside))


@dataclass(frozen=True, eq=False)
class Covariance:
    """Of displacement and two gradients of all ZOIs of a grid, for noise of 1 of the pixels.

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
