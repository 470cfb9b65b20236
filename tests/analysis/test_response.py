"""Lines of places over all instants, and where places leave them, against a synthetic truth."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.evaluate.response import NOT_USED, Departures, ResponseSums

Array = NDArray[np.float64]
SLOPE, SIGMA, REFERENCE = 14.3, 75.0, 30.0  # um/m per MPa; um/m of one instant, and of the reference
MPA = np.linspace(2.0, 130.0, 68)


def measured(truth: Array, seed: int = 0, reference: float = REFERENCE, sigma: float = SIGMA) -> Array:
    """Values (K, N) with noise of each instant and, common to all of them, that of the reference."""
    rng = np.random.default_rng(seed)
    return truth + rng.normal(0, reference, truth.shape[1]) + rng.normal(0, sigma, truth.shape)


def sums_of(x: Array, y: Array, sigma: float = SIGMA, reference: int = 0) -> ResponseSums:
    sums = ResponseSums()
    for one, values in zip(x, y, strict=True):
        sums += ResponseSums.of(one, values, np.full(values.shape, sigma), reference)
    return sums


def departures(x: Array, y: Array, sigma: float = SIGMA) -> Departures:
    found = Departures(y.shape[1:], len(x))
    for one, values in zip(x, y, strict=True):
        found.add(one, values, np.full(values.shape, sigma))
    return found


def knee(x: Array, n: int, at: float = 140.0) -> Array:
    return np.repeat((SLOPE * x + 60 * np.maximum(x - at, 0))[:, None], n, axis=1)


def test_a_line_is_found_exactly() -> None:
    lines = sums_of(MPA, np.stack([3 + 2 * MPA, -1 - MPA], axis=1)).lines()
    assert lines.slope == pytest.approx([2, -1], rel=1e-9)
    assert lines.intercept() == pytest.approx([3, -1], abs=1e-6)
    assert lines.chi2 == pytest.approx(0, abs=1e-6)
    spread = np.sum((MPA - MPA.mean()) ** 2)
    assert lines.sigma == pytest.approx(SIGMA / np.sqrt(spread), rel=1e-9)
    value, variance = lines.at(200.0)
    assert value == pytest.approx([403, -201])
    expected = SIGMA**2 * (1 / len(MPA) + (200 - MPA.mean()) ** 2 / spread)
    assert variance == pytest.approx(expected, rel=1e-9)


def test_parts_add_up_in_any_order() -> None:
    y = measured(SLOPE * MPA[:, None] * np.ones(50))
    whole, first, second = sums_of(MPA, y), sums_of(MPA[:20], y[:20]), sums_of(MPA[20:], y[20:])
    for sums in (first + second, second + first):
        assert sums.lines().slope == pytest.approx(whole.lines().slope, rel=1e-9)
        assert sums.lines().sigma == pytest.approx(whole.lines().sigma, rel=1e-9)
        assert sums.lines().chi2 == pytest.approx(whole.lines().chi2, rel=1e-6)


def test_the_noise_of_the_reference_is_not_in_the_slope() -> None:
    lines = sums_of(MPA, measured(SLOPE * MPA[:, None] * np.ones(20_000), reference=500.0)).lines()
    off = np.abs(lines.slope - SLOPE) / lines.sigma
    assert 0.66 < np.mean(off < 1) < 0.70
    assert 0.94 < np.mean(off < 2) < 0.96
    assert np.mean(lines.chi2) == pytest.approx(1, abs=0.01)


def test_each_reference_has_its_own_intercept() -> None:
    y = measured(SLOPE * MPA[:, None] * np.ones(20_000))
    later = y[40:] + np.random.default_rng(1).normal(0, 400, y.shape[1])
    sums = sums_of(MPA[:40], y[:40]) + sums_of(MPA[40:], later, reference=1)
    lines = sums.lines()
    off = np.abs(lines.slope - SLOPE) / lines.sigma
    assert 0.66 < np.mean(off < 1) < 0.70
    assert 0.94 < np.mean(off < 2) < 0.96
    assert np.mean(lines.chi2) == pytest.approx(1, abs=0.01)
    assert np.std(lines.intercept(1) - lines.intercept(0)) == pytest.approx(400, rel=0.1)


def test_places_without_a_value_have_no_weight() -> None:
    y = np.repeat((SLOPE * MPA)[:, None], 4, axis=1)
    y[::2, 1], y[:, 2], y[3:, 3] = np.nan, np.nan, np.nan
    lines = sums_of(MPA, y).lines()
    assert lines.slope[:2] == pytest.approx(SLOPE)
    assert lines.n.tolist() == [68, 34, 0, 3]
    assert np.isnan(lines.slope[2:]).all()
    assert np.isnan(ResponseSums.of(1.0, np.ones(2), np.zeros(2)).lines().slope).all()


def test_weights_follow_the_sigma_of_each_instant() -> None:
    rng, sigmas = np.random.default_rng(3), np.where(np.arange(68) % 2, 20.0, 200.0)
    y = SLOPE * MPA[:, None] + rng.normal(0, 1, (68, 20_000)) * sigmas[:, None]
    sums = ResponseSums()
    for x, values, sigma in zip(MPA, y, sigmas, strict=True):
        sums += ResponseSums.of(x, values, np.full(values.shape, sigma))
    off = np.abs(sums.lines().slope - SLOPE) / sums.lines().sigma
    assert 0.66 < np.mean(off < 1) < 0.70
    assert 0.94 < np.mean(off < 2) < 0.96


@pytest.mark.parametrize(("correlation", "noise"), [(0.0, 75.0), (0.5, 75.0), (-0.3, 400.0)])
def test_noise_of_both_is_allowed_for(correlation: float, noise: float) -> None:
    """Poisson's ratio of a place: both strains have noise. Least squares would be low by 5 % at 400 um/m."""
    rng, strain, n = np.random.default_rng(4), np.linspace(0, 5000, 60), 20_000
    first, second = rng.normal(0, noise, (2, 60, n))
    along = strain[:, None] + first
    across = -0.33 * strain[:, None] + correlation * first + np.sqrt(1 - correlation**2) * second
    sums, sigma = ResponseSums(), np.full(n, noise)
    for x, y in zip(along, across, strict=True):
        sums += ResponseSums.of(x, y, sigma, sigma_x=sigma, covariance=correlation * noise**2)
    lines = sums.lines()
    assert np.mean(lines.slope) == pytest.approx(-0.33, abs=0.001)
    off = np.abs(lines.slope + 0.33) / lines.sigma
    assert 0.66 < np.mean(off < 1) < 0.70
    assert 0.94 < np.mean(off < 2) < 0.96
    assert np.mean(lines.chi2) == pytest.approx(1, abs=0.02)


