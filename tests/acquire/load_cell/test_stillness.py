"""Noise apart from movement: what is still and what is not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from acquire.load_cell import stillness

N = 40
T = np.arange(N) / 80
NOISE = np.random.default_rng(1).standard_normal(N)

STILL = {
    "constant": np.full(N, 7.0),
    "noise": 100 + NOISE,
    "noise on a display": np.round(100 + NOISE, 1),
    "a last digit that flickers": 100 + 0.1 * (np.arange(N) % 7 == 0),
    "a small offset of a large load": 1e6 + NOISE,
}
MOVING = {
    "a ramp": 20.0 * T,
    "a ramp in noise": 200.0 * T + NOISE,
    "a step": np.where(T < 0.2, 0.0, 50.0) + NOISE,
    "a step at the end": np.where(np.arange(N) < N - 1, 0.0, 50.0) + NOISE,
    "a slow swing": 30 * np.sin(12 * T) + NOISE,
    "a fall of a sawtooth": (500 * T + 300) % 400 + 0.3 * NOISE,
}


@pytest.mark.parametrize("name", STILL)
def test_still(name: str) -> None:
    assert stillness(T, STILL[name]).still


@pytest.mark.parametrize("name", MOVING)
def test_moving(name: str) -> None:
    assert not stillness(T, MOVING[name]).still


def test_noise_is_measured_beside_a_ramp() -> None:
    t = np.arange(2000) / 80
    found = stillness(t, 30 * t + np.random.default_rng(2).standard_normal(2000))
    assert found.noise_N == pytest.approx(1.0, rel=0.1)
    assert found.moved_N == pytest.approx(30 * t[-1], rel=0.01)


@pytest.mark.parametrize("values", [np.zeros(0), np.zeros(1), np.zeros(2)])
def test_too_few_say_nothing(values: NDArray[np.float64]) -> None:
    found = stillness(np.arange(len(values)), values)
    assert not found.still and math.isnan(found.noise_N)


def test_a_known_digit_may_change_once() -> None:
    once = np.where(T < 0.3, 10.0, 10.1)
    assert not stillness(T, once).still
    assert stillness(T, once, step_N=0.1).still


def test_noise_alone_is_seldom_taken_for_movement() -> None:
    rng = np.random.default_rng(3)
    for n, most in ((5, 100), (12, 40), (40, 10)):
        t = np.arange(n) / 80
        assert sum(not stillness(t, rng.standard_normal(n)).still for _ in range(1000)) < most
