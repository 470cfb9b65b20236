"""Shapes of displacement that a ZOI cannot follow: what remains of the difference is held against them.

An affine fit leaves the bending and the jumps of a displacement in the difference image. Its share
in each of five shapes, orthonormal polynomials P of the window, tells how far the displacement at the
centre can be believed: (P2(x) + P2(y)) / sqrt 2, whose share is the error of u at the centre if the
field is a parabola, and the four of third degree, which a crack or an edge through the centre has.
Along y the polynomials are constant over the blocks of rows that are summed at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.compiled import helper, inlined

f4 = np.float32
BLOCK = 4
"""Rows whose moments are summed in one loop, so that sums across a vector are rare."""
N_SHAPES = 5
N_POWERS = 6
_SQRT_HALF = math.sqrt(0.5)


@dataclass(frozen=True, slots=True, eq=False)
class Shapes:
    """The polynomials of one window, for ZOIs of n pixels; xi and eta run from -1 to 1 over the ZOI.

    Attributes
    ----------
    powers : (6, n + spare) float32
        Window times xi^k, zero beyond the ZOI.
    rows : (2, n + spare) float32
        Window times P2 and P3 along x.
    blocks : (4, ceil(n / BLOCK)) float64
        P0 .. P3 along y in each block of rows.
    mix : (4, 4) float64
        P_i = sum over k of mix[i, k] xi^k.
    noise : (2,) float64
        Sum over the five shapes, and over their squares, of the variance of a share in units of
        that of u.
    """

    powers: NDArray[np.float32]
    rows: NDArray[np.float32]
    blocks: NDArray[np.float64]
    mix: NDArray[np.float64]
    noise: NDArray[np.float64]


def shapes_of(line: NDArray[np.float64], spare: int) -> Shapes:
    """The shapes of the window with the profile ``line`` (n,); rows are ``spare`` samples longer."""
    size = len(line)
    xi: NDArray[np.float64] = (np.arange(size, dtype=np.float64) - (size - 1) / 2) / (size / 2)
    mix = _orthonormal(xi, line)
    along_x = np.stack([np.polynomial.polynomial.polyval(xi, c) for c in mix])
    first = np.arange(0, size, BLOCK)
    middle = ((first + (BLOCK - 1) / 2) - (size - 1) / 2) / (size / 2)
    blocks = np.stack([np.polynomial.polynomial.polyval(middle, c) for c in mix])
    share = (along_x**2 @ line**2) / np.sum(line**2)
    mean = along_x[2] @ line**2 / np.sum(line**2)  # P2 has one under the squared window
    each = np.array([share[2] + mean**2, share[3], share[2] * share[1], share[1] * share[2], share[3]])
    padding = ((0, 0), (0, spare))
    return Shapes(
        powers=np.pad(np.stack([line * xi**k for k in range(N_POWERS)]), padding).astype(np.float32),
        rows=np.pad(line * along_x[2:], padding).astype(np.float32),
        blocks=blocks,
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


@inlined
def _sums(
    a: Any, i: Any, width: Any, b: Any, j: Any, across: Any, size: int, w: Any, e: Any, rows: Any, r: int
) -> Any:  # fmt: skip
    """Sums over four rows of (w, e) a b times rows r, r+1, r+2; rows are ``width`` and ``across`` apart."""
    w0, w1, w2, w3 = w
    e0, e1, e2, e3 = e
    s0 = f4(0)
    s1 = f4(0)
    s2 = f4(0)
    t0 = f4(0)
    t1 = f4(0)
    t2 = f4(0)
    i1 = i + width
    i2 = i1 + width
    i3 = i2 + width
    j1 = j + across
    j2 = j1 + across
    j3 = j2 + across
    for n in range(size):
        k = np.uintp(n)
        p0 = a[i + k] * b[j + k]
        p1 = a[i1 + k] * b[j1 + k]
        p2 = a[i2 + k] * b[j2 + k]
        p3 = a[i3 + k] * b[j3 + k]
        s = w0 * p0 + w1 * p1 + w2 * p2 + w3 * p3
        t = e0 * p0 + e1 * p1 + e2 * p2 + e3 * p3
        x0 = rows[r, k]
        x1 = rows[r + 1, k]
        x2 = rows[r + 2, k]
        s0 += x0 * s
        s1 += x1 * s
        s2 += x2 * s
        t0 += x0 * t
        t1 += x1 * t
        t2 += x2 * t
    return s0, s1, s2, t0, t1, t2


@helper
def _add_block(
    a: Any, i: Any, width: Any, b: Any, j: Any, across: Any, size: int, order: int,
    powers: Any, y: int, q: Any, m: Any,
) -> None:  # fmt: skip
    """Add one block of rows: m[l, i, k] += sum of w a b eta^l P_i(y) xi^k."""
    w = (powers[0, y], powers[0, y + 1], powers[0, y + 2], powers[0, y + 3])
    e = (powers[1, y], powers[1, y + 1], powers[1, y + 2], powers[1, y + 3])
    h = (powers[2, y], powers[2, y + 1], powers[2, y + 2], powers[2, y + 3])
    for r in range(0, N_POWERS, 3):
        s = _sums(a, i, width, b, j, across, size, w, e, powers, r)
        for n in range(4):
            for k in range(3):
                m[0, n, r + k] += q[n] * s[k]
                m[1, n, r + k] += q[n] * s[3 + k]
        if order == 2:
            s = _sums(a, i, width, b, j, across, size, h, h, powers, r)
            for n in range(4):
                for k in range(3):
                    m[2, n, r + k] += q[n] * s[k]


@helper
def cross_moments(
    fx: Any, fy: Any, f: Any, one: Any, at: Any, width: Any, size: int, order: int,
    powers: Any, blocks: Any, mix: Any, table: Any, m: Any, out: Any,
) -> None:  # fmt: skip
    """Sums of w times the shapes of u, then of v, times the columns of J, written to ``out`` (10, P).

    ``at`` is the flat index of the first pixel; ``one`` holds ones; ``m`` (7, 3, 4, 6) is for use here.
    """
    m[:] = 0
    o = np.uintp(0)
    for n in range(blocks.shape[1]):
        y = n * BLOCK
        i = at + np.uintp(y) * width
        q = (blocks[0, n], blocks[1, n], blocks[2, n], blocks[3, n])
        _add_block(fx, i, width, fx, i, width, size, order, powers, y, q, m[0])
        _add_block(fx, i, width, fy, i, width, size, order, powers, y, q, m[1])
        _add_block(fx, i, width, f, i, width, size, order, powers, y, q, m[2])
        _add_block(fx, i, width, one, o, o, size, order, powers, y, q, m[3])
        _add_block(fy, i, width, fy, i, width, size, order, powers, y, q, m[4])
        _add_block(fy, i, width, f, i, width, size, order, powers, y, q, m[5])
        _add_block(fy, i, width, one, o, o, size, order, powers, y, q, m[6])
    for column in range(len(table)):
        channel, px, py = table[column]
        _combine(m[channel, py], px, mix, out[:N_SHAPES, column])
        _combine(m[1 if channel == 0 else 3 + channel, py], px, mix, out[N_SHAPES:, column])


@helper
def _combine(m: Any, px: int, mix: Any, out: Any) -> None:
    """From powers of x and polynomials of y, m (4, 6), to the five shapes times xi^px."""
    second = third = tilted = 0.0
    for k in range(4):
        second += mix[2, k] * m[0, k + px]
        third += mix[3, k] * m[0, k + px]
        tilted += mix[2, k] * m[1, k + px]
    out[0] = _SQRT_HALF * (second + m[2, px])
    out[1] = third
    out[2] = tilted
    out[3] = mix[1, 1] * m[2, 1 + px]
    out[4] = m[3, px]


@inlined
def add_shares(s: Any, at: int, a: Any, q: Any, slope: Any) -> None:
    """Add one block of rows to the shapes of one component, s[at:at + 5].

    ``a`` are the sums of w f_x d times 1, xi, P2(x), P3(x), ``q`` P0 .. P3 along y, ``slope`` P1(x) / xi.
    """
    s[at] += _SQRT_HALF * (a[2] + a[0] * q[2])
    s[at + 1] += a[3]
    s[at + 2] += a[2] * q[1]
    s[at + 3] += slope * a[1] * q[2]
    s[at + 4] += a[0] * q[3]


@inlined
def bent(s: Any, cross: Any, step: Any, unit_x: Any, unit_y: Any) -> Any:
    """Sum of the squared shares, px^2, of what is left of the difference after a linear fit.

    ``s`` (10,) are the sums with the whole difference, ``step`` (P,) is the fit, ``unit_x`` and ``unit_y`` the
    sums of w f_x^2 and w f_y^2.
    """
    total = 0.0
    for i in range(2 * N_SHAPES):
        share = s[i]
        for j in range(len(step)):
            share -= cross[i, j] * step[j]
        share /= unit_x if i < N_SHAPES else unit_y
        total += share * share
    return total
