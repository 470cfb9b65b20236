"""The figures by differences of pixels are those of the filtered pattern, at less cost."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from analysis.field import Roi, ZoiGrid
from analysis.picture import autocorrelation_fwhm, filtered_pattern
from analysis.quality import speckle_radius, zoi_pattern
from analysis.quality.pattern import box_sums

HEIGHT, WIDTH = 300, 360


def scene(radius: float, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Speckle of contrast 38 GL in a slope of light, and all of it but a hole."""
    rng = np.random.default_rng(5)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    pattern = gaussian_filter(rng.normal(size=x.shape), radius)
    picture = 110 + 38 * pattern / pattern.std() + 30 * (x / WIDTH - 0.5)
    inside = np.hypot(x - 150, y - 160) > 40
    return (picture + rng.normal(0, noise, x.shape)).astype(np.float32), inside


@pytest.mark.parametrize("radius", [1.5, 2.0, 4.0])
@pytest.mark.parametrize("noise", [0.5, 4.0])
def test_as_the_filtered_pattern_has_it(radius: float, noise: float) -> None:
    picture, inside = scene(radius, noise)
    grid = ZoiGrid.cover(Roi(200, 10, 150, 280), 48, 16)
    found = zoi_pattern(picture, grid, noise)
    pattern = filtered_pattern(picture, noise, 5)
    for one, slope in ((found.along_x, pattern.grad_x), (found.along_y, pattern.grad_y)):
        np.testing.assert_allclose(one, box_sums(slope.astype(float) ** 2, grid), rtol=0.06)
    assert math.sqrt(np.median(found.variance)) == pytest.approx(38, rel=0.1)
    of_all = autocorrelation_fwhm(picture, noise) / (4 * math.sqrt(math.log(2)))
    picture[~inside] = 250
    width = speckle_radius(picture, noise, inside)
    assert width == pytest.approx(of_all, rel=0.03)
    assert width == pytest.approx(radius, rel=0.1)


@pytest.mark.parametrize(("size", "step"), [(48, 16), (47, 16), (20, 33)])
def test_sums_over_each_zoi(size: int, step: int) -> None:
    values = np.random.default_rng(0).normal(size=(HEIGHT, WIDTH)).astype(np.float32)
    grid = ZoiGrid.cover(Roi(7, 11, 320, 270), size, step)
    sums = box_sums(values, grid)
    for row, top in enumerate(grid.first_y):
        for column, left in enumerate(grid.first_x):
            part = values[top : top + size, left : left + size]
            assert sums[row, column] == pytest.approx(part.sum(dtype=np.float64), abs=1e-3)


def test_noise_alone_has_no_radius() -> None:
    noise = np.random.default_rng(0).normal(100, 2, (200, 200)).astype(np.float32)
    assert math.isnan(speckle_radius(noise, 2.2, np.ones(noise.shape, bool)))
