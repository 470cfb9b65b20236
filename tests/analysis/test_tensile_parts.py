"""Parts of a tensile evaluation by value: curves, intervals, zeros, the lag and its sigma, the numbers of standards."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from analysis.evaluate import (
    STANDARDS,
    Figure,
    Interval,
    Standard,
    TensileOptions,
    evaluate_test,
    free,
)
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
from analysis.evaluate.elastic import FittedLine
from analysis.evaluate.lag import Track, _assessed, _Fit, _Model, _pace_noise
from analysis.evaluate.tensile import _plastic
from tests.analysis.curves import linear, lueders, noisy, ramberg_osgood

STRAINS = TensileOptions(free(Interval("strain", 5e-4, 2.5e-3)))


def test_the_plastic_part_is_less_by_the_elastic_one_and_as_unsure_as_both() -> None:
    line = FittedLine(70e9, 7e9, 0.0, 1.0, 20, 50e6, 0.0, 0, 20)
    found = _plastic(Figure(0.1, 0.098, 0.101), 350e6, line)
    elastic = 1.96 * 0.005 * 0.1
    assert found.value == pytest.approx(0.095)
    assert found.value - found.low == pytest.approx(math.hypot(0.002, elastic), rel=1e-4)
    assert found.high - found.value == pytest.approx(math.hypot(0.001, elastic), rel=1e-4)


@pytest.mark.parametrize("zero", ["raw", "toe"])
def test_an_interval_of_strains_counts_from_the_zero(zero: str) -> None:
    found = evaluate_test(noisy(linear(), 1, toe=3e-4), replace(STRAINS, zero=zero))  # type: ignore[arg-type]
    assert found.span is not None
    assert found.span.strain == pytest.approx((5e-4, 2.5e-3), abs=2e-5)
    off = 0.0 if zero == "toe" else 3e-4
    assert found.span.stress == pytest.approx((70e9 * (5e-4 - off), 70e9 * (2.5e-3 - off)), abs=3e6)


def test_an_interval_begins_and_ends_with_points_within_it() -> None:
    """Points lie 12.5 um/m apart."""
    interval = TensileOptions(free(Interval("strain", 5.05e-4, 2.495e-3)))
    span = evaluate_test(linear().curve, interval).span
    assert span is not None
    assert span.strain == pytest.approx((5.125e-4, 2.4875e-3)) and span.n == 159
    assert span.stress == pytest.approx((70e9 * 5.125e-4, 70e9 * 2.4875e-3))


def test_the_interval_of_a_metal_with_a_yield_point_is_a_share_of_the_upper_one() -> None:
    found = evaluate_test(noisy(lueders(), 0))
    assert found.span is not None and found.Rp02.value < 0.95 * found.ReH.value
    assert found.span.stress == pytest.approx((0.1 * 330e6, 0.4 * 330e6), abs=2e6)
    assert found.span.n == pytest.approx(0.3 * 330e6 / 205e9 / 2.5e-4 * 20, abs=2)


def test_the_plastic_rate_ends_at_the_highest_stress() -> None:
    """From half of the strain to it on 2e-3 1/s; what the neck does later is ten times as fast."""
    curve = noisy(lueders(), 0)
    after = np.arange(len(curve.t)) > int(np.nanargmax(curve.stress))
    faster = replace(
        curve, t=np.concatenate([[0.0], np.cumsum(np.diff(curve.t) * np.where(after[1:], 0.1, 1.0))])
    )
    found = evaluate_test(faster)
    assert found.rate_plastic.value == pytest.approx(2e-3, rel=1e-3)
    assert found.rate_plastic.why == "within range 3"


def test_a_sharpness_that_passes_that_of_the_reference_grows_all_the_while() -> None:
    """First sharper, then less sharp: 0.25 px^2 of variance more over 0.25 % strain."""
    curve = noisy(linear(), 3)
    grown = 100 * (curve.strain - 1.5e-3) + np.random.default_rng(5).normal(0, 1e-3, len(curve.t))
    blur = np.copysign(np.sqrt(np.abs(grown)), grown)
    found = evaluate_test(replace(curve, blur=blur), STRAINS)
    assert found.budget["blur"] == pytest.approx(30e-6 / 0.0025 / math.sqrt(3), rel=0.02)


@pytest.mark.parametrize(("sigmas", "clear"), [(2.0, False), (5.0, True)])
def test_a_sharpness_that_hardly_follows_the_load_is_in_no_interval(sigmas: float, clear: bool) -> None:
    """A rise of 2 or 5 of its own standard uncertainties, which it has by alternation about the line."""
    n, strain = 161, np.linspace(0, 4e-3, 161)
    inside = (strain > 5e-4) & (strain < 2.5e-3)
    x = strain[inside] - strain[inside].mean()
    slope = sigmas * 0.1 / math.sqrt(float(x @ x))
    variance = 0.5 + slope * (strain - strain[inside].mean()) + 0.1 * (-1.0) ** np.arange(n)
    curve = Curve(np.arange(n) / 10, strain, 70e9 * strain, blur=np.sqrt(variance))
    assert ("blur" in evaluate_test(curve, STRAINS).budget) is clear


def test_names_of_the_strains() -> None:
    curve = replace(noisy(linear(), 1), source="extension")
    found = evaluate_test(curve)
    assert (found.strain, found.elastic_strain) == ("extension", "extension")
    assert evaluate_test(replace(curve, elastic_source="area")).elastic_strain == "area"


def test_without_a_line_the_zero_is_the_first_value_or_none() -> None:
    few = noisy(linear(fps=1.0), 0)
    found = evaluate_test(few, TensileOptions(zero="preload", preload=1e6))
    assert (found.zero.strain, found.zero.how) == (few.strain[0], "the first value")
    assert evaluate_test(few).zero.strain == 0.0


@pytest.mark.parametrize("preload", [70e6, 1e12])
def test_a_preload_is_where_the_stress_first_reached_it_or_was_from_the_beginning(preload: float) -> None:
    curve = noisy(linear(), 2)
    found = evaluate_test(curve, TensileOptions(zero="preload", preload=preload)).zero
    if preload == 70e6:
        assert found.strain == pytest.approx(1e-3, abs=1e-5)
        assert found.how == "where the stress first reached the preload"
    else:
        assert found.strain == curve.strain[0]
        assert found.how == "the first value; the preload was there from the beginning or never"


def test_slopes_are_of_the_elastic_strain_and_the_rest_of_the_other() -> None:
    """The extension is two percent longer than the mean strain of the area."""
    curve = noisy(linear(), 2)
    found = evaluate_test(replace(curve, elastic=curve.strain / 1.02), STRAINS)
    plain = evaluate_test(curve, STRAINS)
    assert found.E.value == pytest.approx(1.02 * plain.E.value, rel=1e-3)
    assert found.E_chord.value == pytest.approx(1.02 * plain.E_chord.value, rel=1e-6)
    assert found.nu.value == pytest.approx(1.02 * plain.nu.value, rel=1e-3)
    assert found.span == plain.span and found.rate_elastic == plain.rate_elastic


@pytest.mark.parametrize(
    ("points", "why"),
    [
        (7, r"7 measurements in all, 8 are needed: more pictures"),
        (
            8,
            r"no elastic line: only \d measurements? between 10 % and 40 % of half of the highest stress, 8 are "
            r"needed: take more pictures there, or give modulus_between",
        ),
    ],
)
def test_fewer_than_eight_points_are_no_test(points: int, why: str) -> None:
    strain = np.linspace(0, 4e-3, points)
    found = evaluate_test(Curve(np.arange(points) / 1.0, strain, 70e9 * strain))
    assert re.fullmatch(why, found.E.why)


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
    assert np.isnan(Course(np.zeros(1), np.zeros(1), np.zeros(1)).at(np.zeros(3), 1.0).value).all()


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


N = 400


def assessed(force_noise: float) -> tuple[_Fit, float, float, float]:
    """A fit over a force with so many N of noise; variance, information, and what noise adds to that."""
    rng = np.random.default_rng(3)
    t = np.linspace(0.0, 8.0, N)
    force = Track(t, 250 * np.maximum(t - 2, 0) ** 1.5 + force_noise * rng.standard_normal(N))
    part = Track(t[20:-20], 1e-6 * force.values[20:-20] + 1e-6 * rng.standard_normal(N - 40))
    model = _Model.at(0.0, part, force, np.zeros(N - 1), 1e-6)
    design, pace = model.shape, model.pace(force)
    q, _ = np.linalg.qr(design)
    free = pace - q @ (q.T @ pace)
    n = float(model.weight @ model.weight)
    spurious = n * (model.found[1] * _pace_noise(force)) ** 2
    return _assessed(model, force, 0.0, 1.0), model.left / (n - 4), float(free @ free), spurious


@pytest.mark.parametrize("force_noise", [1.0, 5.0, 12.0])
def test_sigma_is_of_the_information_that_noise_does_not_imitate(force_noise: float) -> None:
    fit, variance, information, spurious = assessed(force_noise)
    assert fit.sigma == pytest.approx(math.sqrt(variance / (information - spurious)), rel=1e-6)
    assert fit.known == pytest.approx(1 - spurious / information)
    if force_noise > 10:
        assert spurious > 0.05 * information and fit.sigma > 1.02 * math.sqrt(variance / information)


def test_of_noise_alone_nothing_is_known_of_a_lag() -> None:
    rng = np.random.default_rng(3)
    t = np.linspace(0.0, 8.0, N)
    force = Track(t, 10 * rng.standard_normal(N))
    model = _Model.at(0.0, Track(t[20:-20], 1e-6 * force.values[20:-20]), force, np.zeros(N - 1), 1e-6)
    fit = _assessed(model, force, 0.0, 1.0)
    assert fit.known < 0.5 and (math.isinf(fit.sigma) or fit.sigma > 0)


@pytest.mark.parametrize(
    ("name", "interval"),
    [
        ("iso6892", Interval("yield", 0.1, 0.4)),  # annex G: 10 % to 40 % of the yield strength
        ("iso527", Interval("strain", 0.0005, 0.0025)),  # 3.9
        ("astm-d3039", Interval("strain", 0.001, 0.003)),  # table 3
    ],
)
def test_where_the_modulus_is_taken(name: str, interval: Interval) -> None:
    assert STANDARDS[name].interval == interval


def bands(standard: Standard, part: str) -> list[tuple[float, float]]:
    return [(band.low, band.high) for band in getattr(standard, f"rates_{part}")]


def test_strain_rates() -> None:
    """Of method A, each with 20 % tolerance; 1 % a minute for plastics."""
    ranges = [(0.8 * rate, 1.2 * rate) for rate in (0.00007, 0.00025, 0.002, 0.0067)]
    assert bands(STANDARDS["iso6892"], "elastic") == [pytest.approx(one) for one in ranges[:2]]
    assert bands(STANDARDS["iso6892"], "plastic") == [pytest.approx(one) for one in ranges[1:]]
    assert bands(STANDARDS["iso527"], "elastic") == [pytest.approx((0.8 / 6000, 1.2 / 6000))]


def test_a_brittle_laminate() -> None:
    standard = STANDARDS["astm-d3039"]
    assert standard.brittle == (0.006, 0.25, 0.5) and standard.seconds_to_break == (60, 600)
    assert [STANDARDS[name].flow for name in ("iso6892", "iso527", "astm-d3039")] == [True, False, False]


def test_the_interval_of_a_metal_lies_at_these_shares_of_its_proof_strength() -> None:
    curve = noisy(ramberg_osgood(), seed=1)
    found = evaluate_test(curve, TensileOptions(STANDARDS["iso6892"]))
    assert found.span is not None and found.Rp02.known
    low, high = (stress / found.Rp02.value for stress in found.span.stress)
    assert low == pytest.approx(0.1, abs=0.03) and high == pytest.approx(0.4, abs=0.03)
    wider = replace(STANDARDS["iso6892"], interval=Interval("yield", 0.1, 0.8))
    above = evaluate_test(curve, TensileOptions(wider)).span
    assert above is not None and above.stress[1] / found.Rp02.value == pytest.approx(0.8, abs=0.03)
