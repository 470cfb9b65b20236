"""Tests of many kinds with known truth: pulled with unloadings, cycled, held, pressed; of metals that flow in many
ways.

The stress follows the strain by a return map in one dimension with isotropic hardening: loops come of themselves.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.evaluate import Curve

Array = NDArray[np.float64]
Flow = Callable[[float], float]
E_PA = 70e9


def hardens(p: float) -> float:
    """Flow stress over plastic strain without a yield point, Pa: 0.2 % at 250 MPa."""
    return 250e6 * (max(p, 1e-12) / 0.002) ** 0.12 if p > 2e-6 else 250e6 * (2e-6 / 0.002) ** 0.12


def serrated(p: float) -> float:
    """The same with falls of 6 MPa every 0.2 % beyond 0.6 % plastic strain."""
    return hardens(p) + (3e6 - 6e6 * (p / 0.002 % 1.0) if p > 0.006 else 0.0)


def yields(upper: float, lower: float, wave: float = 0.0, length: float = 0.002) -> Flow:
    """A yield point, a plateau that waves to 1.5 %, then hardening."""

    def flow(p: float) -> float:
        fall = lower + (upper - lower) * math.exp(-p / 1e-4)
        waves = wave * math.cos(2 * math.pi * (p - 0.5e-3) / length) * (1 - math.exp(-p / 2e-4))
        return fall + waves if p < 0.015 else lower + waves + 2e9 * (p - 0.015)

    return flow


def stress_of(strain: Array, flow: Flow, E: float = E_PA) -> Array:
    """The stress of a course of strains, (N,) Pa."""
    plastic = back = 0.0
    found = np.empty(len(strain))
    for k, e in enumerate(strain):
        trial = E * (e - back)
        if abs(trial) > flow(plastic):
            low, high = 0.0, abs(trial) / E
            for _ in range(50):
                step = (low + high) / 2
                low, high = (step, high) if abs(trial) - E * step > flow(plastic + step) else (low, step)
            back += math.copysign(high, trial)
            plastic += high
            trial = E * (e - back)
        found[k] = trial
    return found


def pulled(end: float, n: int, still: int = 0, knee: float = 0.004) -> Array:
    """Strains of a test with six tenths of its ``n`` samples up to a strain ``knee``."""
    k = int(0.6 * n)
    return np.concatenate([np.zeros(still), np.linspace(0, knee, k), np.linspace(knee, end, n - k + 1)[1:]])


def unloaded(strain: Array, at: Sequence[float], depth: float, n: int, flow: Flow, E: float = E_PA) -> Array:
    """``strain`` with an unloading by ``depth`` of the stress and a reloading, ``n`` samples each, at some strains."""
    parts, rest = [], strain
    for one in at:
        before, rest = rest[rest < one], rest[rest >= one]
        top = stress_of(np.concatenate([*parts, before, [one]]), flow, E)[-1]
        down = np.linspace(one, one - depth * top / E, n)
        parts += [before, down, down[::-1]]
    return np.concatenate([*parts, rest])


def measured(
    strain: Array,
    stress: Array,
    seed: int,
    strain_noise: float = 3e-6,
    stress_noise: float = 3e4,
    fps: float = 10.0,
) -> Curve:
    """With noise on both and 0.3 of it across."""
    rng, n = np.random.default_rng(seed), len(strain)
    seen = strain + rng.normal(0, strain_noise, n)
    return Curve(np.arange(n) / fps, seen, stress + rng.normal(0, stress_noise, n), -0.3 * seen)


def cycled(
    amplitude: float, ratio: float, cycles: int, n: int, flow: Flow | None = None
) -> tuple[Array, Array]:
    """A cyclic strain from rest between ``amplitude`` and ``ratio`` times it, elastic without a ``flow``."""
    ends = [0.0, *([amplitude, ratio * amplitude] * cycles)]
    strain = np.concatenate([np.linspace(a, b, n, endpoint=False) for a, b in itertools.pairwise(ends)])
    return strain, E_PA * strain if flow is None else stress_of(strain, flow)


def relaxed(level: float, loss: float, n: int, flow: Flow | None = None) -> tuple[Array, Array]:
    """A strain that is held for nine tenths of the test while the stress falls by a share ``loss``."""
    up = max(n // 10, 12)
    strain = np.concatenate([np.linspace(0, level, up), np.full(n - up, level)])
    stress = E_PA * strain if flow is None else stress_of(strain, flow)
    late = np.clip(np.arange(n) - up, 0, None) / (n - up)
    return strain, stress * (1 - loss * (1 - np.exp(-late / 0.15)))


def crept(stress: float, growth: float, n: int) -> tuple[Array, Array]:
    """A stress that is held for nine tenths of the test while the strain grows by a share ``growth``."""
    up = max(n // 10, 12)
    course = np.concatenate([np.linspace(0, stress, up), np.full(n - up, stress)])
    late = np.clip(np.arange(n) - up, 0, None) / (n - up)
    return course / E_PA * (1 + growth * (0.4 * (1 - np.exp(-late / 0.05)) + 0.6 * late)), course
