"""Tensile figures and the lag of the load against known tests: intervals hold the truth as often as they should."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest

from analysis.evaluate import (
    STANDARDS,
    Curve,
    ErrorLimits,
    Figure,
    Interval,
    TensileFigures,
    TensileOptions,
    Track,
    evaluate_test,
    find_lag,
    free,
    load_axis,
    principal_direction,
)
from analysis.evaluate.curve import Loading, broken_at
from analysis.evaluate.elastic import _slope, line_through
from analysis.evaluate.lag import _accepted, _Fit
from hw_mocks.machine import FlowCurve, Programme
from tests.analysis.curves import Truth, composite, linear, lueders, noisy, ramberg_osgood

SEEDS = 60
METAL, PLASTIC, LAMINATE = (TensileOptions(STANDARDS[name]) for name in ("iso6892", "iso527", "astm-d3039"))
TOE = {"toe": 3e-4, "slack_s": 3.0}


def toe(options: TensileOptions) -> TensileOptions:
    return replace(options, zero="toe")


CASES = {
    "linear": (linear(), METAL, {}, "E E_chord nu Rm"),
    "linear, free limits": (
        linear(),
        TensileOptions(free(Interval("strain", 2e-4, 2.5e-3))),
        {},
        "E E_chord nu",
    ),
    "Ramberg-Osgood": (ramberg_osgood(), METAL, {}, "E E_chord nu Rp01 Rp02 Rp1"),
    "Ramberg-Osgood, toe and slack": (ramberg_osgood(), toe(METAL), TOE, "E nu Rp01 Rp02 Rp1"),
    "Lueders": (lueders(), METAL, {}, "E E_chord nu ReH ReL Rm Agt Ag At A"),
    "composite": (composite(), LAMINATE, {}, "E E_chord nu Rm Agt At"),
    "composite, toe": (composite(), toe(LAMINATE), {"toe": 3e-4}, "E E_chord nu Rm Agt At"),
    "plastic": (linear(E=3e9, end=0.02, rate=1 / 6000), PLASTIC, {"stress": 0.02e6}, "E E_chord nu Rm"),
}


def values(truth: Truth) -> dict[str, float]:
    return {"E": truth.E, "E_chord": truth.E, "nu": truth.nu, **truth.figures}


@pytest.mark.parametrize("name", CASES)
def test_the_intervals_hold_the_truth(name: str) -> None:
    truth, options, disturbed, asked = CASES[name]
    found = [evaluate_test(noisy(truth, seed, **disturbed), options) for seed in range(SEEDS)]
    for key in asked.split():
        figures: list[Figure] = [getattr(one, key) for one in found]
        inside = sum(f.low <= values(truth)[key] <= f.high for f in figures)
        assert inside >= 0.85 * SEEDS, f"{key}: {inside} of {SEEDS}"
        halves = [f.value - f.low if f.is_bound else (f.high - f.low) / 2 for f in figures]
        widest = max(halves) / values(truth)[key]
        assert widest < (0.2 if key == "nu" else 0.06), f"{key}: +- {100 * widest:.1f} %"


def test_without_noise_the_figures_are_exact() -> None:
    found = evaluate_test(noisy(ramberg_osgood(n=20), 0, strain=0.0, stress=0.0))
    assert pytest.approx(70e9, rel=1e-6) == found.E.value
    assert found.nu.value == pytest.approx(0.33, rel=1e-6)
    assert found.Rp02.value == pytest.approx(250e6, rel=1e-4)
    assert found.r2 == pytest.approx(1)


def test_stated_limits_of_error_are_in_the_interval_of_e() -> None:
    curve = noisy(linear(), 3)
    interval = free(Interval("strain", 0.0005, 0.0025))
    plain = evaluate_test(curve, TensileOptions(interval))
    limits = ErrorLimits(force=0.01, section=0.005, strain=20e-6)
    found = evaluate_test(curve, TensileOptions(interval, limits=limits))
    assert plain.span is not None
    assert list(plain.budget) == ["scatter"]
    span = plain.span.strain[1] - plain.span.strain[0]
    parts = {"load cell": 0.01, "section": 0.005, "strain": 20e-6 / span}
    assert {k: v for k, v in found.budget.items() if k != "scatter"} == pytest.approx(
        {cause: limit / math.sqrt(3) for cause, limit in parts.items()}, rel=2e-2
    )
    assert found.budget["scatter"] == plain.budget["scatter"]
    combined = math.hypot(*found.budget.values())
    # So little of it is scatter that there are degrees of freedom without end.
    assert found.E.high - found.E.value == pytest.approx(1.96 * combined * found.E.value, rel=1e-3)
    assert found.E.value == plain.E.value
    assert found.E_chord.high - found.E_chord.value > found.E.high - found.E.value
    assert found.nu == plain.nu


@pytest.mark.parametrize("sign", [1, -1])
def test_a_change_of_sharpness_that_comes_with_the_load_is_in_the_interval_of_e(sign: int) -> None:
    interval = TensileOptions(free(Interval("strain", 0.0005, 0.0025)))
    curve = noisy(linear(), 3)
    noise = np.random.default_rng(5).normal(0, 0.01, len(curve.t))
    grown = sign * np.sqrt(100 * np.abs(curve.strain)) + noise  # 0.25 px^2 at 0.0025
    found = evaluate_test(replace(curve, blur=grown), interval)
    assert list(found.budget) == ["scatter", "blur"]
    assert found.budget["blur"] == pytest.approx(30e-6 / 0.0025 / math.sqrt(3), rel=0.05)
    plain = evaluate_test(curve, interval)
    assert found.E.value == plain.E.value
    assert found.E.high - found.E.value > 1.5 * (plain.E.high - plain.E.value)
    still = evaluate_test(replace(curve, blur=0.3 + noise), interval)
    assert list(still.budget) == ["scatter"] and still.E == plain.E


def test_the_uncertainty_of_a_corrected_lens_is_in_the_interval_of_e() -> None:
    interval = TensileOptions(free(Interval("strain", 0.0005, 0.0025)))
    curve = noisy(linear(), 3)
    plain = evaluate_test(curve, interval)
    found = evaluate_test(replace(curve, lens=4e-3 * np.abs(curve.strain)), interval)  # grows with the motion
    assert plain.span is not None
    low, high = plain.span.strain
    assert list(found.budget) == ["scatter", "lens"]
    assert found.budget["lens"] == pytest.approx(4e-3 * high / (high - low), rel=2e-2)
    assert found.E.high - found.E.value > 1.5 * (plain.E.high - plain.E.value)
    assert found.E.value == plain.E.value


def test_few_points_keep_their_degrees_of_freedom() -> None:
    line = line_through(Loading.of(noisy(linear(fps=1.0), 3)), 4, 12)
    assert line is not None
    assert line.n == 8
    assert line.modulus().high - line.slope == pytest.approx(2.447 * line.sigma, rel=1e-3)  # t of 6
    both = line.modulus(line.sigma / line.slope)  # as much again: 24 degrees of freedom
    assert both.high - line.slope == pytest.approx(2.064 * math.sqrt(2) * line.sigma, rel=1e-3)


def test_noise_of_the_strain_does_not_flatten_the_line() -> None:
    truth = linear(end=1e-3)
    found = [
        evaluate_test(noisy(truth, s, strain=40e-6), TensileOptions(free(Interval("yield", 0.1, 0.9))))
        for s in range(60)
    ]
    mean = np.mean([f.E.value for f in found])
    assert mean == pytest.approx(truth.E, rel=0.005)
    assert np.polyfit(truth.curve.strain + np.random.default_rng(0).normal(0, 40e-6, len(truth.curve.t)),
                      truth.curve.stress, 1)[0] < 0.99 * truth.E  # fmt: skip


def known(found: TensileFigures) -> set[str]:
    figures = {f.name: getattr(found, f.name) for f in fields(found)}
    return {name for name, figure in figures.items() if isinstance(figure, Figure) and figure.known}


def test_what_cannot_be_had_has_a_reason() -> None:
    found = evaluate_test(noisy(linear(), 0))
    assert "0.2 % is needed" in found.Rp02.why
    assert "no yield point" in found.ReH.why
    assert "no break" in found.At.why
    assert "before the stress fell" in found.Agt.why
    assert found.Rm.is_bound and found.Rm.why == found.Agt.why
    laminate = evaluate_test(noisy(composite(), 0), LAMINATE)
    assert laminate.Rp02.why == "not a figure of astm-d3039"
    assert found.standard == "iso6892"


def test_without_enough_points_nothing_is_made_up() -> None:
    nothing = np.full(50, math.nan)
    for curve in (
        Curve(np.arange(50.0), nothing, nothing),
        Curve(np.arange(50.0), np.linspace(0, 1e-3, 50), np.linspace(0, -1e6, 50)),
    ):
        found = evaluate_test(curve)
        assert not known(found)
        assert (
            "test in compression" if found.kind == "compression" else "with strain and a tensile force"
        ) in found.E.why
    found = evaluate_test(Curve(np.zeros(0), np.zeros(0), np.zeros(0)))
    assert not known(found) and "0 measurements in all, 8 are needed: more pictures" in found.E.why
    few = linear(fps=1.0)
    found = evaluate_test(noisy(few, 0))
    assert known(found) == {"Rm", "seconds"}
    assert "8 are needed: take more pictures there" in found.E.why


def test_no_transverse_strain_leaves_nu_alone_unknown() -> None:
    curve = noisy(linear(), 0)
    found = evaluate_test(Curve(curve.t, curve.strain, curve.stress))
    assert found.E.known and not found.nu.known
    assert "transverse strain is known at 0 points" in found.nu.why


def test_the_interval_that_was_used_is_in_the_result() -> None:
    span = evaluate_test(noisy(composite(), 0), LAMINATE).span
    assert span is not None
    assert span.strain == pytest.approx((0.001, 0.003), abs=3e-5)
    assert span.n == pytest.approx(200, abs=4)
    # A brittle one: 25 % to 50 % of the strain at failure.
    brittle = evaluate_test(noisy(composite(end=0.004), 0), LAMINATE).span
    assert brittle is not None
    assert brittle.strain == pytest.approx((0.001, 0.002), abs=3e-5)


def test_rates_are_held_against_the_standard() -> None:
    found = evaluate_test(noisy(lueders(), 0))
    assert found.rate_elastic.why == "within range 2"
    assert found.rate_plastic.why == "within range 3"
    assert found.rate_elastic.low < 2.5e-4 < found.rate_elastic.high
    fast = evaluate_test(noisy(linear(rate=1e-3, fps=100.0), 0))
    assert "outside the standard (range 1" in fast.rate_elastic.why
    laminate = evaluate_test(noisy(composite(), 0), LAMINATE)
    assert laminate.seconds.value == pytest.approx(118, abs=1)
    assert laminate.seconds.why.startswith("within 60 to 600 s")


def test_the_zero_is_named_and_the_curve_stays() -> None:
    curve = noisy(ramberg_osgood(), 1, toe=3e-4)
    before = curve.strain.copy()
    raw, compensated = (evaluate_test(curve, TensileOptions(zero=zero)) for zero in ("raw", "toe"))
    at_load = evaluate_test(curve, TensileOptions(zero="preload", preload=20e6))
    assert raw.zero.strain == 0 and raw.zero.how == "as measured"
    assert compensated.zero.strain == pytest.approx(3e-4, abs=1e-5)
    assert at_load.zero.strain == pytest.approx(3e-4 * (1 - math.exp(-4)) + 20e6 / 70e9, abs=1.5e-5)
    assert compensated.Rp02 == raw.Rp02
    assert np.array_equal(curve.strain, before)


@pytest.mark.parametrize("make", [lambda: TensileOptions(zero="toes"), lambda: TensileOptions(zero="preload"),
                                  lambda: Interval("strain", 0.002, 0.001)])  # fmt: skip
def test_impossible_options_are_refused(make) -> None:
    with pytest.raises(ValueError, match=r"known: raw|needs that preload|0 <= low < high"):
        make()


def uniaxial(degrees: float, most: float, seed: int = 3) -> list[np.ndarray]:
    """exx, eyy, exy of a test along a direction, with noise."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    along = np.linspace(0, most, 100)
    across = -0.3 * along
    true = (along * c * c + across * s * s, along * s * s + across * c * c, (along - across) * s * c)
    return [e + 3e-5 + np.random.default_rng(seed + k).normal(0, 1e-5, 100) for k, e in enumerate(true)]


