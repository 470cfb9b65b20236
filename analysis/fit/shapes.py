"""Shapes of displacement that a ZOI cannot follow: what remains of the difference is held against them.

An affine fit leaves the bending and the jumps of a displacement in the difference image. Its share
in each of five shapes, orthonormal polynomials P of the window, tells how far the displacement at the
centre can be believed: (P2(x) + P2(y)) / sqrt 2, whose share is the error of u at the centre if the
field is a parabola, and the four of third degree, which a crack or an edge through the centre has.

Of the ZOIs across a slip line of 1.5 px the residual alone refuses 79 %, residual and shapes 99.8 %, for 2 to 8 % of
the time of a frame. Tried and rejected: the same without an allowance for strain (refused the neck of a polymer bar);
all shapes of second degree in place of their sum (refused 5 % of the ZOIs around a real open hole, not 3 %).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.compiled.loops import helper, inlined
from analysis.fit.moments import DEGREES, PRODUCT, PRODUCT_ROWS, weighted_rows

N_SHAPES = 5
_SQRT_HALF = math.sqrt(0.5)


@dataclass(frozen=True, slots=True, eq=False)
class Shapes:
    """The polynomials of one window, for ZOIs of n pixels; xi and eta run from -1 to 1 over the ZOI.

    Attributes
    ----------
    powers : (6, length) float32
        Window times xi^k, zero beyond the ZOI.
    rows : (4, length) float32
        Window times P0 .. P3.
    mix : (4, 4) float64
        P_i = sum over k of mix[i, k] xi^k.
    noise : (2,) float64
        Sum over the five shapes, and over their squares, of the variance of a share in units of
        that of u.
    """

    powers: NDArray[np.float32]
    rows: NDArray[np.float32]
    mix: NDArray[np.float64]
    noise: NDArray[np.float64]


def shapes_of(line: NDArray[np.float64], length: int) -> Shapes:
    """The shapes of the window with the profile ``line`` (n,); rows are ``length`` samples long."""
    size = len(line)
    xi: NDArray[np.float64] = (np.arange(size, dtype=np.float64) - (size - 1) / 2) / (size / 2)
    mix = _orthonormal(xi, line)
    along_x = np.stack([np.polynomial.polynomial.polyval(xi, c) for c in mix])
    share = (along_x**2 @ line**2) / np.sum(line**2)
    mean = along_x[2] @ line**2 / np.sum(line**2)  # P2 has one under the squared window
    each = np.array([share[2] + mean**2, share[3], share[2] * share[1], share[1] * share[2], share[3]])
    padding = ((0, 0), (0, length - size))
    return Shapes(
        powers=np.pad(np.stack([line * xi**k for k in range(PRODUCT_ROWS)]), padding).astype(np.float32),
        rows=np.pad(line * along_x, padding).astype(np.float32),
        mix=mix,
        noise=np.array([each.sum(), np.sum(each**2)]),
    )


def _orthonormal(x: NDArray[np.float64], weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coefficients of P0 .. P3 under the weight, (4, 4), lowest power first; symmetric windows only."""
    m2, m4, m6 = (float(weight @ x**k / weight.sum()) for k in (2, 4, 6))
    third = m4 / m2
    n2, n3 = math.sqrt(m4 - m2**2), math.sqrt(m6 - 2 * third * m4 + third**2 * m2)
    return np.array(
        [[1, 0, 0, 0], [0, 1 / math.sqrt(m2), 0, 0], [-m2 / n2, 0, 1 / n2, 0], [0, -third / n3, 0, 1 / n3]]
    )


@helper
def cross_moments(m: Any, table: Any, mix: Any, out: Any) -> None:
    """Sums of w times the shapes of u, then of v, times the columns of J, written to ``out`` (P, 10).

    ``m[product, l, k]`` are the sums of w eta^l xi^k times the products of f_x, f_y, f, 1 (``moments``).
    """
    for column in range(len(table)):
        channel, px, py = table[column]
        _combine(m[PRODUCT[0, channel]], px, py, mix, out[column, :N_SHAPES])
        _combine(m[PRODUCT[1, channel]], px, py, mix, out[column, N_SHAPES:])


@helper
def _combine(m: Any, px: int, py: int, mix: Any, out: Any) -> None:
    """From monomials, m[l, k], to the five shapes times xi^px eta^py."""
    second = third = tilted = leaning = last = 0.0
    for k in range(DEGREES):
        second += mix[2, k] * (m[py, px + k] + m[py + k, px])
        third += mix[3, k] * m[py, px + k]
        tilted += mix[1, 1] * mix[2, k] * m[py + 1, px + k]
        leaning += mix[1, 1] * mix[2, k] * m[py + k, px + 1]
        last += mix[3, k] * m[py + k, px]
    out[0] = _SQRT_HALF * second
    out[1] = third
    out[2] = tilted
    out[3] = leaning
    out[4] = last


@inlined
def shares(s: Any, component: int, out: Any) -> None:
    """The five shapes of a component, from the sums s[component, j, i] of w d f_x P_i(x) P_j(y), written to ``out``."""
    at = component * N_SHAPES
    out[at] = _SQRT_HALF * (s[component, 0, 2] + s[component, 2, 0])
    out[at + 1] = s[component, 0, 3]
    out[at + 2] = s[component, 1, 2]
    out[at + 3] = s[component, 2, 1]
    out[at + 4] = s[component, 3, 0]


@inlined
def bent(s: Any, cross: Any, z: int, step: Any, unit_x: Any, unit_y: Any, fitted: Any) -> Any:
    """Sum of the squared shares, px^2, of what is left of the difference after a linear fit of ZOI ``z``.

    ``s`` (10,) are the sums with the whole difference, ``step`` (P,) is the fit, ``unit_x`` and ``unit_y`` the
    sums of w f_x^2 and w f_y^2; ``fitted`` float32, 10 in whole vectors, is for use here.
    """
    width = 2 * N_SHAPES
    weighted_rows(cross, np.uintp(z * len(step) * width), step, width, fitted)
    of_u = of_v = 0.0
    for i in range(N_SHAPES):
        of_u += (s[i] - fitted[i]) ** 2
        of_v += (s[N_SHAPES + i] - fitted[N_SHAPES + i]) ** 2
    return of_u / unit_x**2 + of_v / unit_y**2
