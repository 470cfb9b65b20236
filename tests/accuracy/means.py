"""Means over ZOIs, from dense grids to ones that touch: scatter over noisy pairs against the predicted sigma."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from analysis import KernelSettings, PhaseKernel, Roi, ZoiGrid
from tests.accuracy.truth import Speckle, affine, digitise

SHAPE = (144, 176)
MARGIN, NOISE, BITS = 8, 0.01, 12
TURN = {"u": 0.3, "v": -0.2, "du_dx": 2e-3, "dv_dy": -1e-3, "du_dy": 5e-3, "dv_dx": -5e-3}
NAMES = ("exx", "eyy", "exy", "u")
CASES = [(32, step, 1, True) for step in (4, 8, 16, 32)]
CASES += [(32, 8, 2, True), (32, 16, 1, False), (64, 8, 1, True), (64, 16, 2, True)]
"""ZOI, step, order, whether the noise is given."""


def gauges(grid: ZoiGrid) -> dict[str, NDArray[np.bool_]]:
    """All ZOIs, a diamond, a row, and one ZOI."""
    rows, columns = grid.shape
    y, x = np.abs(np.arange(rows) - rows // 2), np.abs(np.arange(columns) - columns // 2)
    diamond = np.add.outer(y / max(rows, 1), x / max(columns, 1)) < 0.35
    row, one = np.zeros(grid.shape, bool), np.zeros(grid.shape, bool)
    row[rows // 2] = one[rows // 2, columns // 2] = True
    return {"all": np.ones(grid.shape, bool), "diamond": diamond, "row": row, "one": one}


def ratios(size: int, step: int, order: int, known: bool, pairs: int) -> NDArray[np.float64]:
    """Deviation over sigma, (pairs, gauges, names); both pictures of a pair drawn anew."""
    pattern, rng = Speckle(2.0, 1, span=400), np.random.default_rng(7)
    pictures = pattern.at(*affine(SHAPE)), pattern.at(*affine(SHAPE, **TURN))
    share = NOISE * (2**BITS - 1) if known else None
    inner = Roi(MARGIN, MARGIN, SHAPE[1] - 2 * MARGIN, SHAPE[0] - 2 * MARGIN)
    grid = ZoiGrid.cover(inner, size, step)
    masks = list(gauges(grid).values())
    found = []
    for _ in range(pairs):
        before, after = (digitise(picture, BITS, NOISE, rng) for picture in pictures)
        kernel = PhaseKernel(before, grid, KernelSettings(order=order), noise=share)
        field = kernel.measure(after, noise=share)
        found.append([[field.mean(name, mask) for name in NAMES] for mask in masks])
    values = np.array(found)
    deviation = values[..., 0] - values[..., 0].mean(axis=0)
    return np.asarray(deviation / values[..., 1] * np.sqrt(pairs / (pairs - 1)))


def table(quick: bool) -> Iterator[tuple[int, int, int, str, str, int, list[float]]]:
    """ZOI, step, order, noise, gauge, ZOIs in it, scatter over sigma of each of NAMES."""
    for size, step, order, known in CASES:
        z = ratios(size, step, order, known, 20 if quick else 1000)
        grid = ZoiGrid.cover(Roi(MARGIN, MARGIN, SHAPE[1] - 2 * MARGIN, SHAPE[0] - 2 * MARGIN), size, step)
        for (name, mask), part in zip(gauges(grid).items(), np.moveaxis(z, 1, 0), strict=True):
            spread = [float(s) for s in np.sqrt(np.mean(part**2, axis=0))]
            yield size, step, order, "given" if known else "found", name, int(mask.sum()), spread
