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
from analysis.splines import LINE, PAD, PREFILTER_REACH
from analysis.vectors import LANES, address, further, fused, load, load_from, spread, store

f4 = np.float32
GROUP = 4 * LANES
"""Samples that are filtered at a time: one sum after the other would wait for each product."""
BAND, STRIP = 16, 2 * GROUP
"""Rows and columns that are filtered along y at a time, so that a row is read once from afar, not 31 times."""
PART, RING = 128, BAND + 2 * PREFILTER_REACH
"""Rows that one thread filters one after the other, and how many of them it keeps filtered along x."""
ROWS = 16
"""Rows that are warped and summed before the next: few enough for the first-level cache."""
_lanes = np.uintp(LANES)
_zero, _one, _two, _three, _four, _five = (np.uintp(i) for i in range(6))


@helper
def _mirror(i: int, n: int) -> int:
    """Index i reflected about the first and last of n samples, which are not repeated."""
    if n == 1:
        return 0
    period = 2 * (n - 1)
    i = abs(i) % period
    return min(i, period - i)


@parallel
def coefficients(image: NDArray[Any], offset: Any, taps: NDArray[np.float32]) -> Any:
    """Spline coefficients of ``image - offset`` (uint8, uint16 or float32), mirrored PAD pixels beyond each edge.

    Returns flat float32: (H + 2 PAD) rows of W + 2 PAD, and a vector more than that. ``taps`` is one
    side of the symmetric prefilter. A part of the image is filtered along x and y in one go, so that
    what lies between stays in the cache.
    """
    height, width = image.shape
    stride = width + 2 * PAD
    across = (width + GROUP - 1) // GROUP * GROUP
    out = np.empty((height + 2 * PAD) * stride + LANES, np.float32)
    out[out.size - LANES :] = 0
    for part in prange((height + PART - 1) // PART):
        line = np.zeros(across + 2 * PREFILTER_REACH, np.float32)
        # An odd number of cache lines a row, or the rows would displace each other.
        ring = np.empty((RING, across + LINE), np.float32)
        band = np.empty((BAND, across), np.float32)
        starts = np.empty(RING, np.intp)
        ahead = part * PART - PREFILTER_REACH
        last = min(part * PART + PART, height)
        for first in range(part * PART, last, BAND):
            count = min(BAND, last - first)
            for y in range(ahead, first + count + PREFILTER_REACH):
                _mirrored_line(image[_mirror(y, height)], offset, line)
                _filter_along(line, taps, ring[(y + PREFILTER_REACH) % RING, :across])
            ahead = first + count + PREFILTER_REACH
            for i in range(RING):
                starts[i] = (first + i) % RING * ring.shape[1]
            for x in range(0, across, STRIP):
                for y in range(count):
                    _filter_across(ring, starts[y:], x, min(x + STRIP, across), taps, band[y])
            for y in range(count):
                row = out[(first + y + PAD) * stride : (first + y + PAD + 1) * stride]
                row[PAD : PAD + width] = band[y, :width]
                for x in range(PAD):
                    row[x] = band[y, _mirror(x - PAD, width)]
                    row[PAD + width + x] = band[y, _mirror(width + x, width)]
    for y in range(PAD):
        for to, source in ((y, _mirror(y - PAD, height)), (PAD + height + y, _mirror(height + y, height))):
            source += PAD
            out[to * stride : (to + 1) * stride] = out[source * stride : (source + 1) * stride]
    return out


@helper
def _mirrored_line(row: Any, offset: Any, line: Any) -> None:
    """A row of an image less ``offset`` with ``PREFILTER_REACH`` mirrored samples before and behind it."""
    width = row.size
    for x in range(width):
        line[x + PREFILTER_REACH] = f4(row[x]) - offset
    for x in range(PREFILTER_REACH):
        line[x] = line[_mirror(x - PREFILTER_REACH, width) + PREFILTER_REACH]
        line[width + PREFILTER_REACH + x] = line[_mirror(width + x, width) + PREFILTER_REACH]


@helper
def _filter_along(line: Any, taps: Any, out: Any) -> None:
    """Symmetric filter along a line that begins ``PREFILTER_REACH`` samples before ``out``."""
    for n in range(0, out.size, GROUP):
        i = np.uintp(n + PREFILTER_REACH)
        tap = spread(taps[0])
        v0 = tap * load(line, i)
        v1 = tap * load(line, i + _lanes)
        v2 = tap * load(line, i + _two * _lanes)
        v3 = tap * load(line, i + _three * _lanes)
        for k in range(1, PREFILTER_REACH + 1):
            tap = spread(taps[k])
            p = i - np.uintp(k)
            q = i + np.uintp(k)
            v0 += tap * (load(line, p) + load(line, q))
            v1 += tap * (load(line, p + _lanes) + load(line, q + _lanes))
            v2 += tap * (load(line, p + _two * _lanes) + load(line, q + _two * _lanes))
            v3 += tap * (load(line, p + _three * _lanes) + load(line, q + _three * _lanes))
        _store_group(out, np.uintp(n), v0, v1, v2, v3)


@helper
def _filter_across(rows: Any, starts: Any, first: int, last: int, taps: Any, out: Any) -> None:
    """The same across rows of which the flat indices are given, for the columns ``first`` .. ``last``."""
    reach = PREFILTER_REACH
    for n in range(first, last, GROUP):
        i = np.uintp(starts[reach] + n)
        tap = spread(taps[0])
        v0 = tap * load(rows, i)
        v1 = tap * load(rows, i + _lanes)
        v2 = tap * load(rows, i + _two * _lanes)
        v3 = tap * load(rows, i + _three * _lanes)
        for k in range(1, reach + 1):
            tap = spread(taps[k])
            p = np.uintp(starts[reach - k] + n)
            q = np.uintp(starts[reach + k] + n)
            v0 += tap * (load(rows, p) + load(rows, q))
            v1 += tap * (load(rows, p + _lanes) + load(rows, q + _lanes))
            v2 += tap * (load(rows, p + _two * _lanes) + load(rows, q + _two * _lanes))
            v3 += tap * (load(rows, p + _three * _lanes) + load(rows, q + _three * _lanes))
        _store_group(out, np.uintp(n), v0, v1, v2, v3)


@inlined
def _store_group(out: Any, n: Any, v0: Any, v1: Any, v2: Any, v3: Any) -> None:
    store(out, n, v0)
    store(out, n + _lanes, v1)
    store(out, n + _two * _lanes, v2)
    store(out, n + _three * _lanes, v3)


@inlined
def _weights(tau: Any, t: Any) -> Any:
    """The six tap weights at tau = fraction - 1/2; ``t`` is the spread table."""
    s = tau * tau
    zero = spread(f4(0))
    e0 = spread(t[0]) + s * (spread(t[2]) + s * spread(t[4]))
    o0 = spread(t[1]) + s * (spread(t[3]) + s * spread(t[5]))
    e1 = spread(t[6]) + s * (spread(t[8]) + s * spread(t[10]))
    o1 = spread(t[7]) + s * (spread(t[9]) + s * spread(t[11]))
    e2 = spread(t[12]) + s * (spread(t[14]) + s * spread(t[16]))
    o2 = spread(t[13]) + s * (spread(t[15]) + s * spread(t[17]))
    other = zero - tau
    return (
        fused(other, o0, e0), fused(other, o1, e1), fused(other, o2, e2),
        fused(tau, o2, e2), fused(tau, o1, e1), fused(tau, o0, e0),
    )  # fmt: skip


@inlined
def _taps(r: Any, a: Any) -> Any:
    left = a[0] * load_from(r, _zero) + a[1] * load_from(r, _one) + a[2] * load_from(r, _two)
    return left + (a[3] * load_from(r, _three) + a[4] * load_from(r, _four) + a[5] * load_from(r, _five))


@inlined
def _pixels(c: Any, stride: Any, first: Any, tau_x: Any, tau_y: Any, t: Any) -> Any:
    """A vector of pixels; ``first`` is the flat index of the first of the 36 taps of its first pixel."""
    a = _weights(tau_x, t)
    b = _weights(tau_y, t)
    row = address(c, first)
    value = b[0] * _taps(row, a)
    row = further(row, stride)
    value += b[1] * _taps(row, a)
    row = further(row, stride)
    value += b[2] * _taps(row, a)
    row = further(row, stride)
    value += b[3] * _taps(row, a)
    row = further(row, stride)
    value += b[4] * _taps(row, a)
    row = further(row, stride)
    return value + b[5] * _taps(row, a)


@helper
def _cut_row(
    stride: int, size: int, x: Any, drift: Any, inverse_x: Any, y: Any, slope: Any, inverse_y: Any, at: int,
    n: int, where: Any, how: Any,
) -> int:  # fmt: skip
    """Append the pieces of a straight row to the list of ``n`` and return their new number.

    The row runs along X = x + (1 + drift) k, Y = y + slope k, k = 0 .. size-1, and is written from ``at``
    on; the inverses are those of drift and slope (``_inverse``).
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
        room: Any = min((edge_x - fx) * inverse_x, (edge_y - fy) * inverse_y)
        length: Any = min(np.intp(min(room, 1.0 * size)) + 1, size - k)
        where[n, 0] = (iy - 2) * stride + ix + k - 2
        where[n, 1] = at + k
        where[n, 2] = length
        how[n, 0] = fx - 0.5
        how[n, 1] = drift
        how[n, 2] = fy - 0.5
        how[n, 3] = slope
        n += 1
        k += length
    return n


@inlined
def _inverse(slope: Any) -> Any:
    """1/slope; where there is none, what makes any way long."""
    return 1 / slope if abs(slope) > 1e-12 else 1e12


@helper
def _cut_bent_row(
    stride: int, size: int, x: Any, x1: Any, x2: Any, y: Any, y1: Any, y2: Any, at: int,
    n: int, where: Any, how: Any,
) -> int:  # fmt: skip
    """The same for a row along X = x + x1 k + x2 k^2, Y = y + y1 k + y2 k^2."""
    k = 0
    while k < size:
        ix = math.floor(x + k * (x1 + k * x2))
        iy = math.floor(y + k * (y1 + k * y2))
        length = 1
        while k + length < size:
            end = k + length
            xe = x + end * (x1 + end * x2) - length
            ye = y + end * (y1 + end * y2)
            if not (ix <= xe < ix + 1 and iy <= ye < iy + 1):
                break
            length += 1
        where[n, 0] = (iy - 2) * stride + ix - 2
        where[n, 1] = at + k
        where[n, 2] = length
        how[n, 0] = x + k * (x1 + k * x2) - ix - 0.5
        how[n, 1] = x1 - 1 + 2 * k * x2
        how[n, 2] = y + k * (y1 + k * y2) - iy - 0.5
        how[n, 3] = y1 + 2 * k * y2
        n += 1
        k += length
    return n


@helper
def _warp_pieces(c: Any, stride: Any, n: int, where: Any, how: Any, ramp: Any, table: Any, out: Any) -> None:
    """Warp ``n`` pieces: tau_x = how[0] + how[1] k, tau_y = how[2] + how[3] k."""
    t = table
    for piece in range(n):
        first = np.uintp(where[piece, 0])
        at = np.uintp(where[piece, 1])
        x0 = spread(how[piece, 0])
        x1 = spread(how[piece, 1])
        y0 = spread(how[piece, 2])
        y1 = spread(how[piece, 3])
        for done in range(0, where[piece, 2], LANES):
            k = np.uintp(done)
            r = load(ramp, k)
            store(out, at + k, _pixels(c, stride, first + k, x0 + r * x1, y0 + r * y1, t))


@helper
def _warp_bent_pieces(
    c: Any, stride: Any, n: int, where: Any, how: Any, x2: Any, y2: Any, ramp: Any, table: Any, out: Any
) -> None:
    """The same with tau_x = how[0] + how[1] k + x2 k^2, tau_y likewise."""
    t = table
    for piece in range(n):
        first = np.uintp(where[piece, 0])
        at = np.uintp(where[piece, 1])
        for done in range(0, where[piece, 2], LANES):
            k = np.uintp(done)
            r = load(ramp, k)
            tau_x = spread(how[piece, 0]) + r * (spread(how[piece, 1]) + r * spread(x2))
            tau_y = spread(how[piece, 2]) + r * (spread(how[piece, 3]) + r * spread(y2))
            store(out, at + k, _pixels(c, stride, first + k, tau_x, tau_y, t))


@helper
def new_plan(size: int) -> Any:
    """Room for ``plan_rows`` (starts, taus) and for ``warp_cut_rows`` (where, how)."""
    return (
        np.empty(size, np.int64), np.empty((2, size), np.float32),
        np.empty((ROWS * size, 3), np.int64), np.empty((ROWS * size, 4), np.float32),
    )  # fmt: skip


@inlined
def plan_rows(p: Any, x: Any, y: Any, size: int, stride: int, starts: Any, taus: Any) -> bool:
    """Where each row of a ZOI of order 1 begins in ``c``; False if not every row is in one piece.

    All rows are reckoned ahead, since the processor cannot look beyond the row that it computes.

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
def warp_rows(
    c: Any, stride: Any, x1: Any, y1: Any, first: int, count: int, size: int, starts: Any, taus: Any,
    ramp: Any, table: Any, out: Any, line: Any,
) -> None:  # fmt: skip
    """Rows ``first`` .. of a planned ZOI, ``line`` apart in ``out``; x1 and y1 are the slopes of the fractions."""
    t = table
    sx = spread(x1)
    sy = spread(y1)
    at = np.uintp(0)
    for row in range(first, first + count):
        start = np.uintp(starts[row])
        x0 = spread(taus[0, row])
        y0 = spread(taus[1, row])
        for n in range(0, size, LANES):
            k = np.uintp(n)
            r = load(ramp, k)
            store(out, at + k, _pixels(c, stride, start + k, x0 + r * sx, y0 + r * sy, t))
        at += line


@helper
def warp_cut_rows(
    c: Any, stride: int, p: Any, order: int, x: Any, y: Any, first: int, count: int, size: int,
    where: Any, how: Any, ramp: Any, table: Any, out: Any, line: int,
) -> None:  # fmt: skip
    """The same for any motion of order 1 or 2: rows are cut where an integer part changes.

    Parameters
    ----------
    x, y : first column and row of the ZOI, px from the first sample of ``c``
    where, how : (>= count * size, 3) int64 and (.., 4) float32, for use here
    out : flat float32
        Written in whole vectors of which each may begin at any pixel: what is written too much is
        overwritten or never read.
    """
    reach = (size - 1) / 2
    n = 0
    inverse_x = _inverse(p[1])
    inverse_y = _inverse(p[4])
    for row in range(first, first + count):
        eta = row - reach
        u, v = displacement(p, order, -reach, eta)
        at = (row - first) * line
        if order == 1:
            n = _cut_row(
                stride, size, x + u, p[1], inverse_x, y + row + v, p[4], inverse_y, at, n, where, how
            )  # fmt: skip
        else:
            x1 = 1 + p[1] + p[4] * eta - 2 * p[3] * reach
            y1 = p[7] + p[10] * eta - 2 * p[9] * reach
            n = _cut_bent_row(stride, size, x + u, x1, p[3], y + row + v, y1, p[9], at, n, where, how)
    if order == 1:
        _warp_pieces(c, np.uintp(stride), n, where, how, ramp, table, out)
    else:
        _warp_bent_pieces(c, np.uintp(stride), n, where, how, f4(p[3]), f4(p[9]), ramp, table, out)


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
