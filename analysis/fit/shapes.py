"""Shapes of displacement that a ZOI cannot follow (``moments`` has what they are made of).

An affine fit leaves the bending and the jumps of a displacement in the difference image. Its share in each of five
shapes, orthonormal polynomials P of the window, bounds the error of the displacement at the centre:
(P2(x) + P2(y)) / sqrt 2, whose share is the error of u at the centre if the field is a parabola, and the four of third
degree, which a crack or an edge through the centre has.

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

from analysis.compiled.loops import inlined, part
from analysis.fit.moments import DEGREES, PRODUCT, PRODUCT_ROWS, weighted_rows

N_HELD = 7
"""Of a component: P2(x), P2(y), P1(x) P1(y), and P_i(x) P_j(y) of third degree by i = 3 .. 0. Of the last four, and of
the sum of the first two, the five shapes are made."""
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


@part
def cross_moments(m: Any, table: Any, mix: Any, out: Any) -> None:
    """Sums of w times the shapes of u, then of v, times the columns of J, written to ``out`` (P, 14).

    ``m[product, l, k]`` are the sums of w eta^l xi^k times the products of the channels (``product_moments``).
    """
    for column in range(len(table)):
        channel, px, py = table[column]
        _combine(m[PRODUCT[0, channel]], px, py, mix, out[column, :N_HELD])
        _combine(m[PRODUCT[1, channel]], px, py, mix, out[column, N_HELD:])


@part
def _combine(m: Any, px: int, py: int, mix: Any, out: Any) -> None:
    """From monomials, m[l, k], to the seven shapes times xi^px eta^py."""
    along = down = third = tilted = leaning = last = 0.0
    for k in range(DEGREES):
        along += mix[2, k] * m[py, px + k]
        down += mix[2, k] * m[py + k, px]
        third += mix[3, k] * m[py, px + k]
        tilted += mix[1, 1] * mix[2, k] * m[py + 1, px + k]
        leaning += mix[1, 1] * mix[2, k] * m[py + k, px + 1]
        last += mix[3, k] * m[py + k, px]
    out[0], out[1], out[2] = along, down, mix[1, 1] ** 2 * m[py + 1, px + 1]
    out[3], out[4], out[5], out[6] = third, tilted, leaning, last


@inlined
def shares(s: Any, component: int, out: Any) -> None:
    """The seven shapes of a component, from the sums s[component, j, i] of w d f_x P_i(x) P_j(y), to ``out``."""
    at = component * N_HELD
    out[at], out[at + 1], out[at + 2] = s[component, 0, 2], s[component, 2, 0], s[component, 1, 1]
    for j in range(DEGREES):
        out[at + 3 + j] = s[component, j, 3 - j]


@inlined
def bent(
    s: Any, cross: Any, z: int, step: Any, gain: Any, units: Any, known: Any, fitted: Any, i: int, cubic: Any
) -> Any:  # fmt: skip
    """Sum of the squared shares, px^2, of what is left of the difference after a linear fit of ZOI ``z``.

    ``s`` (14,) are the sums with the whole difference, ``step`` (P,) and ``gain`` are the fit, ``units`` (A, 2) the
    sums of w f_x^2 and w f_y^2; ``known`` (14,), px, is what the warp had of the shapes; ``fitted`` float32, 14 in
    whole vectors, is for use; what is of degree 3 goes to ``cubic[i]``.
    """
    weighted_rows(cross, np.uintp(z * len(step) * 2 * N_HELD), step, 2 * N_HELD, fitted)
    total = 0.0
    for component in range(2):
        at, by = component * N_HELD, 1 / (gain * units[z, component])
        of_third = 0.0
        for k in range(at + 3, at + N_HELD):
            of_third += ((s[k] - fitted[k]) * by - known[k]) ** 2
        cubic[i, component] = of_third
        second = (s[at] + s[at + 1] - fitted[at] - fitted[at + 1]) * by - known[at] - known[at + 1]
        total += of_third + (_SQRT_HALF * second) ** 2
    return total
