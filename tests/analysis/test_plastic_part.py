"""r, n and rates by value, on loadings without noise."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import linregress
from scipy.stats import t as student

from analysis.evaluate.curve import Loading
from analysis.evaluate.elastic import FittedLine
from analysis.evaluate.figure import Figure
from analysis.evaluate.flow import _slope, anisotropy, hardening, neck
from analysis.evaluate.rates import midway, seconds_of, strain_rate
from analysis.evaluate.standards import STANDARDS, Band
from analysis.field import Roi, StrainField, ZoiGrid

E_PA, NU, N_VALUE, R_VALUE, ZERO = 70e9, 0.33, 0.2, 1.5, 1e-3
LINE = FittedLine(E_PA, 0.0, ZERO, 1.0, 20, 50e6, 0.0, 0, 1)


def pulled(reached: float, narrows: float = R_VALUE / (1 + R_VALUE)) -> Loading:
    """True stress 500 MPa times plastic strain to the 0.2, to a plastic strain ``reached``, and a neck after it."""
    plastic = np.linspace(1e-4, math.log1p(reached), 400)
    true = 500e6 * plastic**N_VALUE
    along = np.expm1(plastic + true / E_PA)
    strain = np.concatenate([along, along[-1] + np.linspace(0.01, 0.2, 30)])
    stress = np.concatenate([true / (1 + along), np.full(30, 1e6)])
    across = np.expm1(-narrows * plastic - NU * true / E_PA)
    across = np.concatenate([across, np.full(30, across[-1])])
    unknown = np.full(430, math.nan)
    return Loading(
        np.arange(430) / 10, strain + ZERO, stress, across, strain, unknown, unknown, across, unknown, unknown,
        stress, strain, 0.0, 0.0, 0, 399, True,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("reached", "r", "n"),
    [
        (
            0.0232,
            "the plastic strain reaches 2.3 %, 2 % is needed",
            "the plastic strain reaches 2.3 %, 4 % is needed",
        ),
        (0.0243, "plastic strains 2 to 2.43 %", "the plastic strain reaches 2.4 %, 4 % is needed"),
        (0.041, "plastic strains 2 to 4.1 %", "plastic strains 2 to 4.1 %"),
        (0.119, "plastic strains 2 to 11.9 %", "plastic strains 2 to 10 %"),
        (0.121, "plastic strains 2 to 12.1 %", "plastic strains 10 to 12.1 %"),
        (0.35, "plastic strains 2 to 20 %", "plastic strains 10 to 20 %"),
    ],
)
def test_r_and_n_are_of_these_plastic_strains(reached: float, r: str, n: str) -> None:
    test = pulled(reached)
    found_r, found_n = anisotropy(test, LINE, Figure(NU, NU, NU)), hardening(test, LINE)
    assert (found_r.why, found_n.why) == (r, n)
    assert not found_r.known or found_r.value == pytest.approx(R_VALUE, rel=1e-9)
    assert not found_n.known or found_n.value == pytest.approx(N_VALUE, rel=1e-9)


def test_few_points_have_neither_r_nor_n() -> None:
    test, unknown = pulled(0.15), np.arange(430) % 50 > 0
    gaps = replace(test, narrowing=np.where(unknown, math.nan, test.narrowing))
    low = replace(test, stress=np.where(unknown, -1.0, test.stress))
    assert (
        anisotropy(gaps, LINE, Figure(NU, NU, NU)).why
        == "6 points over plastic strains 2 to 15 %, 8 are needed"
    )
    assert hardening(low, LINE).why == "2 points over plastic strains 10 to 15.6 %, 8 are needed"


@pytest.mark.parametrize("narrows", [-0.01, 1.01])
def test_a_width_that_grows_or_shrinks_more_than_the_length_grows_has_no_r(narrows: float) -> None:
    found = anisotropy(pulled(0.2, narrows), LINE, Figure(NU, NU, NU))
    assert found.why.startswith("the width does not shrink as the length grows")


def test_the_interval_of_r_has_what_the_elastic_strains_leave_open() -> None:
    """By the change of r with Poisson's ratio, and with the modulus where it changes that ratio too."""
    test, nu, modulus = pulled(0.2), 0.02, 0.05
    off_nu = anisotropy(test, LINE, Figure(NU + nu, NU, NU)).value - R_VALUE
    off_slope = (
        anisotropy(test, replace(LINE, slope=E_PA * (1 + modulus)), Figure(*[NU * (1 + modulus)] * 3)).value
        - R_VALUE
    )
    found = anisotropy(test, replace(LINE, sigma=modulus * E_PA), Figure(NU, NU - 1.96 * nu, NU + 1.96 * nu))
    n = np.count_nonzero(np.linspace(1e-4, math.log1p(0.2), 400)[1:] >= math.log1p(0.02))
    expected = student.ppf(0.975, n - 2) * math.hypot(off_nu, off_slope)
    assert (found.high - found.low) / 2 == pytest.approx(expected, rel=0.06)


def test_a_slope_of_few_points_keeps_their_degrees_of_freedom() -> None:
    x = np.arange(8.0)
    y = 3 - 0.5 * x + np.random.default_rng(6).normal(0, 0.1, 8)
    least = linregress(x, y)
    assert _slope(x, y) == pytest.approx((least.slope, least.stderr, 8))