@pytest.mark.parametrize("most", [2e-3, -2e-3], ids=["pulled", "pressed"])
@pytest.mark.parametrize(
    ("degrees", "axis", "off"), [(3, "x", 3), (92, "y", 2), (-80, "y", 10), (178, "x", -2)]
)
def test_the_axis_of_the_load_is_found(degrees: float, axis: str, off: float, most: float) -> None:
    found = load_axis(*uniaxial(degrees, most))
    assert found.found and found.axis == axis
    assert math.degrees(found.angle.value) == pytest.approx(off, abs=0.3)
    other = load_axis(*uniaxial(degrees, most), "x" if axis == "y" else "y")
    assert other.axis != axis and not other.found, "what is given holds"
    assert abs(math.degrees(other.angle.value)) == pytest.approx(90 - abs(off), abs=0.3)


@pytest.mark.parametrize(("degrees", "most"), [(45.0, 2e-3), (-45.0, -2e-3), (3.0, 1e-6)])
def test_an_axis_that_the_strains_do_not_decide_is_y(degrees: float, most: float) -> None:
    found = load_axis(*uniaxial(degrees, most))
    assert (found.axis, found.found) == ("y", False)


@pytest.mark.parametrize("degrees", [0.0, 2.5, 88.0, -40.0])
def test_the_direction_of_the_load_is_found(degrees: float) -> None:
    found = [principal_direction(*uniaxial(degrees, 2e-3, 3 * seed)) for seed in range(SEEDS)]
    inside = sum(f.low <= math.radians(degrees) <= f.high for f in found)
    assert inside >= 0.85 * SEEDS
    assert found[0].high - found[0].low < math.radians(0.5)
    assert not principal_direction(np.zeros(20), np.zeros(20), np.zeros(20)).known