def test_x_that_is_all_noise_gives_no_slope() -> None:
    rng, sums, sigma = np.random.default_rng(5), ResponseSums(), np.full(2000, 75.0)
    for _ in range(60):
        x, y = rng.normal(0, 75, (2, 2000))
        sums += ResponseSums.of(x, y, sigma, sigma_x=sigma)
    assert np.isnan(sums.lines().slope).mean() > 0.999


@pytest.mark.parametrize("instants", [85, 300])
def test_at_most_one_place_in_ten_thousand_leaves_falsely(instants: int) -> None:
    x, false, places = np.linspace(2, 130, instants), 0, 0
    for seed in range(3):
        found = departures(x, measured(np.repeat(SLOPE * x[:, None], 20_000, axis=1), seed))
        false, places = false + np.count_nonzero(np.isfinite(found.at)), places + 20_000
    assert false <= places * 1e-4


def test_places_leave_at_the_knee() -> None:
    x = np.linspace(2, 190, 130)
    at = departures(x, measured(knee(x, 5000))).at
    assert np.isfinite(at).all()
    assert np.median(at) == pytest.approx(140, abs=1.5)
    assert np.percentile(at, 1) > 136 and np.percentile(at, 99) < 145


def test_places_leave_in_their_order() -> None:
    x = np.linspace(2, 190, 130)
    y = np.concatenate([knee(x, 500, 120.0), knee(x, 500, 160.0), knee(x, 500, 500.0)], axis=1)
    at = departures(x, measured(y)).at
    assert np.median(at[:500]) == pytest.approx(120, abs=2)
    assert np.median(at[500:1000]) == pytest.approx(160, abs=2)
    assert np.isnan(at[1000:]).all()


