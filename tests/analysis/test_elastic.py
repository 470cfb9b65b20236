"""Figures of the elastic part by value, on loadings whose noise is given."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.evaluate.curve import Loading, noise
from analysis.evaluate.elastic import FittedLine, between, chord, not_uniform, poisson, poisson_between
from analysis.evaluate.figure import Figure
from analysis.evaluate.rates import midway, strain_rate
from analysis.evaluate.standards import Band

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
