"""The moments that the fit and the shapes are made of: sums over w(x) w(y) P_i(x) P_j(y) of some image. Compiled.

A vector of columns is summed down the rows with w(y) P_j(y) in registers, and what comes out, a few rows, is multiplied
with w(x) P_i(x) at the end. A sum across a vector is so needed once a moment, not once a row: 0.8 us a ZOI of 32 px in
place of 1.2, and a third of the time to prepare a reference (one core, Xeon with AVX-512, November 2026). ZOIs that
begin in the same row have their columns in common.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from analysis.compiled.loops import helper, inlined, part
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
_OF_CHANNEL = ((1, 1, 1, 1, 0, 0, 0), (2, 2, 1, 1, 0, 0, 0))
DEGREES_OF_PAIR = np.array(
    [[((3 if i < 2 else d[i]) + d[j], d[i] + d[j]) for i, j in _PAIRS] for d in _OF_CHANNEL]
)
"""By order and product, the degree that is needed of its sums under the window and under its square: up to that of both
columns of J, and of one with the shapes, which f_x and f_y alone have."""
PRODUCT_ROWS, SQUARE_ROWS = 6, 5
"""Column sums of a product under the window (eta^0 .. eta^5) and under its square (eta^0 .. eta^4)."""


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
    images: Any, samples: Any, at: Any, width: Any, g: Any, begin: Any, line: Any, length: int, first: int,
    count: int, rows: Any, out: Any,
) -> None:  # fmt: skip
    """Add ``count`` rows of a ZOI, or of some side by side, to the column sums of the difference d = g - raw.

    ``length`` columns, to ``out`` (16, line).

    In this order: w P_j d f_x and w P_j d f_y (j = 0 .. 3), w P_j d f and w P_j d (j = 0, 1), w d times the sum of f
    left and right, the sum above and below, the difference of the corners, and w d^2. Differences in place of second
    derivatives in images of their own, which would be three more to read: 20 % slower.

    Parameters
    ----------
    images : flat float32
        f_x, f_y, f, raw, each of ``samples`` values with ``width`` a row; the rows start ``at`` a place in each, and
        f goes on around them by a pixel.
    g : flat float32 with ``line`` samples a row, in whole vectors; the rows start at ``begin``
    first : which of the rows of the ZOI is the first
    rows : (4, >= size) float32, w(y) P_j(y)
    """
    fy, f, raw = samples, np.uintp(2) * samples, np.uintp(3) * samples
    one = np.uintp(1)
    for n in range(0, length, LANES):
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
        j = begin + k
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
def difference_moments(columns: Any, place: Any, rows: Any, line: int, out: Any) -> Any:
    """From column sums to out[channel, j, i] = sum of w P_i(x) P_j(y) d channel; returns the sum of w d^2.

    Each channel below its degree of ``DEGREES_OF``; ``rows`` (4, line) is w(x) P_i(x). The ZOI begins at column
    ``place`` (uintp).
    """
    across = np.uintp(columns.shape[1])
    length = np.uintp(rows.shape[1])
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


@inlined
def _columns_of(
    a: Any, i: Any, down_a: Any, b: Any, j: Any, down_b: Any, size: int, wide: int,
    under_w: Any, under_q: Any, out: Any, degrees: int,
) -> None:  # fmt: skip
    """``_product_columns`` for ``degrees`` of 0: eta^2 at most, 1: eta^4 under w, 2: all."""
    line = np.uintp(out.shape[1])
    for n in range(0, wide, LANES):
        k = np.uintp(n)
        w0 = w1 = w2 = w3 = w4 = w5 = q0 = q1 = q2 = q3 = q4 = spread(np.float32(0))
        p = i + k
        q = j + k
        for row in range(size):
            t = load(a, p) * load(b, q)
            w0 += t * spread(under_w[0, row])
            w1 += t * spread(under_w[1, row])
            w2 += t * spread(under_w[2, row])
            q0 += t * spread(under_q[0, row])
            q1 += t * spread(under_q[1, row])
            q2 += t * spread(under_q[2, row])
            if degrees > 0:
                w3 += t * spread(under_w[3, row])
                w4 += t * spread(under_w[4, row])
            if degrees > 1:
                w5 += t * spread(under_w[5, row])
                q3 += t * spread(under_q[3, row])
                q4 += t * spread(under_q[4, row])
            p += down_a
            q += down_b
        for value in (w0, w1, w2, w3, w4, w5, q0, q1, q2, q3, q4):
            store(out, k, value)
            k += line


@part
def _product_columns(
    a: Any, i: Any, down_a: Any, b: Any, j: Any, down_b: Any, size: int, wide: int,
    under_w: Any, under_q: Any, out: Any, degrees: int,
) -> None:  # fmt: skip
    """Column sums of a b, from ``i`` and ``j`` on, rows ``down_a`` and ``down_b`` apart: (11, >= wide)."""
    if degrees == 0:
        _columns_of(a, i, down_a, b, j, down_b, size, wide, under_w, under_q, out, 0)
    elif degrees == 1:
        _columns_of(a, i, down_a, b, j, down_b, size, wide, under_w, under_q, out, 1)
    else:
        _columns_of(a, i, down_a, b, j, down_b, size, wide, under_w, under_q, out, 2)


@helper
def product_moments(
    a: Any, b: Any, last: Any, last_at: Any, last_down: Any, one: Any, samples: Any, at: Any, width: Any, size: int,
    places: Any, under_w: Any, under_q: Any, order: int, columns: Any, of_w: Any, of_q: Any,
) -> None:  # fmt: skip
    """Sums of the window and of its square times eta^y xi^x a b, written to [zoi, product, y, x], as far as needed.

    To the degrees of ``DEGREES_OF_PAIR``. Of ZOIs that begin in one row, whose columns are summed once.

    Parameters
    ----------
    a, b : flat float32
        f_x, f_y, f, (not read,) f_xx, f_yy, f_xy, each of ``samples`` values; the first ZOI starts ``at`` a place in
        each, rows are ``width`` apart.
    last, one : flat float32
        The fourth channel of ``a``, from ``last_at`` on with rows ``last_down`` apart, and of ``b``: a line of ones.
    places : (N,) uintp, px
        Columns from the first ZOI to each, in order.
    under_w, under_q : (6, line) and (5, line) float32
        Window and squared window times powers of xi (the same along y); ``line`` in whole vectors.
    columns : (11, >= places[-1] + line) float32, for use here
    """
    line = np.uintp(under_w.shape[1])
    across = np.uintp(columns.shape[1])
    wide = np.intp(places[len(places) - 1]) + np.intp(line)
    for n in range(N_PRODUCTS):
        first, second = _PAIRS[n]
        left, i, down_a = a, at + np.uintp(first) * samples, width
        right, j, down_b = b, at + np.uintp(second) * samples, width
        if first == 3:
            left, i, down_a = last, last_at, last_down
        if second == 3:
            right, j, down_b = one, np.uintp(0), np.uintp(0)
        many = order if first < 2 else 0
        _product_columns(left, i, down_a, right, j, down_b, size, wide, under_w, under_q, columns, many)
        most_w, most_q = DEGREES_OF_PAIR[order - 1, n]
        for z in range(len(places)):
            for y in range(most_w + 1):
                for x in range(most_w + 1 - y):
                    row = np.uintp(y) * across + places[z]
                    of_w[z, n, y, x] = dot(columns, row, under_w, np.uintp(x) * line, np.intp(line))
            for y in range(most_q + 1):
                row = np.uintp(PRODUCT_ROWS + y) * across + places[z]
                for x in range(most_q + 1 - y):
                    of_q[z, n, y, x] = dot(columns, row, under_q, np.uintp(x) * line, np.intp(line))
