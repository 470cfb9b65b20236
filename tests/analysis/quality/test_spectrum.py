"""Frequencies, mains, and where a pattern ends in its spectrum, by value."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from analysis.field import Roi, ZoiGrid
from analysis.picture.pattern import autocorrelation_fwhm, describe_pattern, predicted_sigma
from analysis.quality.pattern import _half_width, zoi_pattern
from analysis.quality.specimen import find_specimen
from analysis.quality.steadiness import Steadiness, mains_of, steadiness


def test_steadiness_of_eight_values_and_none_of_seven() -> None:
    times, values = np.arange(8) / 10, np.array([1.0, 3, 2, 5, 4, 6, 5, 8])
    found = steadiness(times, values, noise=0.25)
    slope, offset = np.polyfit(times, values, 1)
    rest = values - slope * times - offset
    assert found.rms == pytest.approx(math.sqrt(float(rest @ rest) / 6))
    assert (found.drift, found.seconds) == (pytest.approx(slope * 0.7), pytest.approx(0.7))
    assert found.noise == 0.25 and found.rate == pytest.approx(10)
    few = steadiness(times[:7], values[:7], noise=0.25)
    assert math.isnan(few.rms) and math.isnan(few.drift) and few.rate is None and few.noise == 0.25
    gap = np.append(values, math.nan)
    assert steadiness(np.append(times, 0.8), gap).rms == found.rms


@pytest.mark.parametrize(("frequency", "shown"), [(0.9, 0.9), (14.2, 14.2), (20.0, 10.0), (29.0, 1.0)])
def test_a_frequency_is_sought_up_to_half_the_rate(frequency: float, shown: float) -> None:
    """Thirty a second, with one gap of a second: the rate is the usual one."""
    times = np.arange(120) / 30
    times[60:] += 1.0
    found = steadiness(times, np.sin(2 * np.pi * frequency * times))
    assert found.frequency == pytest.approx(shown, abs=0.06) and found.rate == pytest.approx(30)


@pytest.mark.parametrize(
    ("frequency", "harmonic", "mains"),
    [(10.37, 2, 50.0), (10.4, 2, None), (9.63, 2, 50.0), (0.3, 2, 60.0), (10.2, 1, 50.0), (5.0, 1, None)],
)
def test_mains_within_three_quarters_of_what_a_series_resolves(
    frequency: float, harmonic: int, mains: float | None
) -> None:
    """Of two seconds, 0.375 Hz; at thirty a second 50 and 100 Hz show at 10, 60 and 120 Hz at 0 Hz."""
    assert mains_of(Steadiness(0, 1, 0, frequency, 2.0, 30.0), harmonic) == mains


def test_the_band_ends_where_the_power_is_twice_that_of_the_noise() -> None:
    """White noise of 100 GL under a Gaussian of 1 px: 100^2 exp(-4 pi^2 k^2), beside a noise of 5 GL."""
    rng = np.random.default_rng(3)
    pattern = gaussian_filter(rng.normal(0, 100, (500, 600)), 1.0, mode="wrap")
    report = describe_pattern(pattern + rng.normal(0, 5, pattern.shape), noise=5.0)
    assert report.band == pytest.approx(math.sqrt(math.log(100**2 / 5**2)) / 2 / math.pi, abs=0.012)
    assert report.contrast == pytest.approx(pattern.std(), rel=4e-3)
    assert report.predicted_sigma(48) == predicted_sigma(48, 5.0, report.gradient)
    assert report.predicted_sigma(48, 2.0) == predicted_sigma(48, 2.0, report.gradient)
    assert math.isnan(report.clipped)


def test_a_line_stands_out_of_noise_a_little_weaker() -> None:
    times = np.arange(60) / 30
    noise = np.random.default_rng(3).normal(0, 1, 60)
    found = steadiness(times, 1.3 * np.sin(2 * np.pi * 7 * times) + noise)
    assert found.frequency == pytest.approx(7, abs=0.3)


def test_noise_alone_has_neither_contrast_nor_gradient() -> None:
    picture = np.random.default_rng(1).normal(100, 10, (300, 320)).astype(np.float32)
    found = zoi_pattern(picture, ZoiGrid.cover(Roi(10, 10, 300, 280), 32, 32), 10.0)
    assert np.median(found.variance) < 5
    of_noise = 32**2 * 100 * 2 * (0.75**2 + 0.15**2 + 1 / 60**2)
    assert max(np.median(found.along_x), np.median(found.along_y)) < 0.1 * of_noise


def test_the_half_width_lies_where_the_logarithm_over_the_squared_lag_has_it() -> None:
    """Of 1, 0.8 and 0.4 it is between the last two; the first has the noise beside."""
    share = math.log(0.8 / 0.5) / math.log(0.8 / 0.4)
    expected = math.sqrt(1 + share * 3)
    assert _half_width(iter([10.0, 8.0, 4.0, 1.0]), 0.0) == pytest.approx(expected)
    assert _half_width(iter([14.0, 8.0, 4.0, 1.0]), 2.0) == pytest.approx(expected)
    checkered = math.sqrt(math.log(2) / math.log(1e6))  # it is negative at once
    assert _half_width(iter([4.0, -4.0]), 0.0) == pytest.approx(checkered)
    board = 100 + 20 * (-1.0) ** np.add.outer(np.arange(64), np.arange(64))
    assert autocorrelation_fwhm(board) == pytest.approx(2 * checkered, rel=0.02)
    assert math.isnan(_half_width(iter([4.0, 3.0]), 2.0)) and math.isnan(_half_width(iter([4.0, 3.0]), 0.0))


def test_a_larger_pattern_that_is_much_fainter_is_no_specimen() -> None:
    """Of a thirteenth of the contrast, far above the noise: a sixteenth of the quality is needed, it has a 180th."""
    rng = np.random.default_rng(2)
    speckle = gaussian_filter(rng.normal(size=(300, 520)), 2)
    speckle /= speckle.std()
    picture = np.full((300, 520), 100.0)
    picture[40:240, 20:200] += 40 * speckle[40:240, 20:200]
    picture[20:280, 230:500] += 3 * speckle[20:280, 230:500]
    found = find_specimen(picture + rng.normal(0, 0.3, picture.shape), 0.3)
    assert found is not None and not found.mask[:, 220:].any()
    assert abs(found.box.x - 20) < 12 and abs(found.box.width - 180) < 16


def test_a_long_picture_has_the_speckle_of_the_same_one_turned() -> None:
    picture = gaussian_filter(np.random.default_rng(4).normal(size=(64, 400)), 1.0)
    found = autocorrelation_fwhm(picture)
    assert found == pytest.approx(autocorrelation_fwhm(picture.T), rel=1e-9)
    assert found == pytest.approx(4 * math.sqrt(math.log(2)), rel=0.15)
