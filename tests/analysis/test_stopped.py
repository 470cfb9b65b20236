"""A load cell that stands still or falls out leaves no figure unsaid, nor a bent elastic part its E."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.evaluate import Curve, evaluate_test
from analysis.evaluate.seen import without_stopped

E_PA, PROOF_PA, NOISE_PA = 70e9, 250e6, 0.2e6
STRAIN = np.r_[np.zeros(5), np.linspace(0, 0.0107, 360), np.linspace(0.0108, 0.03, 240)]
_STRESSES = np.linspace(0, 400e6, 40_001)
STRESS = np.interp(STRAIN, _STRESSES / E_PA + 0.002 * (_STRESSES / PROOF_PA) ** 12, _STRESSES)


def pulled(seed: int = 1, resolution: float = 0.0) -> Curve:
    """A tensile test of aluminium with noise, two readings a second."""
    rng = np.random.default_rng(seed)
    stress = STRESS + rng.normal(0, NOISE_PA, len(STRESS))
    if resolution:
        stress = np.round(stress / resolution) * resolution
    return Curve(0.5 * np.arange(len(STRAIN)), STRAIN + rng.normal(0, 8e-6, len(STRAIN)), stress)


def changed(stress: np.ndarray, since: int, to: float) -> np.ndarray:
    return np.where(np.arange(len(stress)) < since, stress, to)


@pytest.mark.parametrize("share", [0.7, 1.05])
def test_a_load_cell_at_its_limit_makes_no_strength(share: float) -> None:
    test = pulled()
    found = evaluate_test(replace(test, stress=np.minimum(test.stress, share * PROOF_PA)))
    assert found.Rm.is_bound and found.Rm.low <= STRESS.max()
    assert found.Rp02.known == (share > 1) and (share < 1 or found.Rp02.low < PROOF_PA < found.Rp02.high)
    assert found.E.value == pytest.approx(E_PA, rel=0.02)
    assert any("the same to the last digit" in note for note in found.notes)


def test_a_load_cell_that_stops_makes_no_yield() -> None:
    test = pulled()
    found = evaluate_test(replace(test, stress=changed(test.stress, 60, test.stress[60])))
    assert found.Rm.is_bound and not found.Rp02.known
    assert "from 30 s to 302 s" in found.notes[0]


def test_a_load_cell_that_falls_out_is_no_break() -> None:
    test = pulled()
    found = evaluate_test(replace(test, stress=changed(test.stress, 100, 0.0)))
    assert found.Rm.is_bound and not found.A.known
    assert "fall to nothing at 49.5 s" in found.notes[0]


def test_a_break_is_none_of_these() -> None:
    test, stop = pulled(), 500
    broken = np.arange(len(test.t)) > stop
    strain = np.where(broken, test.strain[stop] - STRESS[stop] / E_PA, test.strain)
    for after in (
        strain,
        np.where(broken, math.nan, test.strain),
        np.where(broken, test.strain + 0.1, test.strain),
    ):
        torn = replace(test, strain=after, stress=np.where(broken, 0.0, test.stress))
        assert without_stopped(torn) == (torn, ())


def test_what_rests_or_is_coarse_is_no_load_cell_that_stopped() -> None:
    test = pulled()
    held = np.r_[np.arange(80), np.full(60, 80), np.arange(80, len(test.t))]
    rested = Curve(0.5 * np.arange(len(held)), STRAIN[held], np.round(STRESS[held] / 1e5) * 1e5)
    rested.strain[:] += np.random.default_rng(2).normal(0, 8e-6, len(held))
    for quiet in (test, rested, pulled(resolution=5e6), pulled(resolution=0.5e6)):
        assert without_stopped(quiet) == (quiet, ())
    slow = replace(test, stress=np.repeat(test.stress[::5], 5)[: len(test.t)])  # a logger that repeats
    assert without_stopped(slow) == (slow, ())


def test_a_weight_that_hangs_on_a_quiet_load_cell_creeps() -> None:
    """The readings have steps of 0.1 MPa and are interpolated to the pictures, so that nothing shows their steps."""
    rng = np.random.default_rng(3)
    ramp = np.round(np.linspace(0, 200, 200) + rng.normal(0, 0.5, 200))
    t = np.arange(300) + 0.37
    stress = np.interp(t, 0.3 * np.arange(1200), np.r_[ramp, np.full(1000, 200.0)] * 1e5)
    strain = stress / E_PA + 2e-5 * np.log1p(np.maximum(t - 60, 0) / 5)
    curve = Curve(t, strain + rng.normal(0, 4e-6, len(t)), stress)
    assert without_stopped(curve) == (curve, ())
    assert evaluate_test(curve).kind == "creep"


def test_the_highest_stress_is_uncertain_by_its_resolution() -> None:
    test = pulled(resolution=5e6)
    test.stress[-1] = 0.0  # it breaks
    found = evaluate_test(test).Rm
    assert found.value == pytest.approx(310e6) and found.low < STRESS[:-1].max() < found.high
    assert found.high - found.low < 7e6


def test_an_elastic_part_that_is_no_line_is_said() -> None:
    test = pulled()
    leap = replace(test, stress=test.stress + 20e6 * (np.arange(len(test.t)) >= 45))
    toe = replace(test, strain=test.strain + 600e-6 * (1 - np.exp(-STRESS / 15e6)))
    for bent in (leap, toe):
        assert "the elastic part is not straight" in evaluate_test(bent).E.why
    assert not any(evaluate_test(pulled(seed)).E.why for seed in range(5))


def test_a_neck_beside_the_gauge_does_not_take_the_strain_at_the_top() -> None:
    test, top = pulled(), 450
    after = np.maximum(np.arange(len(test.t)) - top, 0) / 155
    strain = np.where(after > 0, STRAIN[top] - 0.15 * after * STRESS[top] / E_PA, test.strain)
    stress = np.where(after > 0, STRESS[top] * (1 - 0.15 * after), test.stress)
    found = evaluate_test(replace(test, strain=strain, stress=stress)).Agt
    assert found.low < STRAIN[top] < found.high


def test_a_chord_does_not_reach_beyond_its_interval_where_steps_grow() -> None:
    """Pictures at 5 MPa from one another, and 50 MPa beyond 100 MPa, as of a test by hand."""
    stress = 1e6 * np.r_[np.arange(0.0, 70.0, 5.0), 80, 100, 150, 200, 250, 285]
    strain = stress / E_PA + 0.002 * (stress / PROOF_PA) ** 12
    noisy = strain + np.random.default_rng(1).normal(0, 2e-6, len(strain))
    found = evaluate_test(Curve(np.arange(20.0), noisy, stress)).E_chord
    assert found.low < E_PA < found.high and found.high - found.low < 0.05 * E_PA
