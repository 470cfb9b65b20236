"""The least-squares weight of a ZOI: one line of it, since all of them are separable.

``gaussian`` has sigma = size/6. Where the paper speaks of an analysis window, the weight of its
least squares is the square of that window (docs/method.md); here the window is the weight.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

Window = Literal["gaussian", "uniform", "tukey", "bi-triangular"]
WINDOWS: tuple[Window, ...] = get_args(Window)

TUKEY_FLANKS = 0.3
"""Share of the side of a "tukey" window that its two cosine flanks take together."""


def profile(window: Window, size: int) -> NDArray[np.float64]:
    """One line through the window, (size,), largest value about 1.

    Raises
    ------
    ValueError
        Unknown window; the message lists the known ones.
    """
    x: NDArray[np.float64] = np.arange(size, dtype=np.float64) - (size - 1) / 2
    if window == "gaussian":
        return np.asarray(np.exp(-0.5 * (6 * x / size) ** 2))
    if window == "uniform":
        return np.ones(size)
    if window == "tukey":
        return _tukey(x, size)
    if window == "bi-triangular":
        return np.asarray(1 - 2 * np.abs(x) / (size + 1))
    raise ValueError(f"unknown window {window!r}; known: {', '.join(WINDOWS)}")


def _tukey(x: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    flank = TUKEY_FLANKS * size / 2
    depth = np.clip((size / 2 - np.abs(x)) / flank, 0, 1)
    return np.asarray(0.5 * (1 - np.cos(np.pi * depth)))


def overlap(window: Window, size: int, step: int, count: int, moment: int) -> NDArray[np.float64]:
    """Correlation along one axis of two estimates whose ZOIs lie k steps apart, (count,).

    For white pixel noise and a pattern without direction, the noise of an estimate weighs pixels
    with x**moment w(x): moment 0 for a displacement and across a gradient, 1 along a gradient.
    """
    x = np.arange(size) - (size - 1) / 2
    kernel = x**moment * profile(window, size)
    full = np.correlate(kernel, kernel, mode="full")[size - 1 :] / (kernel @ kernel)
    lags = np.arange(count) * step
    return np.where(lags < size, full[np.minimum(lags, size - 1)], 0.0)
