"""The creep of a held force against analytic laws, by its values and their intervals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.evaluate import Curve
from analysis.evaluate.creep import Creep
from analysis.evaluate.figure import quantile

Law = Callable[[NDArray[np.float64]], NDArray[np.float64]]
LAWS: dict[str, Law] = {
    "logarithmic": lambda t: 1e-4 * np.log1p(t / 2),
    "steady": lambda t: 5e-7 * t,
    "both": lambda t: 4e-5 * np.log1p(t) + 2e-7 * t,
}
RAMP_S, HOLD_S, STRESS, MODULUS = 20.0, 1000.0, 1e8, 70e9


def crept(law: Law, noise: float, seed: int, n: int = 400, sign: float = 1.0) -> Curve:
    """A ramp of the stress and its hold, both with noise."""
    rng = np.random.default_rng(seed)
    t = np.concatenate([np.linspace(0, RAMP_S, 40, endpoint=False), RAMP_S + np.linspace(0, HOLD_S, n)])
    stress = STRESS * np.minimum(t / RAMP_S, 1)
    strain = stress / MODULUS + law(np.maximum(t - RAMP_S, 0)) + rng.normal(0, noise, len(t))
    return Curve(t, sign * strain, stress + rng.normal(0, 2e4, len(t)))


@pytest.mark.parametrize("law", LAWS)
def test_intervals_hold_the_truth_as_often_as_they_say(law: str) -> None:
    total: Law = lambda t: STRESS / MODULUS + LAWS[law](np.maximum(t, 0))  # noqa: E731
    fine = np.linspace(0.01, HOLD_S, 200_001)
    of_rate, of_times = [], []
    for seed in range(300):
        found = Creep.of(crept(LAWS[law], 5e-6, seed))
        assert found is not None and found.since == pytest.approx(RAMP_S, abs=1)
        early, end = found.since - RAMP_S, found.t[-1]
        true = float(np.diff(total(np.array([end / 2, end]) + early))[0]) / (end / 2)
        of_rate.append((found.rate.value - true) / ((found.rate.high - found.rate.value) / quantile()))
        for mark, time in found.times:
            at = float(np.interp(mark, total(fine + early), fine))
            of_times.append((time.value - at) / ((time.high - time.value) / quantile()))
    assert len(of_times) >= len(of_rate)
    for off in map(np.array, (of_rate, of_times)):
        margin = 3 * np.sqrt(0.683 * 0.317 / 300)
        assert abs(np.mean(np.abs(off) < 1) - 0.683) < margin
        assert abs(np.mean(off)) < 3 / np.sqrt(300)


def test_values_without_noise() -> None:
    found = Creep.of(crept(LAWS["both"], 0.0, 1))
    assert found is not None and found.load == pytest.approx(STRESS, rel=1e-3)
    (first, time), *_ = found.times
    early = found.since - RAMP_S
    assert STRESS / MODULUS + LAWS["both"](time.value + early) == pytest.approx(first, rel=1e-5)
    assert all(float(f"{mark:.2g}") == mark for mark, _ in found.times) and len(found.times) <= 3


def test_other_tests_have_none() -> None:
    t = np.linspace(0, 100, 400)
    rng = np.random.default_rng(2)
    pulled = 1e-4 * t
    tensile = Curve(t, pulled, np.minimum(MODULUS * pulled, 1.4e8 + 2e9 * pulled))
    held = np.minimum(1e-4 * t, 1e-3)
    relaxed = Curve(t, held, MODULUS * held - 5e6 * np.log1p(np.maximum(t - 10, 0)) + rng.normal(0, 1e4, 400))
    cyclic = Curve(t, 1e-3 * np.sin(t), MODULUS * 1e-3 * np.sin(t))
    assert [Creep.of(one) for one in (tensile, relaxed, cyclic)] == [None, None, None]
    creep = crept(LAWS["steady"], 5e-6, 3)
    assert Creep.of(creep) is not None and Creep.of(creep, "tensile") is None


def test_a_short_hold_says_what_is_lacking() -> None:
    found = Creep.of(crept(LAWS["steady"], 5e-6, 4, n=18))
    assert found is not None and not found.rate.known
    assert found.rate.why == "12 bursts in the last half of the hold are needed"


def test_a_strain_that_does_not_move_clearly_has_no_times() -> None:
    found = Creep.of(crept(lambda t: 1e-9 * t, 2e-5, 5))
    assert found is None or not found.times