def sections(growth: float, elsewhere: float, count: int = 12) -> tuple[StrainField, StrainField]:
    """Two fields of three columns and ``count`` sections along y; one section grows more than the others."""
    grid = ZoiGrid.cover(Roi(10, 20, 32 + 8 * 2, 32 + 8 * (count - 1)), 32, 8)
    strain = np.full(grid.shape, 0.2)
    grown = strain + elsewhere
    grown[2] += growth - elsewhere
    before, after = (StrainField.from_values(grid, {"dv_dy": values}, 1e-7) for values in (strain, grown))
    return before, after


@pytest.mark.parametrize(
    ("growth", "elsewhere", "clear"),
    [(1.1e-3, 0.0, True), (0.9e-3, 0.0, False), (0.21, 0.1, True), (0.19, 0.1, False)],
)
def test_a_neck_grows_by_a_thousandth_and_twice_as_much_as_the_rest(
    growth: float, elsewhere: float, clear: bool
) -> None:
    found = neck(*sections(growth, elsewhere), "y")
    assert (found is not None) is clear
    assert found is None or (found.growth, found.elsewhere) == pytest.approx((growth, elsewhere))


@pytest.mark.parametrize(("count", "enough"), [(5, True), (4, False)])
def test_a_neck_is_sought_among_five_sections(count: int, enough: bool) -> None:
    assert (neck(*sections(0.1, 0.0, count), "y") is not None) is enough


@pytest.mark.parametrize(("lost", "counts"), [(1, True), (2, False)])
def test_a_section_that_lost_more_than_half_of_its_zois_does_not_count(lost: int, counts: bool) -> None:
    before, after = sections(0.1, 0.0)
    status = after.status.copy()
    status[2, :lost] = 5
    assert (neck(before, replace(after, status=status), "y") is not None) is counts


def timed(t: np.ndarray, strain: np.ndarray, stress: np.ndarray, *, broke: bool = False) -> Loading:
    return replace(
        pulled(0.1), t=t, strain=strain, course=strain, stress=stress, level=stress,
        top=int(np.argmax(stress)), broke=broke,
    )  # fmt: skip


BANDS = (Band("A", 8e-4, 1.2e-3), Band("B", 1.0, 2.0))


def test_a_rate_is_as_sure_as_its_line() -> None:
    t = np.arange(12) / 10
    strain = 1e-3 * t + 1e-5 * np.random.default_rng(1).standard_normal(12)
    found, least = strain_rate(timed(t, strain, t), 2, 12, BANDS), linregress(t[2:], strain[2:])
    assert found.value == pytest.approx(least.slope)
    assert found.high - found.value == pytest.approx(student.ppf(0.975, 8) * least.stderr)
    assert strain_rate(timed(t, 1e-3 * t, t), 0, 3, ()).value == pytest.approx(1e-3)
    assert strain_rate(timed(t, strain, t), 0, 2, BANDS).why == "2 points of that part are known"


@pytest.mark.parametrize(
    ("rate", "words"),
    [
        (0.81e-3, "within A"),
        (1.19e-3, "within A"),
        (1.9, "within B"),
        (0.79e-3, "outside the standard (A 0.0008 to 0.0012 1/s, B 1 to 2 1/s)"),
        (1.21e-3, "outside the standard (A 0.0008 to 0.0012 1/s, B 1 to 2 1/s)"),
    ],
)
def test_a_rate_is_within_a_band_or_outside_of_all(rate: float, words: str) -> None:
    t = np.arange(10.0)
    assert strain_rate(timed(t, rate * t, t), 0, 10, BANDS).why == words


@pytest.mark.parametrize(("points", "words"), [(49, "within A"), (50, "within A on average, its tenths at ")])
def test_tenths_need_five_points_each(points: int, words: str) -> None:
    """Half of the time at a rate within the band, the middle of it faster, on average within."""
    t = np.arange(float(points))
    strain = 1e-3 * t + 5e-3 * np.sin(4 * math.pi * t / (points - 1))
    assert strain_rate(timed(t, strain, t), 0, points, BANDS).why.startswith(words)
    assert strain_rate(timed(t, strain, t), 0, points, BANDS).why != words or points < 50


@pytest.mark.parametrize(
    ("step", "broke", "seconds", "words"),
    [
        (0.5, True, 59.0, "outside 60 to 600 s of the standard"),
        (0.55, True, 64.9, "within 60 to 600 s of the standard"),
        (5.0, True, 590.0, "within 60 to 600 s of the standard"),
        (5.5, True, 649.0, "outside 60 to 600 s of the standard"),
        (0.5, False, 49.0, ""),
    ],
)
def test_the_seconds_of_a_test(step: float, broke: bool, seconds: float, words: str) -> None:
    """From 2 % of the highest stress, at sample 12, to the break (130), else to the highest stress (110)."""
    stress = np.concatenate([np.zeros(10), np.arange(101.0), np.linspace(99, 80, 20)])
    t = step * np.arange(len(stress))
    found = seconds_of(timed(t, t, stress, broke=broke), STANDARDS["astm-d3039"])
    assert found.value == pytest.approx(seconds) and found.why == words
    assert (found.low, found.high) == (pytest.approx(seconds - step), pytest.approx(seconds + step))


def test_midway_to_the_highest_stress() -> None:
    """Strains of the samples are 0, 1, .. 10; the elastic interval ends with number 1, the highest stress is 9."""
    strain, stress = np.arange(11.0), np.array([0, 5, 6, 6.5, 7, 7.5, 8, 8.5, 9, 10, 9])
    assert midway(timed(strain, strain, stress), replace(LINE, last=2)) == 5
    assert midway(timed(strain, strain, stress), replace(LINE, last=10)) == 10
