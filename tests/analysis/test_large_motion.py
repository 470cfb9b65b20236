"""Steps of 20 to 80 px a frame with strains to 20 %: found wherever the pattern stays in the picture."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis import PhaseKernel, Roi, ZoiGrid
from tests.accuracy.truth import Speckle, affine

SHAPE, MIDDLE = (400, 640), (199.5, 319.5)
NOISE_GL = 2.5
EDGES = 200.0, 440.0
"""Columns of the strip when nothing has moved."""
CLUTTER = Speckle(6.0, 9, span=900)
PATTERN = Speckle(2.0, 3, span=900)

Motion = tuple[float, float, float]
"""Steps of the middle (x, y), px, and the strain along y; across it the strip becomes narrower by 0.3 of that."""


@cache
def picture(motion: Motion, background: str, seed: int) -> NDArray[np.uint8]:
    """The strip over a background that stays where it is."""
    dx, dy, eyy = motion
    exx = -0.3 * eyy
    moved = {"u": dx, "v": dy, "du_dx": exx, "dv_dy": eyy}
    strip = PATTERN.at(*affine(SHAPE, **moved))
    behind = CLUTTER.at(*affine(SHAPE)) if background == "clutter" else np.zeros(SHAPE)
    x = (np.arange(SHAPE[1]) - MIDDLE[1] - dx) / (1 + exx) + MIDDLE[1]
    shown = np.where(
        (x > EDGES[0]) & (x < EDGES[1]), 120 + 40 * _standard(strip), 70 + 15 * _standard(behind)
    )
    noise = np.random.default_rng(seed).normal(0, NOISE_GL, SHAPE)
    return np.clip(np.rint(shown + noise), 0, 255).astype(np.uint8)


def _standard(image: NDArray[np.floating]) -> NDArray[np.floating]:
    return (image - image.mean()) / max(float(image.std()), 1e-9)


@pytest.mark.parametrize("background", [pytest.param("flat", marks=pytest.mark.slow), "clutter"])
@pytest.mark.parametrize("size", [32, 64])
@pytest.mark.parametrize("motion", [(-42, 0, 0), (20, 0, 0.2), (40, -30, 0.05), (0, 80, 0), (-56, 30, 0.1)])
def test_a_strip_that_leaps_is_found_again(background: str, size: int, motion: Motion) -> None:
    grid = ZoiGrid.cover(Roi(0, 0, SHAPE[1], SHAPE[0]), size, size // 2)
    kernel = PhaseKernel(picture((0, 0, 0), background, 0), grid, noise=NOISE_GL)
    start = kernel.measure(picture((0, 0, 0), background, 1), noise=NOISE_GL)
    field = kernel.measure(picture(motion, background, 2), start=start, noise=NOISE_GL)
    y, x = np.meshgrid(grid.y, grid.x, indexing="ij")
    dx, dy, eyy = motion
    u, v = dx - 0.3 * eyy * (x - MIDDLE[1]), dy + eyy * (y - MIDDLE[0])
    reach = 0.6 * size + 3
    there = (x - reach > EDGES[0]) & (x + reach < EDGES[1]) & (y - reach > 0) & (y + reach < SHAPE[0])
    stays = (
        (x + u - reach > 0) & (x + u + reach < SHAPE[1]) & (y + v - reach > 0) & (y + v + reach < SHAPE[0])
    )
    wanted = there & stays
    found = field.ok & (np.hypot(field.u - u, field.v - v) < 0.5)
    assert wanted.sum() > 10
    assert found[wanted].mean() >= 0.995
