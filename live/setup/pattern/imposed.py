"""Imposed deformations of a picture: the errors to expect from its pattern.

A Wiener filter removes the noise of the picture, a quintic spline deforms it, then it gets new noise and rounding.
The kernel interpolates in the same way, so this truth is not independent: noise and attenuation found here are
valid, bias is a lower bound.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis import KernelSettings, PatternError, PhaseKernel
from analysis.field import Roi, StrainField, ZoiGrid
from analysis.picture.pattern import predicted_sigma, resolution_length
from analysis.picture.spectrum import filtered_pattern

Floats = NDArray[np.float64]
QUANTISATION = 1 / 12
LENGTH_OF_C = 1 / math.sqrt(-math.log(0.9))
"""l_10% over c where a sine of period p keeps exp(-(c/p)^2)."""
SHIFTS = (-0.4, -0.2, 0.2, 0.4)
STRAIN = 1e-3
EDGE = 8  # px left out at the edge, where the spline continues the picture
MIN_ZOIS = 6


class Imposed:
    """A noise-free version of a picture, its camera, and deformed pairs of it.

    Parameters
    ----------
    picture : (H, W), GL
    noise : float, GL
        Of one frame, rounding included.
    top : float, GL
        Full scale.
    """

    def __init__(self, picture: NDArray[Any], noise: float, top: float, seed: int = 0) -> None:
        from scipy.ndimage import spline_filter

        pattern = filtered_pattern(picture.astype(np.float32), noise, 5)
        self.light = pattern.level.astype(np.float64) + pattern.mean
        self.noise, self.top = noise, top
        self._coefficients = spline_filter(self.light, order=5, mode="mirror")
        self._rng = np.random.default_rng(seed)
        self._observed: dict[tuple[float, float, int], NDArray[np.float32]] = {}

    def deformed(self, u: float, strain: float = 0.0, wave: tuple[float, float] | None = None) -> Floats:
        """The pattern shifted by u (px) along x, strained along x about the middle, or waved (amplitude, period)."""
        from scipy.ndimage import map_coordinates

        height, width = self.light.shape
        y, x = np.mgrid[:height, :width].astype(float)
        middle = (width - 1) / 2
        back = middle + (x - middle - u) / (1 + strain)
        if wave is not None:
            amplitude, period = wave
            for _ in range(8):  # the point that moved to x; contracts as amplitude 2 pi/period
                back = x - amplitude * np.sin(2 * np.pi * back / period)
        return np.asarray(
            map_coordinates(self._coefficients, [y, back], order=5, mode="mirror", prefilter=False)
        )

    def observed(self, u: float, strain: float, n: int) -> NDArray[np.float32]:
        """``burst`` of ``deformed``; n = 0: without noise. Made once, for ZOIs of all sizes."""
        key = (u, strain, n)
        if key not in self._observed:
            light = self.deformed(u, strain) if u or strain else self.light
            self._observed[key] = self.burst(light, n) if n else light.astype(np.float32)
        return self._observed[key]

    def burst(self, light: Floats, n: int) -> NDArray[np.float32]:
        """Mean of n frames, each with its own noise and rounding, float32 GL."""
        extra = math.sqrt(max(self.noise**2 - QUANTISATION, 0.0))
        total = np.zeros(light.shape)
        for _ in range(n):
            levels = light + extra * self._rng.standard_normal(light.shape, np.float32)
            total += np.clip(np.rint(levels), 0, self.top)
        return (total / n).astype(np.float32)


@dataclass(frozen=True, slots=True)
class ExpectedErrors:
    """The errors of one size and order of ZOI on the picture, for bursts of n frames.

    Attributes
    ----------
    size : int, px
    order, n : int
    zois : int
        Measured for these figures, not overlapping.
    bias_u : float, px
        Largest median error over the shifts, without noise.
    sigma_u, sigma_strain : float, px and 1
        Scatter over ZOIs, by the median absolute deviation: some ZOIs may lie partly beside the specimen.
    predicted_u, predicted_strain : float
        Median of the kernel's predictions for the ZOIs.
    limit_strain : float
        From g and the window only (order 1).
    strain_error : float
        Median relative error of an imposed strain of 1e-3, without noise.
    length : float, px
        l_10% of theory (order 1; order 2: measured on sines).
    refused : float
        Share of ZOIs with another status than OK.
    """

    size: int
    order: int
    n: int
    zois: int
    bias_u: float
    sigma_u: float
    sigma_strain: float
    predicted_u: float
    predicted_strain: float
    limit_strain: float
    strain_error: float
    length: float
    refused: float


def separate_zois(shape: tuple[int, int], size: int) -> ZoiGrid | None:
    """ZOIs side by side, away from the edge; None where fewer than 6 fit."""
    height, width = shape
    rows, columns = height - 2 * EDGE, width - 2 * EDGE
    if min(rows, columns) < size or (rows // size) * (columns // size) < MIN_ZOIS:
        return None
    return ZoiGrid.cover(Roi(EDGE, EDGE, columns, rows), size, size)


def expected(imposed: Imposed, gradient: float, size: int, order: int, n: int) -> ExpectedErrors | None:
    """Measure imposed shifts and a strain; None where the picture is too small or shows no pattern."""
    grid = separate_zois(imposed.light.shape, size)
    if grid is None:
        return None
    sigma = imposed.noise / math.sqrt(n)
    try:
        kernel = PhaseKernel(imposed.observed(0, 0, n), grid, KernelSettings(order=order), noise=sigma)
    except PatternError:
        return None
    fields = [kernel.measure(imposed.observed(s, 0, n), noise=sigma) for s in SHIFTS]
    ok = [float(np.mean(f.ok)) for f in fields]
    if max(ok) * grid.n_active < MIN_ZOIS:
        return None
    bias_u, strain_error = systematic(imposed, grid, order)
    theory = resolution_length(size) if order == 1 else measured_length(imposed, size, order)
    return ExpectedErrors(
        size, order, n, grid.n_active,
        bias_u,
        float(np.mean([robust_std(f.u) for f in fields])),
        float(np.mean([robust_std(f.exx) for f in fields])),
        float(np.nanmedian([f.sigma_u for f in fields])),
        float(np.nanmedian([f.sigma_exx for f in fields])),
        predicted_sigma(size, sigma, gradient)[1] if order == 1 else float("nan"),
        strain_error,
        theory, 1 - float(np.mean(ok)),
    )  # fmt: skip


def robust_std(values: Floats) -> float:
    """Standard deviation of the typical values: 1.4826 times the median absolute deviation."""
    good = values[np.isfinite(values)]
    return float(1.4826 * np.median(np.abs(good - np.median(good)))) if good.size else float("nan")


def systematic(imposed: Imposed, grid: ZoiGrid, order: int) -> tuple[float, float]:
    """(largest median error of u over the shifts px, relative median error of the strain) without noise."""
    kernel = PhaseKernel(imposed.observed(0, 0, 0), grid, KernelSettings(order=order), noise=imposed.noise)

    def measured(u: float, strain: float) -> StrainField:
        return kernel.measure(imposed.observed(u, strain, 0), noise=imposed.noise)

    errors = [abs(float(np.nanmedian(measured(s, 0).u)) - s) for s in SHIFTS]
    return max(errors), float(np.nanmedian(measured(0, STRAIN).exx)) / STRAIN - 1


def measured_length(imposed: Imposed, size: int, order: int) -> float:
    """l_10% on this picture, px, from noise-free sines of u of three periods; NaN where it is too small."""
    grid = separate_zois(imposed.light.shape, size)
    if grid is None:
        return float("nan")
    dense = ZoiGrid.cover(grid.roi, size, max(size // 4, 1))
    still, losses, weights = imposed.light.astype(np.float32), [], []
    kernel = PhaseKernel(still, dense, KernelSettings(order=order), noise=imposed.noise)
    # Order 1 loses c^2/p^2 of a long wave, order 2 c^4/p^4.
    power = 2.0 if order == 1 else 4.0
    for period in (1.2 * size, 1.6 * size, 2.2 * size):
        field = kernel.measure(imposed.deformed(0, 0, (0.1, period)).astype(np.float32), noise=imposed.noise)
        model = 0.1 * np.tile(np.sin(2 * np.pi * dense.x / period), (len(dense.y), 1))
        good = np.isfinite(field.u)
        kept = float(np.sum(field.u[good] * model[good]) / np.sum(model[good] ** 2))
        losses.append(-math.log(min(max(kept, 0.05), 0.9999)))
        weights.append(period**-power)
    coefficient = float(np.dot(losses, weights) / np.dot(weights, weights))
    scale = LENGTH_OF_C if power == 2.0 else (-math.log(0.9)) ** -0.25
    return float(coefficient ** (1 / power) * scale)
