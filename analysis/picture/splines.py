"""B-splines: weights of the taps, the poles of the prefilter, gradients on whole pixels.

Only tables and filters on whole images are here; a frame is filtered in ``prefilter.py`` and warped in ``warp.py``.
Source: M. Unser, A. Aldroubi, M. Eden, B-spline signal processing, IEEE Trans. Signal Process.
41 (1993) 821-848, doi:10.1109/78.193220.
"""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from math import comb, factorial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

TAPS = 6
PASSES = 4, 2
"""Of each pole of the prefilter along a row, which so ends after 16 and 4 samples; the quintic ones have fallen to 1e-6
and 3e-6 there."""
_POLES = {
    1: (0.0, 0.0),
    3: (3**0.5 - 2, 0.0),
    5: ((67.5 - 4436.25**0.5) ** 0.5 + 26.25**0.5 - 6.5, (67.5 + 4436.25**0.5) ** 0.5 - 26.25**0.5 - 6.5),
}
"""Zeros of the sampled B-spline within the unit circle, by degree."""
LINE = 16
"""Samples of a cache line."""
PAD = 8
"""Pixels of mirrored surroundings that the coefficients of an image are given."""
MIN_BOX = 2 * PAD
"""Pixels from an edge of the image within which a box ends there: what is mirrored lies in it."""


class Box(NamedTuple):
    """A part of an image: rows ``top`` .. ``bottom`` and columns ``left`` .. ``right``, the last ones not in it."""

    top: int
    bottom: int
    left: int
    right: int

    @classmethod
    def of(cls, shape: tuple[int, int], rows: tuple[float, float], columns: tuple[float, float]) -> Box:
        """What of an image of ``shape`` lies between two rows and two columns."""
        return cls(*_between(rows, shape[0]), *_between(columns, shape[1]))


def _between(ends: tuple[float, float], length: int) -> tuple[int, int]:
    first = int(min(max(ends[0], 0), max(length - MIN_BOX, 0)))
    last = int(min(max(ends[1] + 1, first + MIN_BOX), length))
    return (0 if first < MIN_BOX else first), (length if last > length - MIN_BOX else last)


def basis(degree: int, x: NDArray[np.floating]) -> NDArray[np.float64]:
    """The centred B-spline of odd ``degree`` at x."""
    total = np.zeros_like(x)
    for k in range(degree + 2):
        power = np.maximum(x + (degree + 1) / 2 - k, 0) ** degree
        total += (-1) ** k * comb(degree + 1, k) * power / factorial(degree)
    return total


@lru_cache(maxsize=8)
def tap_table(degree: int) -> NDArray[np.float32]:
    """Polynomials of the six tap weights in tau = t - 1/2, t in [0, 1) behind the third tap, (18,).

    The weights of a pair of taps at equal distance are E(tau^2) -+ tau O(tau^2); per pair, from
    the outside in: E0, O0, E2, O2, E4, O4. Lower degrees leave the outer pairs zero.
    """
    table = np.zeros((3, TAPS))
    for pair in range(3):
        right = 3 - pair
        if right <= (degree + 1) // 2:
            table[pair] = [float(c) for c in _piece(degree, right)]
    return np.asarray(table.ravel(), np.float32)


def _piece(degree: int, right: int) -> list[Fraction]:
    """The centred B-spline between the knots at x = -right and 1 - right, as a polynomial of x + right - 1/2.

    Exact, so that no linear algebra library has a part in it; the lowest power first, (6,).
    """
    out = [Fraction(0)] * TAPS
    for k in range(degree + 2):
        offset = Fraction(degree + 2 - 2 * right - 2 * k, 2)
        if offset > 0:  # the power (x + (degree + 1) / 2 - k)_+ is on
            factor = Fraction((-1) ** k * comb(degree + 1, k), factorial(degree))
            for p in range(degree + 1):
                out[p] += factor * comb(degree, p) * offset ** (degree - p)
    return out


@lru_cache(maxsize=8)
def prefilter_poles(degree: int) -> NDArray[np.float32]:
    """The inverse of the sampled B-spline in ``prefilter.coefficients``: a factor and the two poles, (3,).

    With the factor an even picture stays as it is, although the filter along rows ends after some samples.
    """
    factor = 1.0
    for pole, passes in zip(_POLES[degree], PASSES, strict=True):
        factor *= (1 - pole) ** 2
        for k in range(passes):
            z = pole**2**k
            factor *= (1 + z * z) / (1 + z) ** 2
    return np.array([factor, *_POLES[degree]], np.float32)


def gradient_filter(degree: int, length: int) -> NDArray[np.complex128]:
    """Frequency response over ``length`` FFT bins of the spline derivative on whole pixels.

    The derivative of the interpolating spline of the given degree: d/dx beta^n over beta^n.
    """
    offsets: NDArray[np.float64] = np.arange(-3.0, 4.0)
    values = basis(degree, offsets)
    step = 1e-4
    slopes = np.asarray(basis(degree, offsets + step) - basis(degree, offsets - step)) / (2 * step)
    omega = 2 * np.pi * np.fft.fftfreq(length)
    wave = np.exp(-1j * np.outer(offsets, omega))
    return np.asarray((slopes @ wave) / (values @ wave))
