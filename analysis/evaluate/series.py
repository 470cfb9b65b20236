"""Values over time: their noise, their mean course, and a value between samples."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_MEDIAN_OF_NORMAL = 0.6745


def noise(values: Floats) -> float:
    """Standard deviation of white noise on a smooth course, from second differences; 0 of fewer than 5 values.

    Parameters
    ----------
    values : (N,) float64
        At equal distances in time. The median keeps steps and kinks out.
    """
    second = np.diff(values[np.isfinite(values)], n=2)
    if len(second) < 3:
        return 0.0
    return float(np.median(np.abs(second))) / _MEDIAN_OF_NORMAL / math.sqrt(6)


def smoothed(values: Floats, half: int) -> Floats:
    """Running mean over 2 ``half`` + 1 values; fewer, and still symmetric, towards the ends, (N,)."""
    n = len(values)
    total = np.concatenate([[0.0], np.cumsum(values)])
    reach = np.minimum(half, np.minimum(np.arange(n), np.arange(n)[::-1]))
    k = np.arange(n)
    return np.asarray((total[k + reach + 1] - total[k - reach]) / (2 * reach + 1))


@dataclass(frozen=True, slots=True)
class Reading:
    """A value, its standard uncertainty, and its slope a sample."""

    value: float
    sigma: float
    slope: float


def reading(values: Floats, at: float, first: int, last: int, least_sigma: float = 0.0) -> Reading:
    """The value at a place between samples, by a parabola through ``values[first:last]``.

    Parameters
    ----------
    values : (N,) float64
    at : float, samples
    first, last : int
        A straight line between the two neighbours is taken where there are fewer than 6 samples.
    least_sigma : float
        Noise of one value, where that of the fit is smaller.
    """
    first, last = max(first, 0), min(last, len(values))
    if last - first < 6:
        return _between(values, at, least_sigma)
    k = np.arange(first, last) - at
    design = np.vander(k, 3, increasing=True)
    normal = np.linalg.inv(design.T @ design)
    found = normal @ (design.T @ values[first:last])
    rest = values[first:last] - design @ found
    scatter = math.sqrt(float(rest @ rest) / (len(k) - 3))
    return Reading(float(found[0]), max(scatter, least_sigma) * math.sqrt(normal[0, 0]), float(found[1]))


def _between(values: Floats, at: float, sigma: float) -> Reading:
    if len(values) < 2:
        return Reading(float(values[0]), sigma, 0.0)
    k = min(max(math.floor(at), 0), len(values) - 2)
    slope = float(values[k + 1] - values[k])
    return Reading(float(values[k] + (at - k) * slope), sigma, slope)


def first_crossing(values: Floats, level: float, start: int = 0) -> float:
    """Where ``values`` first reach ``level`` from below, in samples; NaN where they never do, or begin above."""
    above = np.flatnonzero(values[start:] >= level)
    if not len(above) or above[0] == 0:
        return math.nan
    k = start + int(above[0])
    return k - 1 + float((level - values[k - 1]) / (values[k] - values[k - 1]))
