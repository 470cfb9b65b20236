"""A load cell that renews its value more slowly than it sends lines, and forces that only look like it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.evaluate.lag import Track
from analysis.evaluate.seen import renewal_s

Floats = NDArray[np.float64]
T = 72.0
STRAINS: dict[str, Callable[[Floats], Floats]] = {
    "pulled": lambda t: np.interp(t, [0, 7, 43, T], [0, 0, 0.003, 0.02]),
    "cycled": lambda t: 8e-4 * (1 - np.cos(2 * np.pi * t / 3.6)),
    "held": lambda t: np.interp(t, [0, 7, 14, T], [0, 0, 0.002, 0.002]),
    "stepped": lambda t: 1.25e-4 * (np.floor(t / 3.6) + np.clip((t / 3.6 % 1) * 50, 0, 1)),
}


def force_of(strain: Floats) -> Floats:
    return np.asarray(1.4e6 * np.minimum(strain, 0.0025) + 2e4 * np.maximum(strain - 0.0025, 0))


def tracks(
    kind: str, every: float, rate: float, digit: float, noise: float, bursts_hz: float, seed: int
) -> tuple[Track, Track]:
    """``every``: time between two values; 0: each line has its own."""
    rng, t, at = np.random.default_rng(seed), np.arange(0, T, 1 / rate), np.arange(0.05, T, 1 / bursts_hz)
    renewed = np.arange(-rng.uniform(0, every), T, every) if every else t
    values = force_of(STRAINS[kind](np.maximum(renewed, 0))) + rng.normal(0, noise, len(renewed))
    shown = digit * np.rint(values / digit) if digit else values
    force = Track(t, shown[np.searchsorted(renewed, t, side="right") - 1])
    return force, Track(at, STRAINS[kind](at) + rng.normal(0, 5e-6, len(at)))


@pytest.mark.parametrize("kind", ["pulled", "cycled", "held"])
@pytest.mark.parametrize(("every", "rate"), [(0.5, 80.0), (0.5, 10.0), (0.55, 80.0), (1.0, 50.0)])
def test_a_display_that_is_renewed_slowly_is_told(kind: str, every: float, rate: float) -> None:
    for seed in range(5):
        assert renewal_s(*tracks(kind, every, rate, 0.01, 0.5, 10.0, seed))[0] == pytest.approx(
            every, abs=0.02
        )


def test_pictures_that_are_as_rare_as_its_values_still_show_it() -> None:
    assert renewal_s(*tracks("cycled", 0.5, 80.0, 1.0, 1.0, 2.0, 0))[0] == pytest.approx(0.5)


@pytest.mark.parametrize("kind", STRAINS)
@pytest.mark.parametrize("rate", [2.0, 10.0, 80.0])
def test_a_coarse_digit_a_hold_or_a_load_by_steps_is_none(kind: str, rate: float) -> None:
    for digit in (0.0, 0.01, 1.0, 10.0, 100.0, 500.0):
        for noise in (0.0, 0.3, 5.0, 50.0):
            for bursts_hz in (2.0, 10.0, 30.0):
                assert renewal_s(*tracks(kind, 0.0, rate, digit, noise, bursts_hz, 1)) == (0.0, 0.0)


@pytest.mark.parametrize("n", [0, 1, 2, 30])
def test_few_readings_tell_nothing(n: int) -> None:
    assert (
        renewal_s(Track(np.arange(n) * 1.0, np.arange(n) * 1.0), Track(np.arange(3.0), np.zeros(3)))[0] == 0
    )


def test_two_pictures_between_two_values_show_nothing() -> None:
    t = np.arange(0, 12, 1 / 80)
    force = Track(t, 100.0 * np.floor(t / 0.4 + 1e-9) + np.floor(t / 0.4 + 1e-9) % 3 * 0.01)
    assert renewal_s(force, Track(np.array([4.1, 4.2]), np.array([1e-4, 2e-4]))) == (0.0, 0.0)
