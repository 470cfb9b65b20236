"""Tensile tests whose figures are known: analytic curves, with noise, toe and slack laid over them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.evaluate import Curve

Array = NDArray[np.float64]
STILL_S = 2.0


@dataclass(frozen=True)
class Truth:
    """A curve without noise at ``fps`` and the figures it has."""

    curve: Curve
    E: float
    nu: float
    figures: dict[str, float]


def _sampled(
    stress_of: Callable[[Array], Array], end: float, rate: float, nu: float, E: float, fps: float, breaks: bool,
    faster: tuple[float, float] = (1.0, 1.0),
) -> Curve:  # fmt: skip
    """Still for two seconds, a constant strain rate up to ``end`` (``faster``: from a strain, by a factor), a break."""
    turn, factor = faster
    moving = end / rate if end < turn else turn / rate + (end - turn) / rate / factor
    n = int((STILL_S + moving) * fps + 1e-6) + 1
    t = np.arange(n + (10 if breaks else 0)) / fps
    there = np.arange(len(t)) < n
    run = np.clip((t - STILL_S) * rate, 0, None)
    strain = np.minimum(np.where(run < turn, run, turn + (run - turn) * factor), end)
    stress = np.where(there, stress_of(strain), 0.0)
    strain = np.where(there, strain, np.nan)
    elastic = np.where(there, stress, np.nan) / E
    return Curve(t, strain, stress, -nu * elastic - 0.5 * (strain - elastic))


def linear(E: float = 70e9, end: float = 3e-3, rate: float = 2.5e-4, fps: float = 20.0) -> Truth:
    curve = _sampled(lambda e: E * e, end, rate, 0.33, E, fps, breaks=False)
    return Truth(curve, E, 0.33, {"Rm": E * end})


def ramberg_osgood(E: float = 70e9, r02: float = 250e6, n: float = 12.0, fps: float = 20.0) -> Truth:
    """strain = s/E + 0.002 (s/r02)^n, to 3 % strain, no break."""
    s = np.linspace(0, 2 * r02, 200_000)
    e = s / E + 0.002 * (s / r02) ** n
    curve = _sampled(lambda x: np.interp(x, e, s), 0.03, 2.5e-4, 0.33, E, fps, breaks=False)
    proof = {
        f"Rp{name}": r02 * (p / 0.002) ** (1 / n) for name, p in (("01", 0.001), ("02", 0.002), ("1", 0.01))
    }
    return Truth(curve, E, 0.33, proof)


def lueders(E: float = 205e9, upper: float = 330e6, lower: float = 300e6, fps: float = 20.0) -> Truth:
    """A yield point, a plateau of 1.5 %, hardening to 420 MPa at 12 %, a neck, and the break at 20 %."""
    e1, top, neck, end = upper / E, 420e6, 0.12, 0.20

    def stress(e: Array) -> Array:
        fall = lower + (upper - lower) * np.exp(-(e - e1) / 1e-4)
        plateau = np.where(e < e1, E * e, fall)
        h = np.clip((e - 0.015) / (neck - 0.015), 0, 1)
        hard = plateau + (top - lower) * (1 - (1 - h) ** 2)
        soft = hard - 90e6 * np.clip((e - neck) / (end - neck), 0, 1) ** 2
        return np.asarray(soft)

    curve = _sampled(stress, end, 2.5e-4, 0.29, E, fps, breaks=True, faster=(0.018, 8.0))
    return Truth(
        curve, E, 0.29,
        {"ReH": upper, "ReL": lower, "Rm": top, "Agt": neck, "Ag": neck - top / E, "At": end,
         "A": end - 330e6 / E},
    )  # fmt: skip


def composite(E: float = 130e9, end: float = 0.012, fps: float = 10.0) -> Truth:
    curve = _sampled(lambda e: E * e, end, 1e-4, 0.3, E, fps, breaks=True)
    return Truth(curve, E, 0.3, {"Rm": E * end, "Agt": end, "At": end})


def noisy(
    truth: Truth,
    seed: int,
    strain: float = 10e-6,
    stress: float = 0.1e6,
    toe: float = 0.0,
    slack_s: float = 0.0,
) -> Curve:
    """Noise on all three; ``toe`` is strain that comes with the first 5 MPa, ``slack_s`` time before any of it."""
    rng, c = np.random.default_rng(seed), truth.curve
    n, extra = len(c.t), int(slack_s * 20)
    settled = c.strain + toe * (1 - np.exp(-c.stress / 5e6))

    def padded(values: Array, sigma: float) -> Array:
        assert values is not None
        return np.concatenate([np.full(extra, values[0]), values]) + rng.normal(0, sigma, n + extra)

    t = np.arange(n + extra) * (c.t[1] - c.t[0])
    return Curve(t, padded(settled, strain), padded(c.stress, stress), padded(c.transverse, strain))
