"""Figures of the elastic part by value, on loadings whose noise is given."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import linregress
from scipy.stats import t as student

from analysis.evaluate.curve import Loading, noise
from analysis.evaluate.elastic import (
    FittedLine,
    between,
    chord,
    line_through,
    load_axis,
    not_uniform,
    poisson,
    poisson_between,
)
from analysis.evaluate.figure import Figure
from analysis.evaluate.tensile import midway, strain_rate
from analysis.evaluate.tensile_figures import Band

E_PA, NU, N = 70e9, 0.3, 60
STRESS = np.linspace(10e6, 70e6, N)


def loading(
    strain: NDArray[np.float64],
    stress: NDArray[np.float64],
    across: NDArray[np.float64],
    noise_stress: float = 0.0,
) -> Loading:
    unknown = np.full(len(strain), math.nan)
    return Loading(
        np.arange(len(strain)) / 10, strain, stress, across, strain, unknown, unknown, across, unknown,
        unknown, stress, strain, 0.0, noise_stress, 0, len(strain) - 1, False,
    )  # fmt: skip


def line(sigma: float = 0.0, last: int = N) -> FittedLine:
    return FittedLine(E_PA, sigma, 0.0, 1.0, last, float(STRESS.mean()), 0.0, 0, last)


def half_width(figure: Figure) -> float:
    return (figure.high - figure.low) / 2


def test_poisson_ratio_has_no_bias_by_the_noise_of_the_stress() -> None:
    """The variance of the stress is less by that of its noise, the covariance is not."""
    noise_Pa = 2e6
    found = poisson(loading(STRESS / E_PA, STRESS, -NU * STRESS / E_PA, noise_Pa), line())
    squares = float(((STRESS - STRESS.mean()) ** 2).sum())
    assert found.value == pytest.approx(NU * squares / (squares - (N - 1) * noise_Pa**2), rel=1e-9)
    assert found.value > 1.01 * NU


def test_poisson_ratio_is_as_uncertain_as_the_modulus_where_nothing_scatters() -> None:
    found = poisson(loading(STRESS / E_PA, STRESS, -NU * STRESS / E_PA), line(sigma=0.02 * E_PA))
    assert half_width(found) == pytest.approx(half_width(Figure.about(NU, 0.02 * NU, N - 2)), rel=1e-6)


def test_poisson_ratio_between_strains_has_no_bias_by_their_noise() -> None:
    along = np.linspace(1e-3, 3e-3, N) + 1e-4 * np.random.default_rng(0).standard_normal(N)
    found = poisson_between(loading(along, STRESS, -NU * along), -1.0, 1.0)
    squares = float(((along - along.mean()) ** 2).sum())
    assert found.value == pytest.approx(NU * squares / (squares - (N - 1) * noise(along) ** 2), rel=1e-9)
    assert found.value > 1.01 * NU


def test_the_chord_ends_at_the_last_point_of_the_interval() -> None:
    strain = np.linspace(0, 2e-3, N)
    stress = E_PA * strain * (1 - 100 * strain)
    found = chord(loading(strain, stress, -NU * strain), line(last=41))
    assert found.value == pytest.approx(stress[40] / strain[40], rel=1e-9)


def test_an_interval_begins_behind_the_last_point_below_it() -> None:
    assert between(np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0]), 1.5, 3.5) == (2, 4)
    assert between(np.array([0.0, 2.0, 1.0, 2.0, 3.0, 4.0]), 1.5, 3.5) == (3, 5)
    assert between(np.array([2.0, 3.0, 4.0]), 1.5, 3.5) == (0, 2)
    assert between(np.array([0.0, 1.0]), 0.5, 3.5) == (0, 0)


@pytest.mark.parametrize(
    ("share", "misfit", "words"),
    [
        (0.05, 10.0, "the strain varies by 5% over the region"),
        (0.0204, 10.0, "the strain varies by 2% over the region"),
        (0.0198, 10.0, ""),
        (0.0204, 4.0, ""),  # a sixteenth of it squared is noise
        (0.5, 2.9, ""),
    ],
)
def test_an_uneven_strain_is_named_beyond_two_percent(share: float, misfit: float, words: str) -> None:
    plain = loading(STRESS / E_PA, STRESS, -NU * STRESS / E_PA)
    uneven = replace(plain, uneven=share * plain.strain, misfit=np.full(N, misfit))
    assert not_uniform(uneven, line()) == words


def test_midway_is_half_the_strain_from_the_elastic_interval_to_the_top() -> None:
    assert midway(loading(np.arange(N) * 1.0, STRESS, STRESS), line(last=21)) == 40


@pytest.mark.parametrize(
    ("power", "words"),
    [(1.0, "within A"), (2.0, "within A on average, its tenths at 9.1e-05 to 0.0019 1/s")],
)
def test_the_tenths_of_a_rate_are_held_against_the_band_too(power: float, words: str) -> None:
    t = np.arange(100) / 99
    found = strain_rate(
        replace(loading(1e-3 * t**power, t, t), t=t), 0, 100, (Band("A", 8e-4, 1.2e-3), Band("B", 1.0, 2.0))
    )
    assert found.value == pytest.approx(1e-3, rel=1e-6) and found.why == words


def test_a_line_is_as_sure_as_its_points_and_less_away_from_their_middle() -> None:
    found = FittedLine(70e9, 0.7e9, 1e-4, 1.0, 100, 40e6, 2e-6, 0, 100)
    assert found.strain_at(140e6) == pytest.approx(1e-4 + 2e-3)
    assert found.sigma_at(40e6) == pytest.approx(2e-7)
    for stress in (250e6, -170e6):  # 210 MPa from the middle, at 1 % of 3e-3
        assert found.sigma_at(stress) == pytest.approx(math.hypot(2e-7, 3e-5))


def test_without_noise_of_the_stress_the_line_is_that_of_strain_over_stress() -> None:
    """Ten points, so that the two degrees of freedom that the line takes count."""
    stress = np.linspace(10e6, 70e6, 10)
    strain = stress / E_PA + 2e-5 * np.random.default_rng(2).standard_normal(10)
    found = line_through(replace(loading(strain, stress, strain), noise_strain=2e-5), 0, 10)
    least = linregress(stress, strain)
    assert found is not None
    assert found.slope == pytest.approx(1 / least.slope, rel=1e-9)
    assert found.strain0 == pytest.approx(least.intercept, rel=1e-6)
    assert found.sigma == pytest.approx(least.stderr / least.slope**2, rel=1e-6)
    assert found.r2 == pytest.approx(least.rvalue**2)
    assert (found.n, found.middle) == (10, pytest.approx(40e6))


def test_each_end_of_a_chord_is_read_from_a_tenth_of_the_points() -> None:
    """What bulges between them is not seen; noise of either value is in the interval."""
    strain = STRESS / E_PA
    bulged = STRESS + np.where((np.arange(N) > 6) & (np.arange(N) < N - 7), 3e6, 0.0)
    plain = loading(strain, bulged, strain)
    assert chord(plain, line()).value == pytest.approx(E_PA, rel=1e-9)
    k = np.arange(-0.0, 7.0)  # an end has seven points on one side of it: of a parabola through them
    design = np.stack([np.ones(7), k, k**2], axis=1)
    end = math.sqrt(np.linalg.inv(design.T @ design)[0, 0])
    by_stress = half_width(chord(replace(plain, noise_stress=1e5), line()))
    assert by_stress == pytest.approx(1.96 * E_PA * math.sqrt(2) * end * 1e5 / 60e6, rel=1e-3)
    by_strain = half_width(chord(replace(plain, noise_strain=1e-6), line()))
    assert by_strain == pytest.approx(1.96 * E_PA * math.sqrt(2) * end * 1e-6 / np.ptp(strain), rel=1e-3)
    assert half_width(chord(plain, line(), 0.01)) == pytest.approx(1.96 * 0.01 * E_PA, rel=1e-3)


def test_poissons_ratio_between_strains_is_that_between_them_up_to_the_highest_stress() -> None:
    along = np.concatenate([np.linspace(0, 3e-3, 91), np.linspace(2.9e-3, 0.9e-3, 61)])
    across = -np.interp(along, [0, 1e-3, 2e-3, 3e-3], [0, 0.3e-3, 0.7e-3, 1.2e-3])
    across[91:] = 0.0  # after the highest stress
    test = replace(loading(along, along, across), top=90)
    found = poisson_between(test, 1e-3, 2e-3)
    assert found.value == pytest.approx(0.4, rel=1e-6) and found.why == "strains 0.1 to 0.2 %"
    assert poisson_between(test, 2e-3, 4e-3).why == "strains 0.2 to 0.3 %"
    few = poisson_between(test, 1e-3, 1.21e-3)
    assert (
        few.why
        == "only 7 measurements between the strains 0.1 and 0.121 %, 8 are needed: take more pictures "
        "there (the strain reaches 0.3 %)"
    )


def test_an_uneven_strain_is_looked_for_in_the_upper_half_of_the_interval() -> None:
    plain = loading(STRESS / E_PA, STRESS, -NU * STRESS / E_PA)
    lower = replace(plain, uneven=np.where(np.arange(N) < N // 2, plain.strain, 0.0), misfit=np.full(N, 10.0))
    assert not_uniform(lower, line()) == ""
    assert not_uniform(replace(lower, uneven=plain.strain - lower.uneven), line()).startswith(
        "the strain varies"
    )


@pytest.mark.parametrize(
    ("exx", "eyy", "sigma", "axis"),
    [
        (1.05e-4, 1e-5, 1e-7, "x"),  # above what vibration and warming make
        (0.95e-4, 1e-5, 1e-7, None),
        (-1e-5, -1e-3, 4.9e-5, "y"),  # twenty sigmas
        (1e-5, 1e-3, 5.1e-5, None),
        (-1.55e-3, 1e-3, 1e-7, "x"),  # half above the other
        (-1.45e-3, 1e-3, 1e-7, None),
    ],
)
def test_few_instants_decide_the_axis_where_a_strain_is_clear(
    exx: float, eyy: float, sigma: float, axis: str | None
) -> None:
    found = load_axis(np.array([0.0, exx]), np.array([0.0, eyy]), np.zeros(2), sigma=np.full(2, sigma))
    assert (found.axis, found.found, found.assumed) == (axis or "y", axis is not None, axis is None)


def test_the_scatter_of_the_strain_across_is_in_poissons_ratio_between_strains() -> None:
    along = np.linspace(1e-3, 2e-3, 10)
    across = -0.3 * along + 1e-5 * np.random.default_rng(4).standard_normal(10)
    found = poisson_between(loading(along, along, across), 1e-3, 2e-3)
    least = linregress(along, across)
    assert found.value == pytest.approx(-least.slope)
    assert half_width(found) == pytest.approx(student.ppf(0.975, 8) * least.stderr)


@pytest.mark.parametrize(("points", "way", "known"), [(8, 1, True), (7, 1, False), (8, -1, False)])
def test_a_line_needs_eight_points_that_rise(points: int, way: int, known: bool) -> None:
    rise = np.linspace(1.0, 2.0, points)
    assert (line_through(loading(way * rise, rise, rise), 0, points) is not None) is known
