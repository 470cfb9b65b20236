"""Where the rows of a deformed ZOI lie in the deformed image, and where they have to be cut. Compiled.

Both fractions of the position vary slowly along a row. The taps of a vector of pixels lie side by side in
memory while the integer parts stay, so a row is cut where they change; from row to row of the image
it may pass if it leans little, and is then cut into vectors: such a vector takes seven or eight rows of taps, with
weights that shift by a tap from lane to lane. A frame at 5 degrees takes 1.4 times as long as one without rotation;
cut at every row it took twice as long (Xeon with AVX-512, November 2026).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from analysis.compiled.loops import helper, inlined, part
from analysis.compiled.vectors import LANES

ROWS = 32
"""Rows that are warped and summed before the next: few enough for the first-level cache."""
MAX_ROWS_PASSED = 2
"""Rows of the image that a vector of pixels may pass."""


@helper
def displacement(p: Any, order: int, x: Any, y: Any) -> Any:
    """(u, v) in px at (x, y) px from the centre."""
    if order == 1:
        return p[0] + p[1] * x + p[2] * y, p[3] + p[4] * x + p[5] * y
    u = p[0] + p[1] * x + p[2] * y + p[3] * x * x + p[4] * x * y + p[5] * y * y
    v = p[6] + p[7] * x + p[8] * y + p[9] * x * x + p[10] * x * y + p[11] * y * y
    return u, v


@helper
def inside(x: Any, y: Any, left: Any, right: Any, top: Any, bottom: Any) -> Any:
    """Whether a position lies in the rectangle; False for NaN."""
    return left <= x <= right and top <= y <= bottom


@part
def new_plan(size: int) -> Any:
    """Arrays for ``plan_rows`` (starts, taus) and for ``warp_cut_rows`` (where, how)."""
    return (
        np.empty(size, np.int64), np.empty((2, size), np.float32),
        np.empty((ROWS * size, 3), np.int64), np.empty((ROWS * size, 4), np.float32),
    )  # fmt: skip


@inlined
def plan_rows(p: Any, x: Any, y: Any, size: int, stride: int, starts: Any, taus: Any) -> bool:
    """Where each row of a ZOI of order 1 begins in ``c``; False if not every row is in one piece.

    All rows are planned ahead, since the processor cannot prefetch beyond the row that it computes.

    Parameters
    ----------
    x, y : position of the first pixel, px from the first sample of ``c``
    starts : (>= size,) int64, written: index of the first of the 36 taps of the first pixel
    taus : (2, >= size) float32, written: fractions less 1/2
    """
    last = size - 1
    end_x = last * p[1]
    end_y = last * p[4]
    inside_x = inside_y = True
    for row in range(size):
        xr = x + row * p[2]
        yr = y + row * (1 + p[5])
        ix = np.intp(xr)  # positive, so this is the floor
        iy = np.intp(yr)
        fx = xr - ix
        fy = yr - iy
        inside_x &= (fx + end_x >= 0.0) & (fx + end_x < 1.0)
        inside_y &= (fy + end_y >= 0.0) & (fy + end_y < 1.0)
        starts[row] = (iy - 2) * stride + ix - 2
        taus[0, row] = fx - 0.5
        taus[1, row] = fy - 0.5
    return inside_x and inside_y


@inlined
def _append(
    first: int, at: int, length: int, fx: Any, x_slope: Any, fy: Any, y_slope: Any, n: int, where: Any, how: Any
) -> int:  # fmt: skip
    """Write piece ``n``: first of the taps, place, length, fractions and their slopes; returns the next number."""
    where[n, 0] = first
    where[n, 1] = at
    where[n, 2] = length
    how[n, 0] = fx - 0.5
    how[n, 1] = x_slope
    how[n, 2] = fy - 0.5
    how[n, 3] = y_slope
    return n + 1


@helper
def cut_row(
    stride: int, size: int, x: Any, drift: Any, inverse_x: Any, y: Any, slope: Any, inverse_y: Any, at: int,
    n: int, where: Any, how: Any,
) -> int:  # fmt: skip
    """Append the pieces of a straight row to the list of ``n`` and return their new number.

    The row runs along X = x + (1 + drift) k, Y = y + slope k, k = 0 .. size-1, and is written from ``at``
    on; the inverses are those of drift and slope (``inverse_slope``).
    """
    edge_x = 1.0 if inverse_x > 0 else 0.0
    edge_y = 1.0 if inverse_y > 0 else 0.0
    k = 0
    while k < size:
        xk = x + k * drift
        yk = y + k * slope
        ix = math.floor(xk)
        iy = math.floor(yk)
        fx = xk - ix
        fy = yk - iy
        # A pixel that lies just on the edge is exact with the taps of either side.
        way: Any = min((edge_x - fx) * inverse_x, (edge_y - fy) * inverse_y)
        length: Any = min(np.intp(min(way, 1.0 * size)) + 1, size - k)
        n = _append((iy - 2) * stride + ix + k - 2, at + k, length, fx, drift, fy, slope, n, where, how)
        k += length
    return n


@helper
def cut_leaning_row(
    stride: int, size: int, x: Any, drift: Any, inverse_x: Any, y: Any, slope: Any, at: int,
    n: int, where: Any, how: Any,
) -> int:  # fmt: skip
    """``cut_row`` into pieces of a vector at most, of which Y may pass from row to row."""
    edge_x = 1.0 if inverse_x > 0 else 0.0
    k = 0
    while k < size:
        xk = x + k * drift
        yk = y + k * slope
        ix = math.floor(xk)
        fx = xk - ix
        length: Any = min(np.intp(min((edge_x - fx) * inverse_x, 1.0 * size)) + 1, LANES, size - k)
        iy = math.floor(min(yk, yk + (length - 1) * slope))
        n = _append((iy - 2) * stride + ix + k - 2, at + k, length, fx, drift, yk - iy, slope, n, where, how)
        k += length
    return n


@inlined
def inverse_slope(slope: Any) -> Any:
    """1/slope; where there is none, what makes any way long."""
    return 1 / slope if abs(slope) > 1e-12 else 1e12


@part
def _bent_length(
    count: int, x: Any, x1: Any, x2: Any, ix: Any, y: Any, y1: Any, y2: Any, iy: Any
) -> int:  # fmt: skip
    """Pixels from the first of a bent row on, ``count`` at most, until an integer part changes."""
    length = 1
    while length < count:
        xe = x + length * (x1 - 1 + length * x2)
        ye = y + length * (y1 + length * y2)
        if not (ix <= xe < ix + 1 and iy <= ye < iy + 1):
            break
        length += 1
    return length


@helper
def cut_bent_row(
    stride: int, size: int, x: Any, x1: Any, x2: Any, y: Any, y1: Any, y2: Any, at: int,
    n: int, where: Any, how: Any,
) -> int:  # fmt: skip
    """``cut_row`` for a row along X = x + x1 k + x2 k^2, Y = y + y1 k + y2 k^2."""
    k = 0
    while k < size:
        xk, yk = x + k * (x1 + k * x2), y + k * (y1 + k * y2)
        ix, iy = math.floor(xk), math.floor(yk)
        rest = size - 1 - k
        last = size - 1
        xe, ye = x + last * (x1 + last * x2) - rest, y + last * (y1 + last * y2)
        # A parabola leaves the span of its ends by a quarter of its bend at most.
        bow_x, bow_y = abs(x2) * rest * rest / 4, abs(y2) * rest * rest / 4
        if (
            ix <= min(xk, xe) - bow_x and max(xk, xe) + bow_x < ix + 1
            and iy <= min(yk, ye) - bow_y and max(yk, ye) + bow_y < iy + 1
        ):  # fmt: skip
            length = rest + 1
        else:
            length = _bent_length(size - k, xk, x1 + 2 * k * x2, x2, ix, yk, y1 + 2 * k * y2, y2, iy)
        first = (iy - 2) * stride + ix - 2
        x_slope, y_slope = x1 - 1 + 2 * k * x2, y1 + 2 * k * y2
        n = _append(first, at + k, length, xk - ix, x_slope, yk - iy, y_slope, n, where, how)
        k += length
    return n
