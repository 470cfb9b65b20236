"""r-value, n-value and Poisson's ratio of plastics, and their plastic strains, on materials where they are known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import linregress
from scipy.stats import t as student

from analysis.evaluate import STANDARDS, Curve, TensileOptions, evaluate_test, true_at_top
from analysis.evaluate.curve import Loading
from analysis.evaluate.elastic import FittedLine
from analysis.evaluate.figure import Figure
from analysis.evaluate.flow import _slope, anisotropy, hardening, neck
from analysis.evaluate.tensile import midway, seconds_of, strain_rate
from analysis.evaluate.tensile_figures import Band
from analysis.field import Roi, StrainField, ZoiGrid
from hw_mocks.machine import FlowCurve, PowerLaw

NOISE, NOISE_PA = 2e-6, 2e4


def pulled(material: PowerLaw | FlowCurve, end: float, seed: int = 0, noise: float = NOISE) -> Curve:
    """To a strain ``end``: slowly through the elastic part, faster beyond it, with noise."""
    rng = np.random.default_rng(seed)
    strain = np.concatenate([np.zeros(40), np.linspace(0, 3e-3, 300), np.linspace(3e-3, end, 800)[1:]])
    n = len(strain)
    across = material.transverse(strain) + rng.normal(0, noise, n)
    stress = material.stress(strain) + rng.normal(0, NOISE_PA, n)
    return Curve(np.arange(n) / 20, strain + rng.normal(0, noise, n), stress, across)


@pytest.mark.parametrize(("n", "r"), [(0.2, 1.0), (0.25, 1.8), (0.15, 0.6)])
def test_r_and_n_of_a_power_law(n: float, r: float) -> None:
    found = evaluate_test(pulled(PowerLaw(n, r), 0.3))
    assert found.r.low < r < found.r.high or found.r.value == pytest.approx(r, rel=2e-3)
    assert found.n.value == pytest.approx(n, rel=5e-3)
    assert found.r.high - found.r.low < 0.02 * r and found.n.high - found.n.low < 0.02 * n
    assert found.Ag.value == pytest.approx(np.expm1(n), abs=0.01), "the highest force of a power law"
    assert found.n.why.startswith("plastic strains 10 to ")
    assert found.r.why == f"plastic strains 2 to {100 * min(0.2, np.expm1(n)):.3g} %" or n < 0.19


def test_r_and_n_are_of_elongations_whatever_the_measure_of_the_other_strains() -> None:
    plain = pulled(PowerLaw(0.2, 1.5), 0.3)
    assert plain.transverse is not None
    hencky = replace(
        plain,
        elastic=np.log1p(plain.strain),
        transverse=np.log1p(plain.transverse),
        narrowing=plain.transverse,
    )
    found = evaluate_test(hencky)
    assert found.r.value == pytest.approx(1.5, rel=2e-3) and found.n.value == pytest.approx(0.2, rel=5e-3)


def test_true_stress_and_strain_at_the_highest_force() -> None:
    metal = PowerLaw(0.2, 1.5)
    found = evaluate_test(pulled(metal, 0.3))
    stress, strain = true_at_top(found.Rm, found.Agt)
    top = metal.uniform_strain
    assert stress.low <= float(metal.stress(top)) * (1 + top) <= stress.high
    assert strain.low <= np.log1p(top) <= strain.high and strain.high - strain.low < 0.02


def test_intervals_hold_the_truth_as_often_as_they_promise() -> None:
    inside = []
    for seed in range(40):
        found = evaluate_test(pulled(PowerLaw(0.22, 1.4), 0.3, seed, 1e-4))
        inside += [found.r.low <= 1.4 <= found.r.high]
    assert np.mean(inside) >= 0.8


def test_a_short_uniform_part_begins_early_for_n() -> None:
    found = evaluate_test(pulled(PowerLaw(0.08, 1.0), 0.12))
    assert found.n.value == pytest.approx(0.08, rel=0.01) and found.n.why.startswith("plastic strains 2 to ")


def test_not_known_where_the_data_do_not_tell() -> None:
    found = evaluate_test(pulled(FlowCurve(), 8e-3))
    assert found.r.why == "the plastic strain reaches 0.52 %, 2 % is needed"
    assert found.n.why == "the plastic strain reaches 0.52 %, 4 % is needed"
    without = evaluate_test(replace(pulled(PowerLaw(0.2), 0.3), transverse=None))
    assert not without.r.known and without.n.known
    plastics = evaluate_test(pulled(PowerLaw(0.2), 0.3), TensileOptions(STANDARDS["iso527"]))
    assert plastics.r.why == plastics.n.why == "not a figure of iso527"


def test_poissons_ratio_of_plastics_is_taken_from_0_3_percent_on() -> None:
    """Below, the specimen has another ratio: it would be the answer of the modulus' interval."""
    strain = np.linspace(0, 0.02, 800)
    across = np.where(strain < 0.003, -0.30 * strain, -0.0009 - 0.40 * (strain - 0.003))
    rng = np.random.default_rng(1)
    curve = Curve(np.arange(800) / 20, strain, 3e9 * strain, across + rng.normal(0, 1e-6, 800))
    found = evaluate_test(curve, TensileOptions(STANDARDS["iso527"]))
    assert found.nu.value == pytest.approx(0.40, abs=1e-3) and found.nu.why == "strains 0.3 to 1.5 %"
    short = evaluate_test(
        Curve(curve.t[:110], strain[:110], curve.stress[:110], across[:110]),
        TensileOptions(STANDARDS["iso527"]),
    )
    assert "the strain reaches 0.27 %" in short.nu.why


