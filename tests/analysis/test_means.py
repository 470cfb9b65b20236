"""Errors in common by value: means over overlapping ZOIs, of pictures, and of a motion during the burst."""

from __future__ import annotations

import numpy as np
import pytest

from analysis import KernelSettings, PhaseKernel, Roi, ZoiGrid
from analysis.evaluate import AreaStrain
from analysis.field import StrainField, Window
from analysis.field.uncertainty import CommonError, PictureError, variance_of_sum
from analysis.fit.moments import CHANNELS
from analysis.fit.sums import MONOMIALS, squares
from analysis.kernel.images import continue_rim, padded, with_second_differences
from analysis.optics import BurstMotion
from tests.analysis.speckle import picture
from tests.live.made_up import START, make_grid

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


def test_what_zois_take_of_each_pixel_is_the_sum_of_their_channels_and_monomials() -> None:
    """Of two that overlap; the squares of their sum are added row by row."""
    rng, size, origins = np.random.default_rng(5), 8, np.array([(3, 2), (5, 4)])
    images = padded(*rng.normal(size=(4, 14, 13)).astype(np.float32))
    continue_rim(images, 2, (14, 13))
    weights = np.zeros((2, CHANNELS, len(MONOMIALS)))
    weights[:, :2] = rng.normal(size=(2, 2, len(MONOMIALS)))
    weights[:, 2:4, :3] = rng.normal(size=(2, 2, 3))
    weights[:, 4:, 0] = rng.normal(size=(2, CHANNELS - 4))
    line, along, rows = rng.random(size), np.linspace(-1, 1, size), np.empty(10)
    flat, samples, pitch = images.reshape(-1), images[0].size, images.shape[2]
    squares(flat, samples, pitch, origins, weights, line, along, origins[0], 10, rows)
    second = with_second_differences(images)[4:]
    channels = [images[0], images[1], images[2], np.ones_like(images[0]), *second]
    eta, xi = np.meshgrid(along, along, indexing="ij")
    taken = np.zeros((14, 13))
    for (row, column), of_zoi in zip(origins, weights, strict=True):
        place = np.s_[row : row + size, column : column + size]
        for channel, weight in zip(channels, of_zoi, strict=True):
            for (x, y), share in zip(MONOMIALS, weight, strict=True):
                taken[place] += np.outer(line, line) * share * channel[place] * xi**x * eta**y
    assert rows == pytest.approx((taken[3:13] ** 2).sum(axis=1), rel=1e-5)


OVERLAPPING = ZoiGrid.cover(Roi(0, 0, 96, 64), 32, 16)
RNG = np.random.default_rng(4)


def error(count: int) -> CommonError:
    half = RNG.normal(0, 1, (count, count))
    return CommonError(RNG.normal(0, 1, (count, 6, *OVERLAPPING.shape)), half @ half.T)


def test_two_errors_beside_each_other_add_their_variances() -> None:
    one, other = error(2), error(3)
    both = one.beside(other)
    for name in ("u", "dv_dy", "exy"):
        assert both.variance(name) == pytest.approx(one.variance(name) + other.variance(name))
    weights = RNG.normal(0, 1, (6, *OVERLAPPING.shape))
    assert both.variance_of_sum(weights) == pytest.approx(
        one.variance_of_sum(weights) + other.variance_of_sum(weights)
    )
    assert one.beside(None) is one


@pytest.mark.parametrize("colour", [(4.0, 1.0), (1.0, 4.0)])
def test_the_factor_of_a_picture_is_that_of_the_worse_of_u_and_v(colour: tuple[float, float]) -> None:
    assert PictureError(1.5, colour).factor == pytest.approx(3.0)


MADE_UP, RATE, PERIOD = make_grid(), 2e-4, 0.4
SIGMA = 1e-8


def measured(strain: float, sigma: float = SIGMA, large: float = 3.0) -> StrainField:
    """Uniaxial, in one column of ZOIs ``large`` times as much, as beside a hole."""
    x, y = np.meshgrid(MADE_UP.x, MADE_UP.y)
    here = strain * np.where(np.arange(MADE_UP.shape[1]) == 2, large, 1.0)
    values = {"u": -0.3 * here * x, "v": here * y, "du_dx": -0.3 * here, "dv_dy": here + 0 * y}
    return StrainField.from_values(MADE_UP, values, sigma)


def sigmas(strains: list[float], duration: float, sigma: float = SIGMA, large: float = 1.0) -> list[float]:
    """Of eyy of the region, of bursts of these mean strains."""
    motion, found = BurstMotion(), []
    for k, strain in enumerate(strains):
        field = motion.apply(measured(strain, sigma, large), START + PERIOD * k, duration)
        area = AreaStrain.of(field)
        assert area is not None
        found.append(area.sigma("eyy"))
    return found


def of_frames(begins: float, k: int, frames: int = 4) -> tuple[float, float]:
    """The mean strain of the frames of the k-th burst, and that at its time; the pull begins at a time."""
    times = PERIOD * k + (np.arange(frames) - (frames - 1) / 2) * PERIOD / frames
    return float(RATE * np.maximum(times - begins, 0).mean()), RATE * max(PERIOD * k - begins, 0.0)


@pytest.mark.parametrize("begins", np.arange(1.05, 1.5, 0.05))
def test_where_a_pull_begins_the_error_is_within_the_uncertainty(begins: float) -> None:
    """Bursts of 0.4 s, in which the strain grows by 78 um/m: up to 8 um/m off, with a noise of hundredths of it."""
    pairs = [of_frames(float(begins), k) for k in range(8)]
    found = sigmas([mean for mean, _ in pairs], 0.3)
    for (mean, true), sigma in zip(pairs, found, strict=True):
        assert abs(mean - true) <= 1.05 * sigma + 1e-7
    alone = sigmas([0.0], 0.3)[0]
    assert found[:2] == pytest.approx([alone] * 2) and found[-2:] == pytest.approx([alone] * 2)


def test_without_it_the_interval_would_be_too_small() -> None:
    mean, true = of_frames(1.2, 3)
    assert mean - true > 5e-6 > 100 * sigmas([0.0], 0.3)[0]


def test_each_zoi_has_its_own_share_of_it() -> None:
    motion = BurstMotion()
    for k, strain in enumerate((0.0, 0.0, 1e-5)):
        field = motion.apply(measured(strain), START + PERIOD * k, 0.3)
    found = field.sigma("eyy")
    assert found[2, 2] == pytest.approx(3e-5, rel=0.01) and found[2, 1] == pytest.approx(1e-5, rel=0.01)


@pytest.mark.parametrize("duration", [0.0, 0.3])
def test_a_single_frame_and_a_steady_pull_have_nothing_added(duration: float) -> None:
    steady, alone = [RATE * PERIOD * k for k in range(6)], sigmas([0.0], duration)[0]
    assert sigmas(steady, duration) == pytest.approx([alone] * 6)
    begun = [0.0, 0.0, 0.0, *steady]
    assert (max(sigmas(begun, duration)) > 5 * alone) is (duration > 0)


def test_noise_is_no_motion() -> None:
    rng, sigma = np.random.default_rng(1), 1e-5
    area = sigmas([0.0], 0.3, sigma)[0]
    found = np.array(sigmas(list(area * rng.standard_normal(300)), 0.3, sigma))
    assert np.sqrt(np.mean(found**2)) < 1.05 * area and np.mean(found > 1.001 * area) < 0.02
