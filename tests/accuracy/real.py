"""The DIC Challenge pictures: the Star and sample 14 (found through PHASEDIC_DATA)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from analysis import KernelSettings, PhaseKernel, Roi, StrainField, ZoiGrid
from analysis.deconvolution import deconvolved

STAR, SAMPLE14 = "star_dic_challenge_2", "dic_challenge_1_sample14"


def read(path: Path) -> NDArray:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise FileNotFoundError(path)
    return image if image.ndim == 2 else image[..., 0]


@dataclass(frozen=True)
class StarResult:
    """l_10% in px, standard deviation of v (px) where periods exceed 200 px, and that predicted."""

    l10: float
    scatter: float
    predicted: float


def star(folder: Path, size: int, settings: KernelSettings, every: int = 10) -> StarResult:
    reference, deformed = (read(folder / STAR / f"DIC_Challenge_Star_Noise_{n}.tiff") for n in ("Ref", "Def"))
    height, width = reference.shape
    grid = ZoiGrid.cover(Roi(0, 0, width, height), size, 1)
    period = 10 + 290 * grid.x / (width - 1)
    line = np.zeros(grid.shape, bool)
    row = int(np.argmin(np.abs(grid.y - 250)))
    line[row] = True
    v = PhaseKernel(reference, grid.subset(active=line), settings).measure(deformed).v[row]
    area = np.zeros(grid.shape, bool)
    area[::every, ::every] = True
    area[:, period <= 200] = False
    field = PhaseKernel(reference, grid.subset(active=area), settings).measure(deformed)
    truth = 0.5 * np.cos(2 * np.pi * (grid.y[:, None] - 250) / period)
    # Attenuation at long periods is not noise: take off what the measured response explains.
    error = field.v - truth * _response(period, v)
    return StarResult(_l10(period, v), float(np.nanstd(error)), float(np.sqrt(np.nanmean(field.sigma_v**2))))


def star_deconvolved(folder: Path, size: int, steps: int) -> StarResult:
    """The map of the default kernel (step 3), with the window's blur partly taken off."""
    reference, deformed = (read(folder / STAR / f"DIC_Challenge_Star_Noise_{n}.tiff") for n in ("Ref", "Def"))
    height, width = reference.shape
    grid = ZoiGrid.cover(Roi(0, 0, width, height), size, 3)
    period = 10 + 290 * grid.x / (width - 1)
    field = PhaseKernel(reference, grid).measure(deformed)
    # Five rows about the middle: v has fallen by less than 1 % there at the periods that count.
    row = int(np.argmin(np.abs(grid.y - 250)))
    v = _line(deconvolved(field.v, grid, steps)[row - 2 : row + 3])
    truth = np.cos(2 * np.pi * np.subtract.outer(grid.y[row - 2 : row + 3], [250.0]) / period).mean(axis=0)
    scatter = float(np.nanstd(deconvolved(field.u, grid, steps)[:, period > 200]))
    return StarResult(_l10(period, v / truth), scatter, float("nan"))


def _fit(period: NDArray, v: NDArray) -> tuple[NDArray, float]:
    """Coefficients of 1 - v/0.5 in powers of 1/period^2 around the period that has lost 10 %."""
    limit = 150.0
    for _ in range(8):
        near = np.isfinite(v) & (period > 0.75 * limit) & (period < 2.2 * limit)
        # An even transfer function, as a short series in the wave number.
        basis = np.stack([period**-2.0, period**-4.0, period**-6.0], axis=1)
        c = np.linalg.lstsq(basis[near], 1 - v[near] / 0.5, rcond=None)[0]
        fine = np.linspace(0.5 * limit, 2 * limit, 4000)
        loss = c[0] * fine**-2 + c[1] * fine**-4 + c[2] * fine**-6
        above = np.flatnonzero(loss > 0.1)
        limit = float(fine[above[-1]]) if len(above) else 0.6 * limit
    return c, limit


def _l10(period: NDArray, v: NDArray) -> float:
    return _fit(period, v)[1]


def _response(period: NDArray, v: NDArray) -> NDArray:
    c, limit = _fit(period, v)
    p = np.maximum(period, limit)
    return 1 - (c[0] * p**-2 + c[1] * p**-4 + c[2] * p**-6)


@dataclass(frozen=True)
class WaveResult:
    """Sample 14: rms errors of the line mean of u (px) and of exx (um/m), of all points, and the bias."""

    u_line: float
    u_points: float
    exx_line: float
    exx_points: float
    exx_bias: float
    classical_line: float
    classical_points: float


def wave(
    folder: Path, image: str, column: int, size: int, settings: KernelSettings, every: int = 1
) -> WaveResult:
    """``every`` thins the rows of ZOIs out."""
    reference = read(folder / SAMPLE14 / "Sample14 Reference.tif")
    deformed = read(folder / SAMPLE14 / image)
    height, width = reference.shape
    grid = _thinned(ZoiGrid.cover(Roi(0, 0, width, height), size, 4), every)
    field = PhaseKernel(reference, grid, settings).measure(deformed)
    table = np.genfromtxt(folder / SAMPLE14 / "command.csv", delimiter=",")
    table = table[np.isfinite(table[:, 0])]
    u = np.interp(grid.x, table[:, 0], table[:, column])
    exx = np.interp(grid.x, table[:, 0], table[:, column + 1])
    direct = 1e6 * field.exx - exx
    # A gradient over a Gaussian of sigma passes exp(-k^2 sigma^2 / 2). Low-pass (the ZOI) and slope filter
    # pass a product of two such: the same resolution needs sigma/sqrt(2) each.
    small = round(size / np.sqrt(2)) // 2 * 2 + size % 2
    fine = _thinned(ZoiGrid.cover(Roi(0, 0, width, height), small, 4), every)
    rest = np.sqrt((size / 6) ** 2 - (small / 6) ** 2)
    other = PhaseKernel(reference, fine, settings).measure(deformed)
    classical = 1e6 * classical_gradient(other, rest) - np.interp(fine.x, table[:, 0], table[:, column + 1])
    return WaveResult(
        _rms(_line(field.u) - u), _rms(field.u - u),
        _rms(_line(direct)), _rms(direct), float(np.nanmean(direct)),
        _rms(_line(classical)), _rms(classical),
    )  # fmt: skip


def _thinned(grid: ZoiGrid, every: int) -> ZoiGrid:
    rows = np.zeros(grid.shape, bool)
    rows[:: 5 * every if every > 1 else 1] = True
    return grid.subset(active=rows)


def classical_gradient(field: StrainField, sigma: float) -> NDArray:
    """du/dx by weighted least squares of a slope through u, the weight a Gaussian of ``sigma`` px."""
    step = field.grid.step
    half = int(np.ceil(3 * sigma / step))
    x = np.arange(-half, half + 1) * step
    slope = x * np.exp(-0.5 * (x / sigma) ** 2)
    slope /= slope @ x
    out = np.full(field.u.shape, np.nan)
    for i in range(half, field.u.shape[1] - half):
        out[:, i] = field.u[:, i - half : i + half + 1] @ slope
    return out


def _line(values: NDArray) -> NDArray:
    """Mean of each column over its valid rows, NaN where there is none."""
    count = np.isfinite(values).sum(axis=0)
    return np.where(count > 0, np.nansum(values, axis=0) / np.maximum(count, 1), np.nan)


def _rms(values: NDArray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))
