"""Shapes of displacement that a ZOI cannot follow, and the moments that the fit and the shapes are made of.

An affine fit leaves the bending and the jumps of a displacement in the difference image. Its share in each of five
shapes, orthonormal polynomials P of the window, bounds the error of the displacement at the centre:
(P2(x) + P2(y)) / sqrt 2, whose share is the error of u at the centre if the field is a parabola, and the four of third
degree, which a crack or an edge through the centre has.

Of the ZOIs across a slip line of 1.5 px the residual alone refuses 79 %, residual and shapes 99.8 %, for 2 to 8 % of
the time of a frame. Tried and rejected: the same without an allowance for strain (refused the neck of a polymer bar);
all shapes of second degree in place of their sum (refused 5 % of the ZOIs around a real open hole, not 3 %).

All moments of a ZOI are sums over w(x) w(y) P_i(x) P_j(y) of some image. A vector of columns is summed
down the rows with w(y) P_j(y) in registers, and what comes out, a few rows, is multiplied with
w(x) P_i(x) at the end. A sum across a vector is so needed once a moment, not once a row: 0.8 us a ZOI of 32 px in place
of 1.2, and a third of the time to prepare a reference (one core, Xeon with AVX-512, November 2026).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.compiled.loops import helper, inlined
from analysis.compiled.vectors import LANES, load, spread, store, total

DEGREES = 4
"""Polynomials of degree 0 .. 3 for the gradients, 0 and 1 for level and offset."""
DEGREES_OF = (DEGREES, DEGREES, 2, 2, 1, 1, 1)
"""The same for each of the channels f_x, f_y, f, 1, f_xx, f_yy and f_xy."""
CHANNELS = len(DEGREES_OF)
DIFFERENCE_ROWS = sum(DEGREES_OF) + 1
"""Column sums of the difference: with each channel, and of its square."""
_FIRST = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2), (3, 3), (0, 3), (1, 3), (2, 3))
_PAIRS = _FIRST + tuple((i, j) for j in range(4, CHANNELS) for i in range(j + 1))
N_PRODUCTS = len(_PAIRS)
PRODUCT = np.array([[_PAIRS.index((min(i, j), max(i, j))) for j in range(CHANNELS)] for i in range(CHANNELS)])
"""Where the product of two channels is kept."""
PRODUCT_ROWS, SQUARE_ROWS = 6, 5
"""Column sums of a product under the window (eta^0 .. eta^5) and under its square (eta^0 .. eta^4)."""
N_SHAPES = 5
_SQRT_HALF = math.sqrt(0.5)


@inlined
def dot(a: Any, i: Any, b: Any, j: Any, size: int) -> Any:
    """Sum of a[i + k] b[j + k], k < size; size in whole vectors."""
    out = load(a, i) * load(b, j)
    for n in range(LANES, size, LANES):
        k = np.uintp(n)
        out += load(a, i + k) * load(b, j + k)
    return total(out)


@inlined
def weighted_rows(a: Any, at: Any, weights: Any, width: int, out: Any) -> None:
    """out[n] = sum over k of weights[k] a[at + k width + n], n < ``width``.

    Reads and writes whole vectors: up to LANES samples more than there are, both in ``a`` and in ``out``.
    """
    for n in range(0, width, LANES):
        i = at + np.uintp(n)
        value = spread(np.float32(weights[0])) * load(a, i)
        for k in range(1, len(weights)):
            i += np.uintp(width)
            value += spread(np.float32(weights[k])) * load(a, i)
        store(out, np.uintp(n), value)


@inlined
def add_difference_columns(
    images: Any, samples: Any, at: Any, width: Any, g: Any, line: Any, first: int, count: int, rows: Any, out: Any
) -> None:  # fmt: skip
    """Add ``count`` rows of a ZOI to the column sums of the difference d = g - raw, ``out`` (16, line).

    In this order: w P_j d f_x and w P_j d f_y (j = 0 .. 3), w P_j d f and w P_j d (j = 0, 1), w d times the sum of f
    left and right, the sum above and below, the difference of the corners, and w d^2. Differences in place of second
    derivatives in images of their own, which would be three more to read: 20 % slower.

    Parameters
    ----------
    images : flat float32
        f_x, f_y, f, raw, each of ``samples`` values with ``width`` a row; the rows start ``at`` a place in each, and
        f goes on around them by a pixel.
    g : flat float32 with ``line`` samples a row, in whole vectors
    first : which of the rows of the ZOI is the first
    rows : (4, >= size) float32, w(y) P_j(y)
    """
    fy, f, raw = samples, np.uintp(2) * samples, np.uintp(3) * samples
    one = np.uintp(1)
    for n in range(0, np.intp(line), LANES):
        k = np.uintp(n)
        x0 = load(out, k)
        x1 = load(out, k + line)
        x2 = load(out, k + np.uintp(2) * line)
        x3 = load(out, k + np.uintp(3) * line)
        y0 = load(out, k + np.uintp(4) * line)
        y1 = load(out, k + np.uintp(5) * line)
        y2 = load(out, k + np.uintp(6) * line)
        y3 = load(out, k + np.uintp(7) * line)
        f0 = load(out, k + np.uintp(8) * line)
        f1 = load(out, k + np.uintp(9) * line)
        d0 = load(out, k + np.uintp(10) * line)
        d1 = load(out, k + np.uintp(11) * line)
        xx = load(out, k + np.uintp(12) * line)
        yy = load(out, k + np.uintp(13) * line)
        xy = load(out, k + np.uintp(14) * line)
        energy = load(out, k + np.uintp(15) * line)
        i = at + k
        j = k
        here = i + f
        # Of f in the row above, in this one and in the one below: its value, and sum and difference of both neighbours.
        above = load(images, here - width)
        value = load(images, here)
        slope_above = load(images, here - width + one) - load(images, here - width - one)
        left, right = load(images, here - one), load(images, here + one)
        beside, slope = left + right, right - left
        for row in range(first, first + count):
            y = np.uintp(row)
            here += width
            below = load(images, here)
            left = load(images, here - one)
            right = load(images, here + one)
            slope_below = right - left
            w0 = spread(rows[0, y])
            w1 = spread(rows[1, y])
            w2 = spread(rows[2, y])
            w3 = spread(rows[3, y])
            d = load(g, j) - load(images, i + raw)
            t = d * load(images, i)
            x0 += w0 * t
            x1 += w1 * t
            x2 += w2 * t
            x3 += w3 * t
            t = d * load(images, i + fy)
            y0 += w0 * t
            y1 += w1 * t
            y2 += w2 * t
            y3 += w3 * t
            t = d * value
            f0 += w0 * t
            f1 += w1 * t
            t = w0 * d
            d0 += t
            d1 += w1 * d
            xx += t * beside
            yy += t * (above + below)
            xy += t * (slope_below - slope_above)
            beside = left + right
            above = value
            value = below
            slope_above = slope
            slope = slope_below
            energy += t * d
            i += width
            j += line
        store(out, k, x0)
        store(out, k + line, x1)
        store(out, k + np.uintp(2) * line, x2)
        store(out, k + np.uintp(3) * line, x3)
        store(out, k + np.uintp(4) * line, y0)
        store(out, k + np.uintp(5) * line, y1)
        store(out, k + np.uintp(6) * line, y2)
        store(out, k + np.uintp(7) * line, y3)
        store(out, k + np.uintp(8) * line, f0)
        store(out, k + np.uintp(9) * line, f1)
        store(out, k + np.uintp(10) * line, d0)
        store(out, k + np.uintp(11) * line, d1)
        store(out, k + np.uintp(12) * line, xx)
        store(out, k + np.uintp(13) * line, yy)
        store(out, k + np.uintp(14) * line, xy)
        store(out, k + np.uintp(15) * line, energy)


@inlined
def difference_moments(columns: Any, rows: Any, line: int, out: Any) -> Any:
    """From column sums to out[channel, j, i] = sum of w P_i(x) P_j(y) d channel; returns the sum of w d^2.

    Each channel below its degree of ``DEGREES_OF``; ``rows`` (4, line) is w(x) P_i(x).
    """
    across = np.uintp(columns.shape[1])
    length = np.uintp(rows.shape[1])
    place = np.uintp(0)
    for channel in range(CHANNELS):
        degrees = DEGREES_OF[channel]
        for j in range(degrees):
            for i in range(degrees - j):
                out[channel, j, i] = dot(columns, place, rows, np.uintp(i) * length, line)
            place += across
    for channel in (4, 5):
        out[channel, 0, 0] -= 2 * out[2, 0, 0]
    out[6, 0, 0] /= 4
    return dot(columns, place, rows, np.uintp(0), line)


@helper
def _product_columns(
    a: Any, i: Any, down_a: Any, b: Any, j: Any, down_b: Any, size: int, line: Any,
    under_w: Any, under_q: Any, out: Any,
) -> None:  # fmt: skip
    """Column sums of a b, from ``i`` and ``j`` on, rows ``down_a`` and ``down_b`` apart: (11, line)."""
    for n in range(0, np.intp(line), LANES):
        k = np.uintp(n)
        w0 = w1 = w2 = w3 = w4 = w5 = q0 = q1 = q2 = q3 = q4 = spread(np.float32(0))
        p = i + k
        q = j + k
        for row in range(size):
            t = load(a, p) * load(b, q)
            w0 += t * spread(under_w[0, row])
            w1 += t * spread(under_w[1, row])
            w2 += t * spread(under_w[2, row])
            w3 += t * spread(under_w[3, row])
            w4 += t * spread(under_w[4, row])
            w5 += t * spread(under_w[5, row])
            q0 += t * spread(under_q[0, row])
            q1 += t * spread(under_q[1, row])
            q2 += t * spread(under_q[2, row])
            q3 += t * spread(under_q[3, row])
            q4 += t * spread(under_q[4, row])
            p += down_a
            q += down_b
        for value in (w0, w1, w2, w3, w4, w5, q0, q1, q2, q3, q4):
            store(out, k, value)
            k += line


@helper
def product_moments(
    a: Any, b: Any, last: Any, last_at: Any, last_down: Any, one: Any, samples: Any, at: Any, width: Any, size: int,
    under_w: Any, under_q: Any, order: int, columns: Any, of_w: Any, of_q: Any,
) -> None:  # fmt: skip
    """Sums of the window and of its square times eta^y xi^x a b, written to [product, y, x].

    Up to y + x = 3 + order under the window, 2 order under its square.

    Parameters
    ----------
    a, b : flat float32
        f_x, f_y, f, (not read,) f_xx, f_yy, f_xy, each of ``samples`` values; the ZOI starts ``at`` a place in each,
        rows are ``width`` apart.
    last, one : flat float32
        The fourth channel of ``a``, from ``last_at`` on with rows ``last_down`` apart, and of ``b``: a line of ones.
    under_w, under_q : (6, line) and (5, line) float32
        Window and squared window times powers of xi (the same along y); ``line`` in whole vectors.
    columns : (11, line) float32, for use here
    """
    line = np.uintp(under_w.shape[1])
    for n in range(N_PRODUCTS):
        first, second = _PAIRS[n]
        left, i, down_a = a, at + np.uintp(first) * samples, width
        right, j, down_b = b, at + np.uintp(second) * samples, width
        if first == 3:
            left, i, down_a = last, last_at, last_down
        if second == 3:
            right, j, down_b = one, np.uintp(0), np.uintp(0)
        _product_columns(left, i, down_a, right, j, down_b, size, line, under_w, under_q, columns)
        for y in range(4 + order):
            for x in range(4 + order - y):
                of_w[n, y, x] = dot(columns, np.uintp(y) * line, under_w, np.uintp(x) * line, np.intp(line))
        for y in range(2 * order + 1):
            row = np.uintp(PRODUCT_ROWS + y) * line
            for x in range(2 * order + 1 - y):
                of_q[n, y, x] = dot(columns, row, under_q, np.uintp(x) * line, np.intp(line))


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

    ``m[product, l, k]`` are the sums of w eta^l xi^k times the products of the channels (``product_moments``).
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
def bent(s: Any, cross: Any, z: int, step: Any, gain: Any, units: Any, fitted: Any, cubic: Any) -> Any:
    """Sum of the squared shares, px^2, of what is left of the difference after a linear fit of ZOI ``z``.

    ``s`` (10,) are the sums with the whole difference, ``step`` (P,) and ``gain`` are the fit, ``units`` (A, 2) the
    sums of w f_x^2 and w f_y^2; ``fitted`` float32, 10 in whole vectors, is for use, ``cubic`` (A, 2) for degree 3.
    """
    weighted_rows(cross, np.uintp(z * len(step) * 2 * N_SHAPES), step, 2 * N_SHAPES, fitted)
    of_u = of_v = 0.0
    for i in range(1, N_SHAPES):
        of_u += (s[i] - fitted[i]) ** 2
        of_v += (s[N_SHAPES + i] - fitted[N_SHAPES + i]) ** 2
    by_u, by_v = 1 / (gain * units[z, 0]) ** 2, 1 / (gain * units[z, 1]) ** 2
    cubic[z, 0], cubic[z, 1] = of_u * by_u, of_v * by_v
    of_u, of_v = of_u + (s[0] - fitted[0]) ** 2, of_v + (s[N_SHAPES] - fitted[N_SHAPES]) ** 2
    return of_u * by_u + of_v * by_v