def test_few_pictures_far_apart_show_a_knee() -> None:
    x = np.linspace(2, 190, 30)
    at = departures(x, measured(knee(x, 1000), sigma=5.0), 5.0).at
    assert np.isfinite(at).all()
    assert at.min() > 130 and at.max() < 152


@pytest.mark.parametrize(("rate", "apart"), [(25, 0.5), (40, 0.3), (60, 0.5)])
def test_flow_that_goes_on_slowly_is_no_step(rate: float, apart: float) -> None:
    x = np.concatenate([np.linspace(10, 148, 90), 148 + apart * np.arange(1, 61)])
    y = np.repeat((SLOPE * x + rate * np.maximum(x - 150, 0))[:, None], 2000, axis=1)
    found = departures(x, measured(y))
    assert set(found.segments) == {0}
    assert np.isfinite(found.at).all() and np.percentile(found.at, 99) < 165


def test_a_lost_place_has_not_left() -> None:
    y = measured(np.repeat(SLOPE * MPA[:, None], 1000, axis=1))
    y[40:, :300] = np.nan
    y[50:60, 300:400] = np.nan
    found = departures(MPA, y)
    assert np.isnan(found.at).all()
    assert not found.seen[:300].any() and found.seen[300:].all()


@pytest.mark.parametrize("height", [-3000.0, 300.0, 600.0, 5000.0])
def test_a_common_step_is_no_departure(height: float) -> None:
    y = measured(np.repeat(SLOPE * MPA[:, None], 2000, axis=1)) + np.where(MPA > 90, height, 0.0)[:, None]
    found = departures(MPA, y)
    assert np.count_nonzero(np.isfinite(found.at)) <= 1
    assert np.flatnonzero(np.diff(found.segments)).tolist() == [np.searchsorted(MPA, 90) - 1]


@pytest.mark.parametrize("height", [1000.0, -5000.0])
def test_one_instant_that_is_off_is_left_out(height: float) -> None:
    y = measured(np.repeat(SLOPE * MPA[:, None], 2000, axis=1))
    y[50] += height
    found = departures(MPA, y)
    assert np.isnan(found.at).all()
    assert [k for k, segment in enumerate(found.segments) if segment == NOT_USED] == [50]
    assert found.segments[51] == 0


def test_places_that_leave_after_a_step_are_found() -> None:
    x = np.linspace(2, 190, 200)
    y = measured(knee(x, 2000)) + np.where(x > 90, 800.0, 0.0)[:, None]
    at = departures(x, y).at
    assert np.isfinite(at).all()
    assert np.median(at) == pytest.approx(140, abs=2.5)


def test_a_renewed_reference_is_no_departure() -> None:
    y = measured(np.repeat(SLOPE * MPA[:, None], 2000, axis=1))
    y[40:] += np.random.default_rng(8).normal(0, 500, 2000)
    found = Departures((2000,), len(MPA))
    for k, (x, values) in enumerate(zip(MPA, y, strict=True)):
        found.add(x, values, np.full(2000, SIGMA), reference=int(k >= 40))
    assert np.count_nonzero(np.isfinite(found.at)) <= 1
    assert found.segments == [0] * 40 + [1] * 28


def test_noise_that_was_stated_too_small_is_no_departure() -> None:
    x = np.linspace(2, 130, 85)
    y = measured(np.repeat(SLOPE * x[:, None], 20_000, axis=1), sigma=2 * SIGMA)
    assert np.count_nonzero(np.isfinite(departures(x, y).at)) <= 2
