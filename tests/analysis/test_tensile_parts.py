"""Parts of a tensile evaluation by value: intervals, zeros, what the interval of E is made of, and names."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from analysis.evaluate import Curve, Figure, Interval, TensileOptions, evaluate_test, free
from analysis.evaluate.elastic import FittedLine
from analysis.evaluate.tensile import _plastic
from tests.analysis.curves import linear, lueders, noisy

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
        (7, r"only 7 measurements have strain and a tensile force, 8 are needed: .* right\?"),
        (
            8,
            r"no elastic line: only \d measurements between 10 % and 40 % of half of the highest stress, 8 are needed: "
            r"take more pictures there, or give modulus_between",
        ),
    ],
)
def test_fewer_than_eight_points_are_no_test(points: int, why: str) -> None:
    strain = np.linspace(0, 4e-3, points)
    found = evaluate_test(Curve(np.arange(points) / 1.0, strain, 70e9 * strain))
    assert re.fullmatch(why, found.E.why)