def strained(rows: dict[int, float], *, sigma: float = 1e-4) -> StrainField:
    """eyy of 12 sections of a specimen, 0.2 where ``rows`` has none."""
    zois = ZoiGrid.cover(Roi(10, 20, 32 + 8 * 7, 32 + 8 * 11), 32, 8)
    strain = np.full((12, 1), 0.2)
    for row, value in rows.items():
        strain[row] = value
    return StrainField.from_values(zois, {"dv_dy": strain}, sigma)


def test_a_neck_is_found_where_strain_grows_while_the_rest_rests() -> None:
    before = strained({})
    found = neck(before, strained({7: 0.35, 8: 0.41, 9: 0.33}), "y")
    assert found is not None and found.growth == pytest.approx(0.21)
    place = (found.x, found.y)
    lost = replace(before, status=np.where(np.arange(8) < 3, np.uint8(5), before.status))
    seen = neck(lost, strained({7: 0.35, 8: 0.41, 9: 0.33}), "y")
    assert seen is not None and (seen.x, seen.y) == place, (
        "the middle of the section, whichever ZOIs are lost"
    )
    assert place == (10 + 15.5 + 4 * 7, 20 + 15.5 + 8 * 8) and abs(found.elsewhere) < 1e-12
    assert neck(before, strained(dict.fromkeys(range(12), 0.25)), "y") is None, "an even strain is no neck"
    assert neck(before, strained({8: 0.201}, sigma=1e-2), "y") is None, "nor is noise"
    assert neck(before, strained({8: 0.41}), "x") is None


@pytest.mark.parametrize(("sigma", "clear"), [(3.5e-3, True), (4.5e-3, False)])
def test_a_neck_is_clear_beyond_five_sigmas_of_the_mean_of_its_section(sigma: float, clear: bool) -> None:
    """A section has 8 ZOIs, each with the noise of two fields: half of ``sigma`` in the mean."""
    before, after = (strained(rows, sigma=sigma) for rows in ({}, {8: 0.21}))
    assert float(before.sigma("eyy")[0, 0]) == pytest.approx(sigma)
    assert (neck(before, after, "y") is not None) is clear


E_PA, NU, N_VALUE, R_VALUE, ZERO = 70e9, 0.33, 0.2, 1.5, 1e-3
LINE = FittedLine(E_PA, 0.0, ZERO, 1.0, 20, 50e6, 0.0, 0, 1)


def of_plastic_strain(reached: float, narrows: float = R_VALUE / (1 + R_VALUE)) -> Loading:
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
    test = of_plastic_strain(reached)
    found_r, found_n = anisotropy(test, LINE, Figure(NU, NU, NU)), hardening(test, LINE)
    assert (found_r.why, found_n.why) == (r, n)
    assert not found_r.known or found_r.value == pytest.approx(R_VALUE, rel=1e-9)
    assert not found_n.known or found_n.value == pytest.approx(N_VALUE, rel=1e-9)


def test_few_points_have_neither_r_nor_n() -> None:
    test, unknown = of_plastic_strain(0.15), np.arange(430) % 50 > 0
    gaps = replace(test, narrowing=np.where(unknown, math.nan, test.narrowing))
    low = replace(test, stress=np.where(unknown, -1.0, test.stress))
    assert (
        anisotropy(gaps, LINE, Figure(NU, NU, NU)).why
        == "6 points over plastic strains 2 to 15 %, 8 are needed"
    )
    assert hardening(low, LINE).why == "2 points over plastic strains 10 to 15.6 %, 8 are needed"


@pytest.mark.parametrize("narrows", [-0.01, 1.01])
def test_a_width_that_grows_or_shrinks_more_than_the_length_grows_has_no_r(narrows: float) -> None:
    found = anisotropy(of_plastic_strain(0.2, narrows), LINE, Figure(NU, NU, NU))
    assert found.why.startswith("the width does not shrink as the length grows")


def test_the_interval_of_r_has_what_the_elastic_strains_leave_open() -> None:
    """By the change of r with Poisson's ratio, and with the modulus where it changes that ratio too."""
    test, nu, modulus = of_plastic_strain(0.2), 0.02, 0.05
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
        of_plastic_strain(0.1), t=t, strain=strain, course=strain, stress=stress, level=stress,
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
