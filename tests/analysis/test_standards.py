"""The numbers of the standards, as the standards have them, and what follows from them in a test."""

from __future__ import annotations

from dataclasses import replace

import pytest

from analysis.evaluate import STANDARDS, Interval, Standard, TensileOptions, evaluate_test
from tests.analysis.curves import noisy, ramberg_osgood


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
