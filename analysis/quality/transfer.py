"""What a window does to a strain that varies: l_10% and the size of the VSG.

Both follow from the least-squares weight alone (docs/method.md, closed forms), here by sums over the
pixels of a ZOI, so that they hold for every window and for order 1 and 2.
"""

from __future__ import annotations

import math

import numpy as np

from analysis.field import Window, profile

LOSS = 0.1
"""l_10%: the period of a sine that has lost so much of its amplitude."""


def l10_strain(size: int, window: Window = "gaussian") -> float:
    """l_10% of a strain, px. The same for order 1 and 2: a quadratic term is even, a gradient odd."""
    x = _pixels(size)
    weight = profile(window, size) * x
    return _period(x, weight / (weight @ x))


def gauge_length(size: int, window: Window = "gaussian") -> float:
    """Side of the square, evenly weighted ZOI whose strain has the same noise, px: the size of the VSG."""
    x, w = _pixels(size), profile(window, size)
    fitted = (w * x**2).sum() * w.sum()
    noise = (w**2 * x**2).sum() * (w**2).sum()
    return float((12 * fitted**2 / noise) ** 0.25)


def _pixels(size: int) -> np.ndarray:
    return np.arange(size) - (size - 1) / 2


def _period(x: np.ndarray, weight: np.ndarray) -> float:
    """The longest period whose response is 1 - LOSS, by bisection from periods without loss."""

    def response(period: float) -> float:
        k = 2 * math.pi / period
        return float(weight @ np.sin(k * x) / k)

    long, short = 1000.0 * len(x), 1000.0 * len(x)
    while response(short) > 1 - LOSS:
        long, short = short, short / 1.1
    for _ in range(60):
        middle = (long + short) / 2
        long, short = (middle, short) if response(middle) > 1 - LOSS else (long, middle)
    return (long + short) / 2
