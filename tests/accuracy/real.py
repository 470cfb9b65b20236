"""The DIC Challenge pictures: the Star and sample 14 (found through PHASEDIC_DATA)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from analysis import KernelSettings, PhaseKernel, Roi, StrainField, ZoiGrid
from analysis.evaluate.deconvolution import deconvolved, effect

STAR, SAMPLE14 = "star_dic_challenge_2", "dic_challenge_1_sample14"


def read(path: Path) -> NDArray:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise FileNotFoundError(path)
    return image if image.ndim == 2 else image[..., 0]


BAND = 1.38
"""How far from the middle of the Star its response is read, periods: there the wave is tilted by less than
0.1 rad, and its length differs by less than 0.5 % from that on the middle row, which is taken into account."""
NEAR = (0.8, 1.6)
"""Periods over l_10% between which the response is fitted to read l_10%."""
BAND_WIDTH = 0.06
"""Of the bands of wave lengths in which a sharpened response is read, in the logarithm."""
LONG = 200.0


@dataclass(frozen=True)
class StarResult:
    """l_10% in px and its standard error, standard deviation of v (px) at long periods, and that predicted."""

    l10: float
    l10_error: float
    scatter: float
    predicted: float


def star_field(folder: Path, size: int, settings: KernelSettings, step: int = 6) -> StrainField:
    """The whole Star measured; v = 0.5 cos(2 pi (y - 250)/period(x)) px, the period 10 .. 300 px."""
    reference, deformed = (read(folder / STAR / f"DIC_Challenge_Star_Noise_{n}.tiff") for n in ("Ref", "Def"))
    height, width = reference.shape
    grid = ZoiGrid.cover(Roi(0, 0, width, height), size, step)
    # Where half a pixel bends within a ZOI it would be UNEVEN, since it is wrong: here by how much is the question.
    return PhaseKernel(reference, grid, replace(settings, bending_px=np.inf)).measure(deformed)


def star(field: StrainField, steps: int = 0, sharpened: int = 0) -> StarResult:
    """Resolution and noise of v, of the map deconvolved in ``steps`` steps where that is not 0."""
    grid = field.grid
    v = deconvolved(field.v, grid, steps, sharpened) if steps else np.asarray(field.v, np.float64)
    period = np.broadcast_to(10 + 290 * grid.x / 3999, grid.shape)
    away = np.broadcast_to(grid.y[:, None] - 250, grid.shape)
    truth = 0.5 * np.cos(2 * np.pi * away / period)
    # The wave is tilted away from the middle row, since the period grows along x.
    length = period / np.hypot(1, away * (290 / 3999) / period)
    inside = np.isfinite(v) & (np.abs(away) <= BAND * period)
    read = _l10_in_bands if sharpened else _l10
    l10, error = read(length[inside], truth[inside], v[inside])
    area = np.isfinite(v) & (period > LONG)
    # Attenuation at long periods is not noise: take off what a smooth response explains.
    loss = _loss(LONG / period[area], truth[area], v[area], (2, 4))
    rest = v[area] - truth[area] * (1 - sum(c * (LONG / period[area]) ** n for n, c in loss.items()))
    predicted = np.sqrt(np.mean(field.sigma_v[area] ** 2)) * (
        effect(grid, steps, sharpened).noise if steps else 1
    )
    return StarResult(l10, error, float(rest.std()), float(predicted))


def _l10(length: NDArray, truth: NDArray, v: NDArray, blocks: int = 10) -> tuple[float, float]:
    """The wave length of which 10 % are lost, and its standard error (jackknife over blocks of wave lengths)."""
    l10 = _crossing(length, truth, v)
    near = (length > NEAR[0] * l10) & (length < NEAR[1] * l10)
    edges = np.quantile(length[near], np.linspace(0, 1, blocks + 1))
    block = np.searchsorted(edges, length[near])
    one_less = [_crossing(length[near][keep], truth[near][keep], v[near][keep], l10)
                for keep in (block != b for b in range(1, blocks + 1))]  # fmt: skip
    return l10, float(np.sqrt((blocks - 1) * np.var(one_less)))


def _crossing(length: NDArray, truth: NDArray, v: NDArray, start: float = 150.0) -> float:
    """From ``start`` down to shorter waves, until the loss fitted around one is 10 % there."""
    fine = np.linspace(*NEAR, 4001)
    for _ in range(40):
        near = (length > NEAR[0] * start) & (length < NEAR[1] * start)
        loss = _loss(start / length[near], truth[near], v[near], (2, 4, 6))
        above = np.flatnonzero(sum(c * fine**-n for n, c in loss.items()) > 0.1)
        before, start = start, start * (float(fine[above[-1]]) if len(above) else NEAR[0])
        if abs(start - before) < 1e-4 * start:
            break
    return start


def _l10_in_bands(length: NDArray, truth: NDArray, v: NDArray, parts: int = 10) -> tuple[float, float]:
    """The same of a response too steep for a series: the longest wave of which a band keeps less than 90 %.

    The standard error is a jackknife over stretches of the picture, in the order of its rows.
    """
    part = np.arange(len(v)) * parts // len(v)
    l10 = _crossing_in_bands(length, truth, v)
    one_less = [
        _crossing_in_bands(length[keep], truth[keep], v[keep]) for keep in (part != p for p in range(parts))
    ]
    return l10, float(np.sqrt((parts - 1) * np.var(one_less)))


def _crossing_in_bands(length: NDArray, truth: NDArray, v: NDArray) -> float:
    centres = np.log(LONG / 10) + np.arange(0, np.log(7), BAND_WIDTH / 3)
    order = np.argsort(length)
    sums = np.cumsum([truth[order] * v[order], truth[order] ** 2], axis=1)
    first, last = (
        np.searchsorted(np.log(length[order]), centres + side) for side in (-BAND_WIDTH / 2, BAND_WIDTH / 2)
    )
    kept, whole = sums[:, last - 1] - sums[:, np.maximum(first, 1) - 1]
    kept = kept / np.maximum(whole, 1e-9)
    low = int(np.flatnonzero(kept < 0.9)[-1])
    return float(np.exp(np.interp(0.9, kept[low : low + 2], centres[low : low + 2])))


def _loss(wave_number: NDArray, truth: NDArray, v: NDArray, powers: tuple[int, ...]) -> dict[int, float]:
    """Coefficients of what v has lost of the truth: an even transfer function, a short series."""
    basis = np.stack([truth * wave_number**n for n in powers], axis=1)
    return dict(zip(powers, np.linalg.lstsq(basis, truth - v, rcond=None)[0].tolist(), strict=True))


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