@pytest.mark.parametrize(
    ("stress", "last"),
    [([1.0, -0.5, 0.2], 1), ([*range(1, 11), 10, 0, 0], 10), ([1, 2], None), ([np.nan] * 4, None)],
)
def test_the_last_sample_before_a_break(stress: list[float], last: int | None) -> None:
    """Also of a test that has hardly begun, whose first value was the highest: without a warning."""
    assert broken_at(np.array(stress, float)) == last


def test_the_highest_stress_needs_no_strain() -> None:
    """Where strain is lost before the highest stress, and where there are too few points for anything else."""
    curve = noisy(ramberg_osgood(), 0)
    top = int(np.argmax(curve.stress))
    lost = replace(curve, strain=np.where(np.arange(len(curve.t)) < top - 5, curve.strain, math.nan))
    assert evaluate_test(lost).Rm.value == curve.stress[top]
    few = evaluate_test(Curve(np.arange(3.0), np.full(3, math.nan), np.array([0.0, 2e6, 1e6])))
    assert few.Rm.value == 2e6
    assert known(few) == {"Rm"}
    pressed = evaluate_test(Curve(np.arange(3.0), np.zeros(3), np.array([0.0, -2e6, -1e6])))
    assert pressed.Rm.why == "no tensile stress is known"


