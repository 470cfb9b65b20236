"""The noise of means over ZOIs: what is said of it against how they scatter."""

from __future__ import annotations

import numpy as np
import pytest

from analysis import KernelSettings, PhaseKernel, Roi, ZoiGrid
from tests.accuracy.truth import Speckle, affine

NOISE_GL = 2.5
PAIRS = 240
NAMES = ("exx", "eyy", "exy", "u")


def scatter_over_said(
    size: int, step: int, count: int, order: int, noise: float | None, where: np.ndarray | None = None
) -> dict[str, float]:
    """Root mean square of means of a still picture over their own uncertainty, new noise in both pictures."""
    side = size + step * (count - 1) + 16
    pattern = Speckle(2.0, 5, span=side + 60).at(*affine((side, side)))
    clean = 128 + 40 * (pattern - pattern.mean()) / pattern.std()
    grid = ZoiGrid.cover(Roi(8, 8, side - 16, side - 16), size, step)
    rng = np.random.default_rng(size + step)
    ratios: dict[str, list[float]] = {name: [] for name in NAMES}
    for _ in range(PAIRS // 8):
        first = (clean + rng.normal(0, NOISE_GL, clean.shape)).astype(np.float32)
        kernel = PhaseKernel(first, grid, KernelSettings(order=order), noise=noise)
        start = kernel.measure(first, noise=noise)
        for _ in range(8):
            second = (clean + rng.normal(0, NOISE_GL, clean.shape)).astype(np.float32)
            field = kernel.measure(second, start=start, noise=noise)
            for name in NAMES:
                value, sigma = field.mean(name, where)
                ratios[name].append(value / sigma)
    return {name: float(np.sqrt(np.mean(np.square(found)))) for name, found in ratios.items()}


@pytest.mark.parametrize(
    ("size", "step", "count", "order", "noise"),
    [
        (32, 4, 17, 1, NOISE_GL), (32, 8, 13, 1, NOISE_GL), (32, 8, 13, 1, None), (32, 16, 7, 1, NOISE_GL),
        (48, 12, 9, 2, NOISE_GL),
    ],
)  # fmt: skip
def test_means_scatter_as_said(size: int, step: int, count: int, order: int, noise: float | None) -> None:
    """Eight pictures share a reference, so a ratio is known to about 8 %; by overlap alone it would be 1.3 to 1.5."""
    found = scatter_over_said(size, step, count, order, noise)
    assert all(0.8 < ratio < 1.22 for ratio in found.values()), found
    assert 0.87 < np.mean([found[name] for name in ("exx", "eyy", "exy")]) < 1.13, found


def test_a_gauge_of_any_shape() -> None:
    where = np.add.outer(np.abs(np.arange(13) - 6), np.abs(np.arange(13) - 6)) <= 5
    found = scatter_over_said(32, 8, 13, 1, NOISE_GL, where)
    assert 0.87 < np.mean([found[name] for name in ("exx", "eyy", "exy")]) < 1.13, found


def test_dense_grids_are_not_more_certain_than_they_are() -> None:
    """The same region with more ZOIs in it tells hardly more of its mean."""
    image = np.asarray(128 + 12 * Speckle(2.0, 5, span=300).at(*affine((160, 160))), np.float32)
    sigmas = []
    for step in (4, 8):
        kernel = PhaseKernel(image, ZoiGrid.cover(Roi(8, 8, 128, 128), 32, step), noise=1.0)
        sigmas.append(kernel.measure(image, noise=1.0).mean("eyy")[1])
    assert sigmas[0] > 0.9 * sigmas[1], sigmas


def test_what_was_asked_once_is_remembered_within_bounds() -> None:
    image = np.asarray(128 + 12 * Speckle(2.0, 5, span=300).at(*affine((160, 160))), np.float32)
    grid = ZoiGrid.cover(Roi(8, 8, 128, 128), 32, 16)
    sums = PhaseKernel(image, grid, noise=1.0).reference.sums
    assert sums is not None
    rng = np.random.default_rng(0)
    masks = [rng.random(grid.shape) < 0.5 for _ in range(100)]
    once = [sums.factor("exx", mask) for mask in masks]
    assert once == [sums.factor("exx", mask) for mask in masks]
    assert len(sums._known) <= 64
    single = np.zeros(grid.shape, bool)
    single[2, 2] = True
    assert sums.factor("exx", single) == 1.0


def test_the_estimator_by_phases_has_the_overlap_alone() -> None:
    image = np.asarray(128 + 12 * Speckle(2.0, 5, span=300).at(*affine((160, 160))), np.float32)
    grid = ZoiGrid.cover(Roi(8, 8, 128, 128), 32, 32)
    kernel = PhaseKernel(image, grid, KernelSettings(estimator="phase"), noise=1.0)
    assert kernel.reference.sums is None
    assert kernel.measure(image, noise=1.0).mean("exx")[1] > 0
