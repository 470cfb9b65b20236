"""Whether a load is still: its noise apart from its movement."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

LEAST = 3  # values from which something can be said
ROBUST = 12  # values from which a few odd ones do not count


@dataclass(frozen=True, slots=True)
class Stillness:
    """What some values of a load say.

    Attributes
    ----------
    n : int
    mean_N, noise_N : float, N
        Noise: standard deviation of one value, from second differences, so that neither a drift nor
        a ramp counts. NaN with fewer than three values.
    step_N : float, N
        Resolution of the display: as said, or the least change that was seen in both directions.
    moved_N : float, N
        By how much a straight line through the values rises, with its sign.
    range_N : float, N
    """

    n: int
    mean_N: float
    noise_N: float
    step_N: float
    moved_N: float
    range_N: float

    @property
    def still(self) -> bool:
        """Whether nothing but noise and the last digit moved."""
        if self.n < LEAST:
            return False
        drift = self.noise_N * max(5 * math.sqrt(12 / self.n), 1) + 2 * self.step_N
        return abs(self.moved_N) <= drift and self.range_N <= 10 * self.noise_N + 3 * self.step_N


def stillness(times: ArrayLike, forces: ArrayLike, step_N: float = 0.0) -> Stillness:
    """Judge the values of a load.

    Parameters
    ----------
    times : (N,) float, s
    forces : (N,) float, N
        All finite.
    step_N : float, N
        Resolution of the display, as far as it is known.
    """
    t, f = np.asarray(times, float), np.asarray(forces, float)
    mean, reach = (float(f.mean()), float(np.ptp(f))) if f.size else (math.nan, math.nan)
    if f.size < LEAST:
        return Stillness(f.size, mean, math.nan, step_N, reach, reach)
    second = np.abs(np.diff(f, 2))
    second[second < 1e-9 * np.abs(f).max()] = 0.0  # rounding
    spread = 1.4826 * float(np.median(second)) if f.size >= ROBUST else math.sqrt(float((second**2).mean()))
    step = max(step_N, _flicker(np.diff(f)), 1e-9 * float(np.abs(f).max()))
    return Stillness(f.size, mean, spread / math.sqrt(6), step, _rise(t - t[0], f - mean), reach)


def _flicker(steps: NDArray[np.float64]) -> float:
    """The least change that was seen in both directions: a last digit; a movement has one."""
    up, down = steps[steps > 0], -steps[steps < 0]
    return float(min(up.min(), down.min())) if up.size and down.size else 0.0


def _rise(t: NDArray[np.float64], f: NDArray[np.float64]) -> float:
    """By how much the line of least squares rises from the first value to the last."""
    away = t - t.mean()
    square = float(away @ away)
    return float(away @ f) / square * float(np.ptp(t)) if square > 0 else 0.0
