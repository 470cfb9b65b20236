"""What the grey levels of a few frames show: of light and bits, and of the pattern.

The pattern of each ZOI and the size of the speckle come from differences of pixels alone: cheap enough for pictures
that are judged several times a second; ``analysis.picture`` has the same of a filtered pattern, and what the kernel
makes of it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.field import ZoiGrid


@dataclass(frozen=True, slots=True)
class Exposure:
    """Grey levels of the pixels looked at, as parts of full scale.

    Attributes
    ----------
    low, mean, high : float
        1st percentile, mean, 99th percentile.
    saturated : float
        Share of the pixels at the top in any of the frames.
    dark : float
        Share at zero in any of them.
    piled : float
        Share of all values at the highest one, where that is below the top: clipped before it came here.
    """

    low: float
    mean: float
    high: float
    saturated: float
    dark: float
    piled: float


@dataclass(frozen=True, slots=True)
class Depth:
    """Bits of a sample.

    Attributes
    ----------
    stated : int
    unused_above, unused_below : int
        Highest and lowest bits that are the same in every sample.
    """

    stated: int
    unused_above: int
    unused_below: int

    @property
    def changing(self) -> int:
        """Bits between the highest and the lowest that change."""
        return max(self.stated - self.unused_above - self.unused_below, 0)


def exposure(pixels: NDArray[Any], top: int) -> Exposure:
    """Light, from the pixels of a few frames, (N, P) uint8 or uint16; ``top`` (GL) is where they saturate."""
    counts = np.bincount(pixels.reshape(-1))
    highest = len(counts) - 1
    return Exposure(
        low=_percentile(counts, 0.01) / top,
        mean=float(counts @ np.arange(len(counts))) / pixels.size / top,
        high=_percentile(counts, 0.99) / top,
        saturated=float((pixels.max(axis=0) >= top).mean()),
        dark=float((pixels.min(axis=0) == 0).mean()),
        piled=float(counts[highest]) / pixels.size if highest < top else 0.0,
    )


def _percentile(counts: NDArray[np.intp], share: float) -> float:
    """Percentile of values that occur ``counts`` times, as ``np.percentile`` has it."""
    upto = counts.cumsum()
    place = share * (int(upto[-1]) - 1)
    below = math.floor(place)
    low, high = (int(np.searchsorted(upto, k, side="right")) for k in (below, math.ceil(place)))
    return low + (place - below) * (high - low)


def depth(pixels: NDArray[Any], bits: int) -> Depth:
    """Which bits change at all between the pixels of a few frames, (N, P) uint8 or uint16."""
    flat = pixels.reshape(-1)
    changing = int(np.bitwise_or.reduce(flat ^ flat[0]))
    if changing == 0:
        return Depth(bits, bits, 0)
    below = (changing & -changing).bit_length() - 1
    return Depth(bits, max(bits - changing.bit_length(), 0), below)


Floats = NDArray[np.float64]
Pixels = NDArray[np.float32]

SLOPE = (-1 / 60, 3 / 20, -3 / 4, 0.0, 3 / 4, -3 / 20, 1 / 60)
"""A derivative of sixth order: 2 % too small at five pixels a period."""
OF_NOISE = sum(tap**2 for tap in SLOPE)
SLOW_SHARE = 12  # of the shorter side: what varies over more is light, not speckle
CELLS_OF_SLOW = 8
FWHM_OF_RADIUS = 4 * math.sqrt(math.log(2))
SPECKLE_RADIUS_PX = (1.5, 4.0)
"""Wanted: finer speckle can be aliased by the pixels, which biases the strain unnoticed; coarser speckle is noisier."""


@dataclass(frozen=True, slots=True, eq=False)
class ZoiPattern:
    """What there is to follow in each ZOI, the noise taken out.

    Attributes
    ----------
    variance : (R, C) float64, GL^2
        Of the grey levels.
    along_x, along_y : (R, C) float64, GL^2/px^2
        Sums of squares of the gradient (SSSIG).
    """

    variance: Floats
    along_x: Floats
    along_y: Floats


def zoi_pattern(picture: NDArray[Any], grid: ZoiGrid, noise: float) -> ZoiPattern:
    """Contrast and gradients in all ZOIs of a grid, active or not.

    Parameters
    ----------
    picture : (H, W), GL
    grid : ZoiGrid
    noise : float, GL
        Standard deviation of the noise of this picture.
    """
    from scipy.ndimage import correlate1d

    zero = picture - np.float32(picture.mean(dtype=np.float64))
    pixels = grid.size**2
    mean = box_sums(zero, grid) / pixels
    variance = box_sums(zero * zero, grid) / pixels - mean**2 - noise**2
    slopes = (correlate1d(zero, SLOPE, axis=axis, mode="nearest") for axis in (1, 0))
    along_x, along_y = (box_sums(slope * slope, grid) - pixels * OF_NOISE * noise**2 for slope in slopes)
    return ZoiPattern(np.maximum(variance, 0), np.maximum(along_x, 0), np.maximum(along_y, 0))


def box_sums(values: Pixels, grid: ZoiGrid) -> Floats:
    """Sums over each ZOI, (R, C)."""
    (rows, columns), size, step = grid.shape, grid.size, grid.step
    top, left = int(grid.first_y[0]), int(grid.first_x[0])
    height, width = (rows - 1) * step + size, (columns - 1) * step + size
    part = values[top : top + height, left : left + width]
    block = math.gcd(step, size)
    if block > 1:
        part = np.add.reduceat(part, np.arange(0, height, block), axis=0)
        part = np.add.reduceat(part, np.arange(0, width, block), axis=1)
    total = np.pad(part.astype(np.float64), ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    side, every = size // block, step // block
    y, x = every * np.arange(rows)[:, None], every * np.arange(columns)[None, :]
    upper, lower = total[y, x + side] - total[y, x], total[y + side, x + side] - total[y + side, x]
    return np.asarray(lower - upper)


def speckle_radius(picture: Pixels, noise: float, inside: NDArray[np.bool_]) -> float:
    """r of a blob exp(-rho^2 / (2 r^2)) with the autocorrelation of the pattern at half height, px.

    Mean of x and y; NaN where the autocorrelation never falls so far. Between lags its logarithm is
    interpolated over the square of the lag, which is exact for Gaussian speckle.

    Parameters
    ----------
    picture : (H, W) float32, GL
    noise : float, GL
        Standard deviation of the noise of this picture.
    inside : (H, W) bool
        The pixels that count.
    """
    zero = (picture - _slow(picture, inside)) * inside
    zero -= np.float32(zero.sum(dtype=np.float64) / max(int(inside.sum()), 1)) * inside
    widths = [_half_width(_lags(zero, inside, axis), noise) for axis in (1, 0)]
    return 2 * float(np.mean(widths)) / FWHM_OF_RADIUS


def _slow(picture: Pixels, inside: NDArray[np.bool_]) -> Pixels:
    """The light and what else varies over a twelfth of the picture, from the pixels inside alone."""
    from scipy.ndimage import gaussian_filter

    px = min(picture.shape) / SLOW_SHARE
    cell = max(int(px / CELLS_OF_SLOW), 1)
    height, width = picture.shape
    starts = np.arange(0, height, cell), np.arange(0, width, cell)
    total, weight = (
        gaussian_filter(
            np.add.reduceat(np.add.reduceat(values, starts[0], axis=0), starts[1], axis=1),
            px / cell, mode="nearest",
        )
        for values in (picture * inside, inside.astype(np.float32))
    )  # fmt: skip
    slow = np.repeat(total / np.maximum(weight, 1e-9), cell, axis=0)[:height]
    return np.asarray(np.repeat(slow, cell, axis=1)[:, :width], np.float32)


def _lags(zero: Pixels, inside: NDArray[np.bool_], axis: int) -> Iterator[float]:
    """Mean products of pixels at growing lags, up to half the picture."""
    values, counted = (zero, inside) if axis == 0 else (zero.T, inside.T)
    for lag in range(max(len(values) // 2, 1)):
        first, second = slice(None, len(values) - lag), slice(lag, None)
        pairs = int(np.count_nonzero(counted[first] & counted[second]))
        product = np.einsum("ij,ij->j", values[first], values[second]).sum(dtype=np.float64)
        yield float(product) / max(pairs, 1)


def _half_width(lags: Iterator[float], noise: float) -> float:
    """The lag at half height, px."""
    full = next(lags) - noise**2
    if full <= 0:
        return math.nan
    before = 1.0
    for lag, value in zip(itertools.count(1), lags, strict=False):
        share = value / full
        if share < 0.5:
            high, low = math.log(before), math.log(max(share, 1e-6))
            part = (high - math.log(0.5)) / (high - low)
            return math.sqrt((lag - 1) ** 2 + part * (lag**2 - (lag - 1) ** 2))
        before = share
    return math.nan
