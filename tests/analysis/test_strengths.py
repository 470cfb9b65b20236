"""Strengths and extensions by value, on loadings whose noise is given."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from scipy.stats import t as student

from analysis.evaluate.curve import Curve, Loading
from analysis.evaluate.elastic import FittedLine
from analysis.evaluate.strengths import (
    highest_stress,
    proof_strength,
    strain_at_break,
    strain_at_top,
    tensile_strength,
    yield_point,
)

E_PA, NORMAL = 100e9, 1.96
LINE = FittedLine(E_PA, 0.0, 0.0, 1.0, 20, 50e6, 0.0, 0, 5)


def loading(
    strain: Sequence[float] | np.ndarray,
    stress: Sequence[float] | np.ndarray,
    noise_stress: float = 0.0,
    noise_strain: float = 0.0,
    *,
    half: int = 0,
    broke: bool = False,
) -> Loading:
    e, s = np.asarray(strain, float), np.asarray(stress, float)
    unknown = np.full(len(e), math.nan)
    return Loading(
        np.arange(len(e)) / 10, e, s, unknown, e, unknown, unknown, unknown, unknown, unknown,
        s, e, noise_strain, noise_stress, half, int(np.argmax(s)), broke,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("flat", "lifted"), [(1, NORMAL), (200, math.sqrt(2 * math.log(200)) + 1)], ids=["a peak", "a flat top"]
)
def test_a_highest_stress_may_be_lifted_by_noise_and_passed_between_two_samples(
    flat: int, lifted: float
) -> None:
    """It rose by 1 MPa a sample over the five samples before."""
    stress = np.concatenate([np.arange(101.0), np.full(flat - 1, 99.8), [90, 80]]) * 1e6
    found = highest_stress(loading(1e-5 * np.arange(len(stress)), stress, noise_stress=1e5), 100)
    assert found.value == 100e6
    assert found.value - found.low == pytest.approx(lifted * 1e5, rel=1e-4)
    assert found.high - found.value == pytest.approx(NORMAL * 1e5 + 1e6, rel=1e-4)
    falling = highest_stress(loading([0, 1, 2], [3e6, 2e6, 1e6], 1e5), 0)
    assert falling.high - falling.value == pytest.approx(NORMAL * 1e5, rel=1e-4)


@pytest.mark.parametrize(("below", "so_far"), [(6e5, True), (8.5e5, False)])
def test_a_stress_that_ends_within_three_sigmas_of_the_highest_still_rose(below: float, so_far: bool) -> None:
    """A noise of 0.1 MPa up and down: its second differences are those of a standard deviation of 0.242 MPa."""
    stress = 1e6 * np.minimum(np.arange(50.0), 40) + 1e5 * (-1.0) ** np.arange(50)
    stress[-1] = stress.max() - below
    found = tensile_strength(Curve(np.arange(50.0), np.zeros(50), stress))
    assert found.value == 40.1e6
    assert found.why == ("the test ended before the stress fell" if so_far else "")
    assert found.is_bound == so_far and math.isinf(found.high) == so_far


def test_agt_is_the_middle_of_what_noise_leaves_of_the_top() -> None:
    stress = np.array([50, 80, 99.7, 99.9, 100, 99.8, 99.5, 90]) * 1e6
    strain = np.array([1, 2, 4, 5, 6, 8, 9, 12]) * 1e-3
    found = strain_at_top(loading(strain, stress, noise_stress=1e5, noise_strain=1e-4))
    assert found.value == pytest.approx(6e-3)  # 0.4 MPa below: from 4 to 8
    half = NORMAL * 1e-4 + 2e-3
    assert (found.low, found.high) == (
        pytest.approx(4e-3 - half, rel=1e-4),
        pytest.approx(8e-3 + half, rel=1e-4),
    )
    narrow = strain_at_top(loading(strain, stress, noise_stress=1e5, half=4))
    assert narrow.value == pytest.approx(5.5e-3)  # means of nine: 0.13 MPa
    ended = strain_at_top(loading(strain[:5], stress[:5], 1e5))
    assert ended.why == "the test ended before the stress fell"
    assert strain_at_top(loading(strain[:5], stress[:5], 1e5, broke=True)).value == pytest.approx(5e-3)


def test_at_is_the_last_strain_or_up_to_two_samples_more() -> None:
    strain = [0.0, 0.01, 0.02, 0.035]
    found = strain_at_break(loading(strain, [0, 1e6, 2e6, 1e6], noise_strain=1e-3, broke=True))
    assert found.value == 0.035
    assert found.low == pytest.approx(0.035 - NORMAL * 1e-3, rel=1e-4)
    assert found.high == pytest.approx(0.035 + NORMAL * 1e-3 + 2 * 0.015, rel=1e-4)


def yielding(*points: tuple[float, float], noise_stress: float = 0.0, half: int = 0) -> Loading:
    """Elastic to 300 MPa at 0.3 %, and then through points of percent and MPa, a sample each 0.001 %."""
    percent, mpa = np.array([(0.0, 0.0), (0.3, 300.0), *points]).T
    at = np.arange(0, percent[-1] + 5e-4, 1e-3)
    return loading(at / 100, np.interp(at, percent, mpa) * 1e6, noise_stress, half=half)


@pytest.mark.parametrize(
    ("test", "found"),
    [
        (yielding((0.301, 298.4), (0.6, 298.4), (0.7, 320.0)), True),
        (yielding((0.301, 298.6), (0.6, 298.6), (0.7, 320.0)), False),  # less than half a percent
        (yielding((0.301, 290.0), (0.340, 290.0), (0.352, 320.0)), False),  # passed after 0.044 %
        (yielding((0.301, 290.0), (0.350, 290.0), (0.362, 320.0)), True),
        (yielding((0.301, 298.4), (0.6, 298.4), (0.7, 320.0), noise_stress=0.39e6), True),
        (yielding((0.301, 298.4), (0.6, 298.4), (0.7, 320.0), noise_stress=0.41e6), False),  # four sigmas
        (yielding((0.301, 290.0), (0.56, 290.0)), True),  # never passed again, for 0.26 %
        (yielding((0.301, 290.0), (0.54, 290.0)), False),
        (yielding((0.50, 305.0), (0.501, 290.0), (0.8, 290.0)), True),  # 0.195 % plastic strain before
        (yielding((0.52, 305.0), (0.521, 290.0), (0.8, 290.0)), False),  # 0.215 %: a neck
    ],
)
def test_what_is_a_yield_point(test: Loading, found: bool) -> None:
    assert yield_point(test, LINE).upper.known is found


def test_the_lower_yield_strength_is_the_least_between_a_twentieth_and_a_quarter_of_a_percent() -> None:
    """Neither the undershoot before nor what follows later, nor what comes after the upper one is passed."""
    dips = (0.301, 290.0), (0.340, 270.0), (0.348, 290.0), (0.45, 285.0), (0.5, 290.0)
    later = (0.60, 260.0), (0.70, 320.0)
    test = yielding(*dips, *later, noise_stress=1e5, half=4)
    found = yield_point(test, LINE)
    assert found.at == 300 and found.upper.value == pytest.approx(300e6)
    assert found.lower.value == pytest.approx(test.stress[550], rel=2e-3)  # 0.25 % after it
    # Down to the lowest of the whole plateau, and half as far again as means of nine lift that kink.
    assert 260e6 - found.lower.low == pytest.approx(4e5 / 3 + 4 * (0.3e6 + 0.6e6) / 2, rel=1e-3)
    assert found.lower.high - found.lower.value == pytest.approx(4e5 / 3)
    plateau = yield_point(yielding(*dips, (0.70, 320.0)), LINE).lower
    assert plateau.value == pytest.approx(285e6, rel=1e-4)
    passed = yield_point(
        yielding(*dips[:3], (0.38, 288.0), (0.40, 305.0), (0.45, 280.0), (0.7, 330.0)), LINE
    ).lower
    assert passed.value == pytest.approx(288e6, rel=1e-4)
    never = yield_point(yielding((0.301, 290.0), (0.56, 290.0)), LINE)
    assert never.lower.value == pytest.approx(290e6) and yield_point(yielding((0.4, 301.0)), LINE).at == -1


@pytest.mark.parametrize(("offset", "samples"), [(0.002, 20), (0.001, 10)])
def test_a_proof_strength_is_as_sure_as_the_elastic_line_there(offset: float, samples: int) -> None:
    """Flow at 1 GPa over plastic strain from 140 MPa on; the line is off by 1e-5 about its middle and by 0.5 %."""
    plastic = np.concatenate([np.zeros(30), 1e-5 + 5e-5 * np.arange(120)])
    stress = np.concatenate([np.linspace(0, 140e6, 30), 140e6 + 1e9 * plastic[30:]])
    line = FittedLine(E_PA, 0.005 * E_PA, 0.0, 1.0, 16, 60e6, 4e-5, 5, 25)
    found = proof_strength(loading(plastic + stress / E_PA, stress), line, offset)
    truth = 140e6 + 1e9 * offset
    assert found.value == pytest.approx(truth, rel=1e-6)
    sure = math.hypot(1e-5, (truth - 60e6) / E_PA * 0.005)
    expected = student.ppf(0.975, samples - 3) * 1e9 * sure
    assert found.high - found.value == pytest.approx(expected, rel=2e-3)
    assert found.value - found.low == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize(("leap", "told"), [(0.0, False), (9e-4, False), (1.3e-3, True), (2.2e-3, True)])
def test_a_strain_that_leaps_over_a_proof_strength_is_told(leap: float, told: bool) -> None:
    """Flow as above; from one measurement to the next the strain grows by ``leap``, where nothing flows yet."""
    plastic = np.concatenate([np.zeros(30), 1e-5 + 5e-5 * np.arange(120)])
    stress = np.concatenate([np.linspace(0, 140e6, 30), 140e6 + 1e9 * plastic[30:]])
    plastic[29:] += leap
    found = proof_strength(loading(plastic + stress / E_PA, stress), LINE, 0.002)
    assert found.known and ("leaps by" in found.why) == told, found.why


def test_a_plateau_without_a_sample_beyond_its_undershoot_has_no_lower_yield_strength() -> None:
    elastic = np.linspace(0, 3e-3, 30)
    strain = np.concatenate([elastic, [3.3e-3, 6e-3, 7e-3]])
    test = loading(strain, np.concatenate([1e11 * elastic, [290e6, 320e6, 330e6]]))
    found = yield_point(test, LINE)
    assert found.upper.value == 300e6
    assert found.lower.why == "the plateau is too short to tell the lower yield strength"
