"""Blur since the reference: what it does to no strain, its width by value, and the bias that noise would leave."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis import KernelSettings, PhaseKernel, Roi, StrainField, ZoiGrid
from analysis.field import blur_maps, mean_blur
from analysis.field.part import Blur, widths
from analysis.kernel.images import continue_rim, padded, with_second_differences
from analysis.picture.spectrum import filtered_pattern
from tests.accuracy.truth import Speckle, affine, digitise

SHAPE = (184, 200)
NOISE = 0.005
NOISE_GL = NOISE * 4095
ESTIMATORS = ("spectral", "phase")
STRAINED = {"u": 0.3, "v": -0.2, "du_dx": 1e-3, "dv_dy": -3e-4}


def level(blur: float = 0.0, **motion: float) -> np.ndarray:
    return Speckle(2.0, 3, 400, blur).at(*affine(SHAPE, **motion))


def smeared(length: float, **motion: float) -> np.ndarray:
    """The mean over an exposure in which the picture moves ``length`` px along x."""
    places = length * (np.arange(24) + 0.5) / 24 - length / 2
    return np.mean(
        [Speckle(2.0, 3, 400).at(x - s, y) for x, y in [affine(SHAPE, **motion)] for s in places], axis=0
    )


def measured(before: np.ndarray, after: np.ndarray, size: int, estimator: str = "spectral") -> StrainField:
    rng = np.random.default_rng(2)
    grid = ZoiGrid.cover(Roi(8, 8, SHAPE[1] - 16, SHAPE[0] - 16), size, size // 4)
    first, second = (digitise(picture, 12, NOISE, rng) for picture in (before, after))
    kernel = PhaseKernel(first, grid, KernelSettings(estimator=estimator), noise=NOISE_GL)  # type: ignore[arg-type]
    return kernel.measure(second, noise=NOISE_GL)


def excess(field: StrainField, **truth: float) -> dict[str, float]:
    """How far the mean strains are from the truth beyond three of their sigmas."""
    means = {name: field.mean(name) for name in ("exx", "eyy", "exy")}
    wanted = {"exx": truth.get("du_dx", 0.0), "eyy": truth.get("dv_dy", 0.0), "exy": 0.0}
    return {name: abs(value - wanted[name]) - 3 * sigma for name, (value, sigma) in means.items()}


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("size", [32, 64])
@pytest.mark.parametrize(("first", "second"), [(0.0, 0.5), (0.5, 0.0)])
def test_a_change_of_sharpness_is_no_strain(size: int, estimator: str, first: float, second: float) -> None:
    """Without the second derivatives of the reference in the fit this is -40 to -600 um/m."""
    field = measured(level(first), level(second), size, estimator)
    assert field.ok.mean() > 0.99
    assert max(excess(field).values()) < 30e-6, excess(field)
    scatter = np.sqrt(np.nanmean(field.exx**2) / np.nanmean(field.sigma_exx**2))
    assert scatter < 1.3
    blur = mean_blur(field)
    assert blur.px == pytest.approx(second - first, abs=0.06) and blur.sigma < 0.01
    assert blur.text.startswith("less sharp by 0." if second > first else "sharper by 0.")


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_motion_during_the_exposure_is_no_strain(estimator: str) -> None:
    field = measured(level(), smeared(3.0, **STRAINED), 64, estimator)
    assert max(excess(field, **STRAINED).values()) < 60e-6, excess(field, **STRAINED)


def test_the_uncertainty_of_the_blur_is_its_scatter() -> None:
    rng = np.random.default_rng(5)
    grid = ZoiGrid.cover(Roi(8, 8, 184, 168), 32, 16)
    kernel = PhaseKernel(digitise(level(), 12, NOISE, rng), grid, noise=NOISE_GL)
    pictures = (digitise(level(0.4), 12, NOISE, rng) for _ in range(60))
    fields = [kernel.measure(picture, noise=NOISE_GL) for picture in pictures]
    variances = np.array([field.blur[0] for field in fields])  # type: ignore[index]
    # The noise of the reference is common to all, half of the variance.
    assert np.sqrt(variances.var(axis=0, ddof=1).mean() * 2) == pytest.approx(
        float(np.sqrt(np.mean(fields[0].blur[1] ** 2))),
        rel=0.1,  # type: ignore[index]
    )
    means = [mean_blur(field) for field in fields]
    scatter = np.std([one.px for one in means], ddof=1) * np.sqrt(2)
    assert scatter == pytest.approx(means[0].sigma, rel=0.4)


def test_a_picture_against_itself_has_neither_blur_nor_strain() -> None:
    """What noise adds on average is not taken off where the noise of both is the same."""
    image = digitise(level(), 12, NOISE, np.random.default_rng(1))
    field = PhaseKernel(image, ZoiGrid.cover(Roi(8, 8, 184, 168), 32, 16), noise=NOISE_GL).measure(image)
    assert np.nanmax(np.abs(field.parameters)) < 1e-5
    assert field.blur is not None and np.nanmax(np.abs(field.blur[0])) < 1e-4


def test_a_width_is_the_signed_root_of_a_variance() -> None:
    px, sigma = widths(np.array([0.25, -0.16, 0.0]), np.array([0.05, 0.0, 0.04]))
    assert px == pytest.approx([0.5, -0.4, 0.0])
    assert sigma == pytest.approx([(np.sqrt(0.30) - np.sqrt(0.20)) / 2, 0.0, 0.2])


@pytest.mark.parametrize(
    ("px", "words"),
    [(0.414, "less sharp by 0.41 ± 0.02 px"), (-0.306, "sharper by 0.31 ± 0.02 px"), (np.nan, "")],
)
def test_a_blur_in_words(px: float, words: str) -> None:
    assert Blur(px, 0.021).text == words


def test_the_mean_blur_is_that_of_the_mean_variance_of_valid_zois() -> None:
    """Four of five ZOIs side by side, each with 0.09 px^2 and a sigma of 0.02 px^2."""
    grid = ZoiGrid.cover(Roi(0, 0, 160, 32), 32, 32)
    variance = np.array([[[0.05, 0.07, 0.11, 0.13, 9.0]], [[0.02, 0.02, 0.02, 0.02, 9.0]]], np.float32)
    field = StrainField.from_values(grid, {}, status=[[0, 0, 0, 0, 5]])
    found = mean_blur(replace(field, blur=variance))
    assert found.px == pytest.approx(0.3)
    assert found.sigma == pytest.approx((np.sqrt(0.10) - np.sqrt(0.08)) / 2, rel=1e-5)


def test_a_field_that_was_read_has_no_blur() -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 64, 48), 32, 16)
    field = StrainField.from_values(grid, {})
    assert np.isnan(mean_blur(field).px) and mean_blur(field).text == ""
    assert all(np.isnan(one).all() and one.shape == grid.shape for one in blur_maps(field))


def test_second_differences_up_to_the_edge() -> None:
    rng = np.random.default_rng(0)
    for shape in ((9, 14), (8, 15), (5, 30)):
        planes = rng.normal(size=(4, *shape)).astype(np.float32)
        images = padded(*planes)
        continue_rim(images, 2, shape)
        height, width = shape
        assert np.array_equal(images[:, :height, :width], planes)
        f = np.pad(planes[2], 1, mode="edge").astype(float)
        expected = [
            f[1:-1, 2:] + f[1:-1, :-2] - 2 * f[1:-1, 1:-1],
            f[2:, 1:-1] + f[:-2, 1:-1] - 2 * f[1:-1, 1:-1],
            (f[2:, 2:] + f[:-2, :-2] - f[2:, :-2] - f[:-2, 2:]) / 4,
        ]
        assert with_second_differences(images)[4:, :height, :width] == pytest.approx(
            np.array(expected), abs=1e-5
        )


def test_own_noise_is_what_a_pixel_puts_into_the_filtered_picture() -> None:
    """From the response of the filter to noise: the covariance of f, f_xx and f_yy with the noise of their pixel.

    And the variance of what it makes of noise alone.
    """
    rng, pattern, found, count = np.random.default_rng(3), 40 * (level() - 0.5) / 0.18, np.zeros(3), 12
    left = 0.0
    for _ in range(count):
        noise = rng.normal(0, 4, SHAPE)
        made_of = []
        for sign in (1, -1):  # both, so that the pattern has no part in it
            made = filtered_pattern((pattern + sign * noise).astype(np.float32), 4.0, 5)
            images = padded(made.grad_x, made.grad_y, made.level, made.level)
            continue_rim(images, 2, SHAPE)
            second = with_second_differences(images)[4:6, : SHAPE[0], : SHAPE[1]]
            found += [np.mean(one * sign * noise) / 16 / (2 * count) for one in (made.level, *second)]
            made_of.append(made.level)
        left += np.mean((made_of[0] - made_of[1]) ** 2) / 4 / 16 / count
    assert found == pytest.approx(made.own_noise, rel=0.05)
    assert left == pytest.approx(made.left_level, rel=0.05)


@pytest.mark.slow
def test_noise_of_the_reference_leaves_no_bias() -> None:
    """Single frames with much noise: without the correction the mean is -630 +- 40 um/m."""
    rng = np.random.default_rng(8)
    grid, noise, clean = ZoiGrid.cover(Roi(8, 8, 184, 168), 32, 8), 6.0, 20 * (level() - 0.5) / 0.18 + 100
    means = []
    for _ in range(40):
        first, second = (clean + rng.normal(0, noise, (2, *SHAPE))).astype(np.float32)
        field = PhaseKernel(first, grid, noise=noise).measure(second, noise=noise)
        means.append([field.mean(name)[0] for name in ("exx", "eyy")])
    mean, error = np.mean(means), np.std(means, ddof=1) / np.sqrt(np.size(means))
    assert abs(mean) < 3 * error + 0.3 * np.std(means), (mean, error)
