"""What is read from a curve by value: the break, true stress, crossings, running means, noise."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.evaluate.curve import (
    Course,
    Curve,
    Loading,
    TwoSides,
    broken_at,
    first_crossing,
    noise,
    reading,
    smoothed,
    true_curve,
)


@pytest.mark.parametrize(("least", "broken"), [(0.5, False), (0.03, False), (0.015, True), (0.0, True)])
def test_broken_below_two_percent_of_the_highest_stress(least: float, broken: bool) -> None:
    """The fall begins where it is steep: at the last value that still belongs to the curve."""
    stress = np.concatenate([np.linspace(0, 100, 101), np.linspace(100, 95, 20), np.full(10, 100 * least)])
    assert broken_at(stress) == (120 if broken else None)


def test_true_stress_and_strain_up_to_the_highest_stress() -> None:
    """Volume is kept: the section shrinks as the length grows."""
    strain, stress = np.array([0.0, 0.1, 0.2, 0.3]), np.array([0.0, 100.0, 200.0, 150.0])
    logarithmic, true = true_curve(strain, stress)
    assert logarithmic[:3] == pytest.approx([0.0, math.log(1.1), math.log(1.2)])
    assert true[:3] == pytest.approx([0.0, 110.0, 240.0])
    assert math.isnan(logarithmic[3]) and math.isnan(true[3])


def test_the_first_crossing_lies_between_samples() -> None:
    values = np.array([0.0, 1.0, 3.0, 2.0, 5.0])
    assert first_crossing(values, 2.0) == 1.5
    assert first_crossing(values, 4.0, 2) == pytest.approx(3 + 2 / 3)
    assert math.isnan(first_crossing(values, 6.0)) and math.isnan(first_crossing(values, 0.0))


def test_a_running_mean_is_symmetric_to_the_ends() -> None:
    assert smoothed(np.array([0.0, 3.0, 6.0, 0.0, 9.0]), 2) == pytest.approx([0.0, 3.0, 3.6, 5.0, 9.0])


def test_the_noise_on_a_bent_course() -> None:
    t = np.linspace(0, 1, 4001)
    values = 5 * t**2 + np.random.default_rng(0).normal(0, 0.01, t.size)
    assert noise(values) == pytest.approx(0.01, rel=0.05)


def test_noise_needs_five_values() -> None:
    """Its second differences are 4, 4 and 4; of normal values half are below 0.6745 sigmas, and they add six."""
    assert noise(np.array([1.0, -1, 1, -1])) == 0.0
    assert noise(np.array([1.0, -1, math.nan, 1, -1, 1])) == pytest.approx(4 / 0.6745 / math.sqrt(6))


def test_a_step_within_the_noise_is_no_break() -> None:
    """A noise of 1 up and down looks like a standard deviation of 2.4: the limit is 15 of them."""
    stress = 500 + 2 * (np.arange(60.0) % 2)
    assert broken_at(np.concatenate([stress, [470, 0, 0]])) == 60
    assert broken_at(np.concatenate([stress, [460, 0, 0]])) == 59


def test_a_reading_between_samples_of_a_parabola() -> None:
    k = np.arange(20.0)
    found = reading(0.5 * k**2 + 2 * k + 1, 7.25, 2, 14, min_sigma=0.1)
    assert found.value == pytest.approx(0.5 * 7.25**2 + 2 * 7.25 + 1)
    assert found.slope == pytest.approx(9.25)
    assert 0 < found.sigma < 0.1


def test_the_uncertainty_of_a_reading_is_that_of_its_noise() -> None:
    """Of so few values that the three a parabola takes count; never less than the noise of one value makes it."""
    rng, k = np.random.default_rng(5), np.arange(7.0)
    found = [reading(3 * k + rng.normal(0, 0.2, 7), 2.3, 0, 7) for _ in range(3000)]
    errors = np.array([one.value - 3 * 2.3 for one in found])
    assert np.mean([one.sigma**2 for one in found]) == pytest.approx(np.mean(errors**2), rel=0.1)
    quiet = reading(3 * k, 2.3, 0, 7, min_sigma=0.2)
    assert quiet.sigma == pytest.approx(np.std(errors), rel=0.05)


T = np.array([0.0, 1.0, 2.0, 6.0])
BACK = Course(T, np.array([1.0, 3.0, 5.0, 9.0]) * 1e-4, np.full(4, 6e-6))


def test_the_mean_and_the_bending_of_two_sides() -> None:
    """Bending is positive where the front is the longer side; noise is independent, and a tilt of 0.1 degree left."""
    front = Course(np.array([0.5, 1.0]), np.array([6e-4, 1e-4]), np.full(2, 8e-6))
    sides = TwoSides.of(front, BACK, 1.0)
    assert sides.mean == pytest.approx([4e-4, 2e-4])
    assert sides.bending == pytest.approx([2e-4, -1e-4])
    tilt = math.radians(0.1) ** 2 / 2 / math.sqrt(3)
    noise = [math.hypot(8e-6, 6e-6 / math.sqrt(2)) / 2, math.hypot(8e-6, 6e-6) / 2]
    assert sides.sigma == pytest.approx(np.hypot(noise, tilt))


def test_the_other_side_is_known_between_its_instants_alone() -> None:
    asked = np.array([-0.1, 0.25, 2.0, 4.0, 6.1])
    assert BACK.at(asked, 1.0).value == pytest.approx(
        [math.nan, 1.5e-4, math.nan, math.nan, math.nan], nan_ok=True
    )
    assert BACK.at(asked, 4.0).value == pytest.approx([math.nan, 1.5e-4, 5e-4, 7e-4, math.nan], nan_ok=True)
    assert BACK.at(asked, 4.0).sigma[1] == pytest.approx(math.hypot(0.75, 0.25) * 6e-6)


@pytest.mark.parametrize(("rising", "half"), [(600, 4), (150, 2), (40, 0)])
def test_what_of_a_test_is_evaluated(rising: int, half: int) -> None:
    """All that has strain and stress up to the last sample before the break; running means of up to 9 samples."""
    stress = np.concatenate([np.arange(rising + 1.0), np.zeros(5)])
    strain = 1e-5 * np.arange(len(stress))
    strain[5] = math.nan
    curve = Curve(np.arange(len(stress)) / 10, strain, stress, transverse=-0.3 * strain)
    found = Loading.of(curve)
    assert (found.n, found.top, found.half, found.broke) == (rising, rising - 1, half, True)
    assert found.t[-1] == rising / 10 and found.strain[-1] == 1e-5 * rising
    assert np.array_equal(found.elastic, found.strain) and np.array_equal(found.narrowing, found.transverse)
    assert np.isnan(found.uneven).all() and found.course[0] == 0.0
    assert not Loading.of(replace(curve, stress=np.arange(float(len(stress))))).broke
