"""The noise of means over overlapping ZOIs by value: summed up pixel by pixel."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from analysis import KernelSettings, PhaseKernel, Roi, StrainField, ZoiGrid
from analysis.field import Window
from analysis.field.uncertainty import variance_of_sum
from analysis.fit.moments import CHANNELS
from analysis.fit.sums import MONOMIALS, scatter, sum_of_squares
from analysis.kernel.images import continue_rim, padded, with_second_differences
from tests.analysis.speckle import picture

SIZE, STEP = 12, 5
GRID = ZoiGrid.cover(Roi(0, 0, SIZE + 5 * STEP, SIZE + 2 * STEP), SIZE, STEP)  # 3 rows, 6 columns
POWERS = {"u": [(0, 0)], "du_dx": [(1, 0)], "eyy": [(0, 1)], "exy": [(0, 1), (1, 0)]}
"""Powers of x and y that weigh the noise of a pixel, beside the window, in each parameter of a value."""


def pixel_by_pixel(window: Window, power: tuple[int, int], sigma: np.ndarray) -> float:
    """The variance of the sum of estimates that weigh the same white noise with x^p y^q and the window."""
    x = np.arange(SIZE) - (SIZE - 1) / 2
    weight = GRID.weights(window) * x ** power[0] * x[:, None] ** power[1]
    weight /= np.sqrt(np.sum(weight**2))
    total = np.zeros((GRID.roi.height, GRID.roi.width))
    for row, top in enumerate(GRID.first_y):
        for column, left in enumerate(GRID.first_x):
            total[top : top + SIZE, left : left + SIZE] += sigma[row, column] * weight
    return float(np.sum(total**2))


@pytest.mark.parametrize("window", ["gaussian", "uniform"])
@pytest.mark.parametrize("name", POWERS)
def test_the_variance_of_a_sum(name: str, window: Window) -> None:
    assert GRID.shape == (3, 6)
    sigma = np.random.default_rng(0).uniform(0.5, 2, GRID.shape)
    parts = [pixel_by_pixel(window, power, sigma) for power in POWERS[name]]
    assert variance_of_sum(sigma, name, GRID, window) == pytest.approx(np.mean(parts), rel=1e-9)


@pytest.mark.parametrize("name", ["u", "exx", "eyy"])
def test_the_sigma_of_a_mean_of_phases_is_that_of_the_overlap(name: str) -> None:
    """The phase estimator has no other prediction: sigma of each ZOI, correlated as the windows overlap."""
    grid = ZoiGrid.cover(Roi(40, 40, 80, 48), size=32, step=8)
    field = PhaseKernel(picture(), grid, KernelSettings(estimator="phase"), noise=4.0).measure(picture(u=0.3))
    assert field.ok.all() and grid.shape == (3, 7)
    expected = np.sqrt(variance_of_sum(field.sigma(name), name, grid, field.window)) / grid.n_active
    assert field.mean(name)[1] == pytest.approx(expected, rel=1e-9)
    alone = np.sqrt(np.sum(field.sigma(name) ** 2)) / grid.n_active
    assert name != "u" or field.mean(name)[1] > 1.5 * alone


def test_a_mean_over_some_leaves_the_others_out() -> None:
    values = np.arange(18.0).reshape(GRID.shape)
    field = StrainField.from_values(GRID, {"u": values}, 0.1)
    some = np.zeros(GRID.shape, bool)
    some[1, 2:5] = True
    mean, sigma = field.mean("u", some)
    assert mean == pytest.approx(9.0)
    assert sigma == pytest.approx(
        np.sqrt(variance_of_sum(np.where(some, 0.1, 0.0), "u", GRID, field.window)) / 3
    )


@pytest.mark.parametrize("shift", range(8))
def test_the_sum_of_squares_has_the_same_bits_wherever_it_is_in_memory(shift: int) -> None:
    image = np.random.default_rng(1).normal(0, 1, (47, 333))
    moved = np.empty(image.size + 8)[shift : shift + image.size].reshape(image.shape)
    moved[:] = image
    assert sum_of_squares(moved) == sum_of_squares(image) == pytest.approx(np.sum(image**2), rel=1e-14)


def test_the_pattern_of_the_zois_of_a_mean_decides_its_noise() -> None:
    class Pattern:
        """Twice the noise of the overlap where row 1 is measured alone."""

        @staticmethod
        def factor(_: str, gauge: np.ndarray) -> float:
            return 2.0 if gauge[1].all() and gauge.sum() == 6 else 1.0

    plain = StrainField.from_values(GRID, {"u": np.zeros(GRID.shape)}, 0.1)
    field = dataclasses.replace(plain, sums=Pattern())  # type: ignore[arg-type]
    row = np.zeros(GRID.shape, bool)
    row[1] = True
    assert field.mean("u", row)[1] == pytest.approx(2 * plain.mean("u", row)[1])
    assert field.mean("u")[1] == pytest.approx(plain.mean("u")[1])


def test_what_a_zoi_takes_of_each_pixel_is_the_sum_of_its_channels_and_monomials() -> None:
    rng, size, at = np.random.default_rng(5), 8, (3, 2)
    images = padded(*rng.normal(size=(4, 14, 13)).astype(np.float32))
    continue_rim(images, 2, (14, 13))
    weights = np.zeros((1, CHANNELS, len(MONOMIALS)))
    weights[0, :2] = rng.normal(size=(2, len(MONOMIALS)))
    weights[0, 2:4, :3] = rng.normal(size=(2, 3))
    weights[0, 4:, 0] = rng.normal(size=CHANNELS - 4)
    line, along = rng.random(size), np.linspace(-1, 1, size)
    out = np.zeros((size, size))
    flat, samples, pitch = images.reshape(-1), images[0].size, images.shape[2]
    scatter(flat, samples, pitch, np.array([at]), weights, line, along, np.array(at), out)
    place = np.s_[at[0] : at[0] + size, at[1] : at[1] + size]
    second = with_second_differences(images)[4:]
    channels = [images[0], images[1], images[2], np.ones_like(images[0]), *second]
    eta, xi = np.meshgrid(along, along, indexing="ij")
    expected = np.zeros((size, size))
    for channel, weight in zip(channels, weights[0], strict=True):
        for (x, y), share in zip(MONOMIALS, weight, strict=True):
            expected += np.outer(line, line) * share * channel[place] * xi**x * eta**y
    assert out == pytest.approx(expected, abs=1e-5)
