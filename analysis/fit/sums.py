"""What noise makes of a mean over ZOIs, from the ZOIs as they are.

Each value is a sum over the pixels of its ZOI: a row of (J' w J)^-1 times J' w. A mean over ZOIs is therefore one
such sum over the picture, and the noise of the mean is the root of the sum of its squares. For gradients neighbours
nearly cancel within a gauge, and what is left is decided by how the pattern differs from ZOI to ZOI, which no
overlap of windows contains: on dense grids the mean scatters up to 1.5 times as much as it predicts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from analysis.compiled.loops import helper, part, shared
from analysis.compiled.shares import in_shares, part_of
from analysis.field import Window, ZoiGrid, combination, profile, variance_of_sum
from analysis.fit.moments import CHANNELS
from analysis.fit.sensitivity import columns, parameter_scale

Floats = NDArray[np.float64]
Item = TypeVar("Item")

MONOMIALS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
"""1, x, y, x^2, xy, y^2, with which a channel is multiplied."""
MAX_CACHED = 64
"""Gauges whose factors are remembered."""


@dataclass(frozen=True, slots=True, eq=False)
class MeanNoise:
    """How far the noise of means over ZOIs of one reference exceeds what follows from the overlap of windows.

    Attributes
    ----------
    grid : ZoiGrid
    window : str
    order : 1 or 2
    able : (A,) bool
        Which of the active ZOIs can be measured.
    index : (A,)
        Flat places of the active ZOIs on the grid.
    origins : (A, 2) int64
        First row and column of each.
    images : (4, H, W) float32
        See ``PreparedReference.images``.
    inverse : (>= A, P, P) float32
        (J' w J)^-1 of each ZOI.
    unit_covariance : (21, R, C) float32
    """

    grid: ZoiGrid
    window: Window
    order: int
    able: NDArray[np.bool_]
    index: NDArray[np.intp]
    origins: NDArray[np.int64]
    images: NDArray[np.float32]
    inverse: NDArray[np.float32]
    unit_covariance: NDArray[np.float32]
    _made: dict[Hashable, Any] = field(default_factory=dict, repr=False)

    def factor(self, name: str, where: NDArray[np.bool_]) -> float:
        """Standard deviation of the mean of ``name`` over a gauge (R, C), over that of overlapping windows.

        Of all its ZOIs that can be measured: one that is lost does not change it. 1 where there are too few.
        """
        return self.kept((name, np.packbits(where).tobytes()), lambda: self._factor(name, where))

    def kept(self, key: Hashable, make: Callable[[], Item]) -> Item:
        """What ``make`` gives, remembered for the last ``MAX_CACHED`` keys."""
        if key not in self._made:
            if len(self._made) >= MAX_CACHED:
                self._made.pop(next(iter(self._made)))
            self._made[key] = make()
        found: Item = self._made[key]
        return found

    def information(self, at: NDArray[np.intp]) -> Floats:
        """(J' w J) of the six affine values of the ZOIs at flat places (n,), all others eliminated, (6, 6, n).

        Zero where a ZOI cannot be measured.
        """
        which = self._which(at)
        places, units = self._affine()
        found = self.inverse[which][:, places][:, :, places] * np.outer(units, units)
        found[~self.able[which]] = np.eye(6)
        normal = np.linalg.inv(found.astype(np.float64))
        normal[~self.able[which]] = 0
        return np.ascontiguousarray(np.moveaxis(normal, 0, 2))

    def variance(self, at: NDArray[np.intp], weights: Floats) -> float:
        """Variance of a sum of the six affine values of ZOIs by ``weights`` (6, n), for noise of 1 GL."""
        which = self._which(at)
        used = self.able[which]
        return self._variance(weights.T[used], which[used])

    def unit_variances(self, at: NDArray[np.intp]) -> Floats:
        """Variances of u and v of ZOIs, (2, n), for noise of 1 GL."""
        return self.unit_covariance.reshape(21, -1)[[0, 15]][:, at].astype(np.float64)

    def _which(self, at: NDArray[np.intp]) -> NDArray[np.intp]:
        """The numbers of the active ZOIs at flat places of the grid."""
        return np.searchsorted(self.index, at)

    def _affine(self) -> tuple[NDArray[np.intp], Floats]:
        """Where the six affine values stand among the parameters of the fit, and their units."""
        units = parameter_scale(self.order, self.grid.size)
        half = len(units) // 2
        places = np.array([0, 1, 2, half, half + 1, half + 2])
        return places, units[places]

    def _factor(self, name: str, where: NDArray[np.bool_]) -> float:
        which = np.flatnonzero(self.able & where.ravel()[self.index])
        if len(which) < 2:
            return 1.0
        chosen = np.zeros(self.grid.shape)
        chosen.ravel()[self.index[which]] = 1
        sigma = np.sqrt(np.maximum(unit_variance(name, self.unit_covariance), 0)) * chosen
        expected = variance_of_sum(sigma, name, self.grid, self.window)
        shares = np.zeros((len(which), 6))
        for parameter, share in combination(name).items():
            shares[:, parameter] = share
        made = self._variance(shares, which)
        return math.sqrt(made / expected) if expected > 0 and math.isfinite(made) else 1.0

    def _variance(self, shares: Floats, which: NDArray[np.intp]) -> float:
        """Variance of the sum of ``shares`` (B, 6) of the parameters of the ZOIs ``which``, for noise of 1 GL."""
        size, origins = self.grid.size, np.ascontiguousarray(self.origins[which])
        corner = origins.min(axis=0)
        height, width = (origins.max(axis=0) - corner + size).tolist()
        rows = np.empty(height)
        line = profile(self.window, size)
        along = (np.arange(size) - (size - 1) / 2) / (size / 2)
        pitch, samples = self.images.shape[2], self.images[0].size
        flat = self.images.reshape(-1)
        weights = self._weights(shares, which)
        squares(flat, samples, pitch, origins, weights, line, along, corner, width, rows)
        return float(np.cumsum(rows)[-1])  # in their order: the same bits wherever they are in memory

    def _weights(self, shares: Floats, which: NDArray[np.intp]) -> Floats:
        """The rows of the inverse that make these sums, by channel and monomial, (B, 7, 6)."""
        places, units = self._affine()
        row = np.einsum("bk,bkp->bp", shares * units, self.inverse[which][:, places])
        out = np.zeros((len(which), CHANNELS, len(MONOMIALS)))
        for j, (channel, x, y) in enumerate(columns(self.order)):
            out[:, channel, MONOMIALS.index((int(x), int(y)))] = row[:, j]
        return out


def unit_variance(name: str, covariance: NDArray[np.float32]) -> Floats:
    """Variance of a value from the 21 covariances, (R, C)."""
    from analysis.field import products

    return np.asarray(sum(share * covariance[pair].astype(np.float64) for pair, share in products(name)))


@helper
def blurred(f: Any, i: Any, pitch: Any, along_x: Any, along_y: Any, across: Any) -> Any:
    """The second differences of an image at one pixel (``images.with_second_differences``), each with its factor."""
    one = np.uintp(1)
    out = along_x * (f[i - one] + f[i + one] - 2 * f[i]) + along_y * (f[i - pitch] + f[i + pitch] - 2 * f[i])
    corners = f[i + pitch + one] + f[i - pitch - one] - f[i + pitch - one] - f[i - pitch + one]
    return out + across * corners / 4


@shared
def squares(
    images: Any, samples: int, pitch: int, origins: Any, weights: Any, line: Any, along: Any, corner: Any, width: int,
    out: Any,
) -> None:  # fmt: skip
    """The sum of the squares of each row of what all ZOIs take of the pixels from ``corner`` (row, column) on.

    A picture of it would be new memory, most of the time at 12 MP: it is made some rows at a time.
    """
    in_shares(_squares, (images, samples, pitch, origins, weights, line, along, corner, width, out))


@part
def _squares(
    images: Any, samples: int, pitch: int, origins: Any, weights: Any, line: Any, along: Any, corner: Any, width: int,
    out: Any, share: int,
) -> None:  # fmt: skip
    first, end = part_of(len(out), share)
    taken = np.zeros((end - first, width))
    scatter(images, samples, pitch, origins, weights, line, along, (corner[0] + first, corner[1]), taken)
    for y in range(len(taken)):
        row, total = taken[y], 0.0
        for x in range(len(row)):
            total += row[x] * row[x]
        out[first + y] = total


@part
def scatter(
    images: Any, samples: int, pitch: int, origins: Any, weights: Any, line: Any, along: Any, corner: Any, out: Any
) -> None:  # fmt: skip
    """Add what each ZOI takes of each pixel to ``out``, whose first pixel is ``corner`` (row, column)."""
    # Unsigned places: with others numba looks for negative ones, pixel by pixel, and no vectors are made.
    size, image, down = len(line), np.uintp(samples), np.uintp(pitch)
    for z in range(len(origins)):
        a, begin = weights[z], corner[0] - origins[z, 0]
        for y in range(max(begin, 0), min(begin + len(out), size)):
            eta = along[y]
            top, left = origins[z, 0] + y, origins[z, 1]
            at = np.uintp(top * pitch + left)
            to = out[top - corner[0], left - corner[1] : left - corner[1] + size]
            x0 = a[0, 0] + eta * (a[0, 2] + eta * a[0, 5])
            x1 = a[0, 1] + eta * a[0, 4]
            y0 = a[1, 0] + eta * (a[1, 2] + eta * a[1, 5])
            y1 = a[1, 1] + eta * a[1, 4]
            f0 = a[2, 0] + eta * a[2, 2]
            d0 = a[3, 0] + eta * a[3, 2]
            x2, y2, f1, d1 = a[0, 3], a[1, 3], a[2, 1], a[3, 1]
            along_x, along_y, across, here = a[4, 0], a[5, 0], a[6, 0], line[y]
            for x in range(size):
                xi, i = along[x], at + np.uintp(x)
                value = blurred(images, image + image + i, down, along_x, along_y, across)
                value += images[i] * (x0 + xi * (x1 + xi * x2))
                value += images[image + i] * (y0 + xi * (y1 + xi * y2))
                value += images[image + image + i] * (f0 + xi * f1)
                to[x] += here * line[x] * (value + d0 + xi * d1)