YIELD = 3e-3


def tracks(
    seed: int, lag: float, still: float = 3.0, rate: float = 6e-4, total: float = 12.0, newtons: float = 1.0
) -> tuple[Track, Track]:
    """A metal pulled at a constant rate: 20 frames/s with 10 um/m, 80 load samples/s that come ``lag`` late."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, total, 1e-3)
    strain = np.clip((t - still) * rate, 0, None)
    force = 1.4e6 * np.where(strain < YIELD, strain, YIELD + 0.02 * (strain - YIELD))
    frames = np.arange(0, total - 0.2, 1 / 20) + rng.uniform(0, 0.05)
    samples = np.arange(0, total, 1 / 80) + rng.uniform(0, 0.0125)
    return (
        Track(frames, np.interp(frames, t, strain) + rng.normal(0, 10e-6, len(frames))),
        Track(samples, np.interp(samples - lag, t, force) + rng.normal(0, newtons, len(samples))),
    )


def test_the_slope_of_two_noises_is_that_of_total_least_squares() -> None:
    """In units of the two noises, along the largest eigenvector of the covariance."""
    for ratio in (0.01, 0.5, 3.0, 7.0):
        moments = np.array([[4.0, 9.0], [9.0, 30.0]])
        scaled = moments / np.outer([1.0, ratio], [1.0, ratio])
        across, along = np.linalg.eigh(scaled)[1][:, -1]
        expected = ratio * along / across
        assert _slope(4.0, 9.0, 30.0, 0.2, 0.2 * ratio) == pytest.approx(expected, rel=1e-9), ratio


@cache
def found(lag: float, **test: float) -> list[Figure]:
    return [find_lag(*tracks(seed, lag, **test)) for seed in range(50)]


@pytest.mark.parametrize("lag", [0.15, -0.1])
def test_the_lag_is_recovered_within_15_ms(lag: float) -> None:
    figures = found(lag)
    assert max(abs(f.value - lag) for f in figures) < 0.015
    assert sum(f.low <= lag <= f.high for f in figures) >= 44
    assert abs(np.mean([f.value for f in figures]) - lag) < 0.004


def test_a_slower_test_gives_a_wider_interval() -> None:
    figures = found(0.15, rate=2e-4, total=24.0)
    assert sum(f.low <= 0.15 <= f.high for f in figures) >= 44
    assert np.mean([f.high - f.low for f in figures]) > 1.3 * np.mean([f.high - f.low for f in found(0.15)])


@pytest.mark.parametrize(
    ("test", "message"),
    [
        ({"still": -1.0}, "begin to measure some seconds before"),
        ({"rate": 0.0}, "does not change"),
        ({"total": 1.5}, "shorter than twice"),
        ({"total": 0.5}, "frames have a strain"),
    ],
)
def test_it_is_refused_in_words(test: dict[str, float], message: str) -> None:
    for figure in found(0.15, **test)[:20]:
        assert not figure.known
        assert message in figure.why


def test_a_lag_beyond_the_search_is_not_answered() -> None:
    assert not any(f.known for f in found(1.6)[:20])


def test_a_lag_that_is_known_worse_than_asked_is_not_answered() -> None:
    known = find_lag(*tracks(3, 0.15))
    half = (known.high - known.low) / 2
    assert find_lag(*tracks(3, 0.15), max_half_width=1.01 * half) == known
    refused = find_lag(*tracks(3, 0.15), max_half_width=0.99 * half)
    assert not refused.known and "begin to measure some seconds before" in refused.why


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({}, ""),
        ({"significance": 9.9}, "the strain does not follow the force"),
        ({"known": 0.94}, "too evenly"),
        ({"separation": 19.0}, "too evenly"),
        ({"lag": 0.96}, "no lag within 1 s fits"),
        ({"lag": -0.96}, "no lag within 1 s fits"),
    ],
)
def test_the_limits_of_a_lag(changed: dict[str, float], why: str) -> None:
    fit = _Fit(0.94, 1e-3, 200, separation=21.0, significance=10.1, straight=True, known=0.96)
    found = _accepted(replace(fit, **changed), 1.0, 0.1)
    assert found.known == (not why) and why in found.why


def test_strain_that_does_not_follow_is_refused() -> None:
    strain, force = tracks(0, 0.15)
    noise = np.random.default_rng(1).normal(0, 1e-5, len(strain.t))
    assert find_lag(Track(strain.t, noise), force).why == "the strain does not follow the force"


def test_gaps_are_left_out() -> None:
    strain, force = tracks(3, 0.15)
    values = strain.values.copy()
    values[::7] = np.nan
    figure = find_lag(Track(strain.t, values), force)
    assert abs(figure.value - 0.15) < 0.02


def test_samples_that_come_in_bunches() -> None:
    """A busy machine reads several lines at once and stamps them alike."""
    strain, force = tracks(0, 0.15)
    bunched = np.repeat(force.t[::4], 4)[: len(force.t)]
    figure = find_lag(strain, Track(bunched, force.values))
    assert figure.value == pytest.approx(0.15, abs=0.05)


def test_a_proof_strength_between_two_distant_samples_has_an_interval_that_holds_it() -> None:
    """Two samples of the flow, 0.15 % apart, about a sharp knee: the chord between them is below the curve."""
    strain = np.concatenate([np.linspace(0, 1.99e-3, 200), 2e-3 + 1.5e-3 * np.arange(0.55, 20)])
    curve = Curve(np.arange(len(strain)) / 10, strain, np.minimum(70e9 * strain, 140e6) + 1e8 * strain)
    found = evaluate_test(curve).Rp01
    truth = 140e6 + 1e8 * 3e-3
    assert found.low <= truth <= found.high and found.high - found.low < 10e6


@pytest.mark.parametrize(("name", "plastic", "widest"), [("Rp01", 1e-3, 0.4e6), ("Rp02", 2e-3, 0.3e6)])
def test_a_proof_strength_of_few_samples_is_as_sure_as_a_smooth_course_makes_it(
    name: str, plastic: float, widest: float
) -> None:
    """The demo in 12 s: 2 MPa from one burst to the next about the knee, a tenth of that known."""
    flow, programme = FlowCurve(), Programme(2.0, 9.4, 0.6, FlowCurve().yield_strain)
    truth = (
        flow.yield_stress + flow.voce * (1 - math.exp(-flow.voce_rate * plastic)) + flow.hardening * plastic
    )
    rng, held, halves = np.random.default_rng(7), 0, []
    for _ in range(50):
        t = np.arange(rng.uniform(0, 4 / 30), 12, 4 / 30)
        strain = programme.strain(t)
        stress = flow.E * (strain - flow.plastic_strain(strain)) + rng.normal(0, 0.03e6, len(t))
        curve = Curve(t, strain + rng.normal(0, 1e-6, len(t)), stress, -0.33 * strain)
        found = getattr(evaluate_test(curve), name)
        held += found.low <= truth <= found.high
        halves.append((found.high - found.low) / 2)
    assert held >= 45
    assert np.mean(halves) < widest
