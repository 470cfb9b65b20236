"""The deformed image as a spline, and rows of it along a deformed line: compiled loops.

One kind of warp for all motions: the full 6 x 6 taps of the tensor-product spline, with the
fraction of every pixel. Both fractions vary slowly along a row of a ZOI, so a row is cut only
where an integer part changes and each piece is one vectorised loop over contiguous memory.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import prange
from numpy.typing import NDArray

from analysis.compiled import helper, inlined, parallel
from analysis.splines import PAD, PREFILTER_REACH

f4 = np.float32
_one, _two, _three, _four, _five = (np.uintp(i) for i in range(1, 6))
LANES = 8
"""Rows are warped in multiples of this; what is written too much is overwritten or never read."""


@helper
def _mirror(i: int, n: int) -> int:
    """Index i reflected about the first and last of n samples, which are not repeated."""
    if n == 1:
        return 0
    period = 2 * (n - 1)
    i = abs(i) % period
    return min(i, period - i)


@parallel
def coefficients(image: NDArray[np.float32], offset: Any, taps: NDArray[np.float32]) -> Any:
    """Spline coefficients of ``image - offset``, mirrored PAD pixels beyond each edge.

    Returns (H + 2 PAD, W + 2 PAD) float32. ``taps`` is one side of the symmetric prefilter.
    """
    height, width = image.shape
    reach = PREFILTER_REACH
    along_x = np.empty((height, width), np.float32)
    out = np.empty((height + 2 * PAD, width + 2 * PAD), np.float32)
    for y in prange(height):
        line = np.empty(width + 2 * reach, np.float32)
        for x in range(width):
            line[x + reach] = image[y, x] - offset
        for x in range(reach):
            line[x] = image[y, _mirror(x - reach, width)] - offset
            line[width + reach + x] = image[y, _mirror(width + x, width)] - offset
        _filter_line(line, taps, along_x[y])
    for y in prange(height):
        total = out[y + PAD, PAD : PAD + width]
        centre = along_x[y]
        for x in range(width):
            total[x] = taps[0] * centre[x]
        for k in range(1, reach + 1):
            _add_pair(total, taps[k], along_x[_mirror(y - k, height)], along_x[_mirror(y + k, height)])
        for x in range(PAD):
            out[y + PAD, x] = out[y + PAD, PAD + _mirror(x - PAD, width)]
            out[y + PAD, PAD + width + x] = out[y + PAD, PAD + _mirror(width + x, width)]
    for y in range(PAD):
        out[y] = out[PAD + _mirror(y - PAD, height)]
        out[PAD + height + y] = out[PAD + _mirror(height + y, height)]
    return out


@helper
def _filter_line(line: Any, taps: Any, out: Any) -> None:
    for x in range(out.size):
        c = np.uintp(x + PREFILTER_REACH)
        total = taps[0] * line[c]
        for k in range(1, PREFILTER_REACH + 1):
            total += taps[k] * (line[c - np.uintp(k)] + line[c + np.uintp(k)])
        out[x] = total


@helper
def _add_pair(total: Any, factor: Any, above: Any, below: Any) -> None:
    for x in range(total.size):
        total[x] += factor * (above[x] + below[x])


@inlined
def _weights(tau: Any, t: Any) -> Any:
    """The six tap weights at tau = fraction - 1/2, from ``splines.tap_table``."""
    s = tau * tau
    e0 = t[0] + s * (t[2] + s * t[4])
    o0 = tau * (t[1] + s * (t[3] + s * t[5]))
    e1 = t[6] + s * (t[8] + s * t[10])
    o1 = tau * (t[7] + s * (t[9] + s * t[11]))
    e2 = t[12] + s * (t[14] + s * t[16])
    o2 = tau * (t[13] + s * (t[15] + s * t[17]))
    return e0 - o0, e1 - o1, e2 - o2, e2 + o2, e1 + o1, e0 + o0


@inlined
def _taps(c: Any, i: Any, a0: Any, a1: Any, a2: Any, a3: Any, a4: Any, a5: Any) -> Any:
    left = a0 * c[i] + a1 * c[i + _one] + a2 * c[i + _two]
    return left + a3 * c[i + _three] + a4 * c[i + _four] + a5 * c[i + _five]


@inlined
def _warp_piece(
    c: Any, stride: Any, first: Any, count: int, ramp: Any,
    x0: Any, x1: Any, x2: Any, y0: Any, y1: Any, y2: Any, table: Any, out: Any, at: Any,
) -> None:  # fmt: skip
    """``count`` pixels whose third tap advances by exactly one column each.

    tau_x = x0 + x1 k + x2 k^2 for pixel k, tau_y likewise; ``first`` is the flat index of the
    first of the 36 taps of pixel 0. Unsigned indices, since signed ones keep LLVM from vectors.
    """
    r0 = first
    r1 = r0 + stride
    r2 = r1 + stride
    r3 = r2 + stride
    r4 = r3 + stride
    r5 = r4 + stride
    for n in range(count):
        k = np.uintp(n)
        t = ramp[k]
        a0, a1, a2, a3, a4, a5 = _weights(x0 + t * (x1 + t * x2), table)
        b0, b1, b2, b3, b4, b5 = _weights(y0 + t * (y1 + t * y2), table)
        total = b0 * _taps(c, r0 + k, a0, a1, a2, a3, a4, a5)
        total += b1 * _taps(c, r1 + k, a0, a1, a2, a3, a4, a5)
        total += b2 * _taps(c, r2 + k, a0, a1, a2, a3, a4, a5)
        total += b3 * _taps(c, r3 + k, a0, a1, a2, a3, a4, a5)
        total += b4 * _taps(c, r4 + k, a0, a1, a2, a3, a4, a5)
        total += b5 * _taps(c, r5 + k, a0, a1, a2, a3, a4, a5)
        out[at + k] = total


@inlined
def _steps_until(offset: Any, slope: Any, limit: int) -> Any:
    """How many pixels until ``offset + slope k`` leaves [0, 1); at least 1, at most ``limit``."""
    if slope > 0:
        room = (1.0 - offset) / slope
    elif slope < 0:
        room = -offset / slope
    else:
        return limit
    if room >= limit:
        return limit
    return max(1, math.ceil(room))


@helper
def _piece_length(fx: Any, x1: Any, x2: Any, fy: Any, y1: Any, y2: Any, left: int) -> Any:
    """Pixels until one of the two integer parts changes along a row (drift beyond one a pixel)."""
    if x2 == 0.0 and y2 == 0.0:
        return min(_steps_until(fx, x1, left), _steps_until(fy, y1, left))
    for k in range(1, left):
        x = fx + k * (x1 + k * x2)
        y = fy + k * (y1 + k * y2)
        if x < 0.0 or x >= 1.0 or y < 0.0 or y >= 1.0:
            return k
    return left


@inlined
def warp_row(
    c: Any, stride: int, size: int, ramp: Any,
    x: Any, x1: Any, x2: Any, y: Any, y1: Any, y2: Any, table: Any, out: Any, at: int,
) -> None:  # fmt: skip
    """The image along X = x + x1 k + x2 k^2, Y = y + y1 k + y2 k^2, k = 0 .. size-1.

    ``c`` is flat, X and Y count from its own first sample; the caller has made sure that all
    positions lie inside. ``out`` is written from ``at`` on and has room for LANES more than ``size``.
    """
    ix = math.floor(x)
    iy = math.floor(y)
    fx = x - ix
    fy = y - iy
    drift = x1 - 1.0
    last = size - 1
    if x2 == 0.0 and y2 == 0.0 and 0.0 <= fx + last * drift < 1.0 and 0.0 <= fy + last * y1 < 1.0:
        count = (size + LANES - 1) // LANES * LANES
        _warp_piece(
            c, np.uintp(stride), np.uintp((iy - 2) * stride + ix - 2), count, ramp,
            f4(fx - 0.5), f4(drift), f4(0), f4(fy - 0.5), f4(y1), f4(0), table, out, np.uintp(at),
        )  # fmt: skip
        return
    _warp_in_pieces(c, stride, size, ramp, x, x1, x2, y, y1, y2, table, out, at)


@helper
def _warp_in_pieces(
    c: Any, stride: int, size: int, ramp: Any,
    x: Any, x1: Any, x2: Any, y: Any, y1: Any, y2: Any, table: Any, out: Any, at: int,
) -> None:  # fmt: skip
    """``warp_row`` where an integer part changes inside the row."""
    k = 0
    drift = x1 - 1.0
    while k < size:
        xk = x + k * (x1 + k * x2)
        yk = y + k * (y1 + k * y2)
        ix = math.floor(xk)
        iy = math.floor(yk)
        fx = xk - ix
        fy = yk - iy
        sx = drift + 2.0 * k * x2
        sy = y1 + 2.0 * k * y2
        length = _piece_length(fx, sx, x2, fy, sy, y2, size - k)
        count = (length + LANES - 1) // LANES * LANES
        _warp_piece(
            c, np.uintp(stride), np.uintp((iy - 2) * stride + ix - 2), count, ramp,
            f4(fx - 0.5), f4(sx), f4(x2), f4(fy - 0.5), f4(sy), f4(y2), table, out, np.uintp(at + k),
        )  # fmt: skip
        k += length


@helper
def inside(x: Any, y: Any, left: Any, right: Any, top: Any, bottom: Any) -> Any:
    """Whether a position lies in the rectangle; False for NaN."""
    return left <= x <= right and top <= y <= bottom
