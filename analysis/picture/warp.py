"""Rows of the deformed image along a deformed line: compiled loops.

One kind of warp for all motions: the full 6 x 6 taps of the tensor-product spline, with the fraction of
every pixel, a vector of pixels at a time (``cutting`` has where a row is cut for that). It runs at about half
of the rate at which the processor issues multiply-adds.

Tried and rejected: two rows at a time with shared loads (too few registers), six sums of taps side by side, ZOIs in the
order of tiles (all within 3 %). Overlapping ZOIs share a warp in ``smooth``. Estimated and not built: columns, then
rows, with 0.7 of the arithmetic but a skew error with rotation (3e-4 px and 35 um/m at 1 degree); polynomials of the
tap weights along a row; cutting the corners of the window.

ZOIs near each other share rows under a motion of third degree. Such a motion is (2, 10): of u and of v, px, the
coefficients of 1, x, y, x^2, xy, y^2, x^3, x^2 y, x y^2, y^3, with x and y in units of ``unit`` px from the middle of a
tile. Along a row the fractions are polynomials of third degree, too: within 16 px a sine of 0.3 px and 128 px period
bends by 0.02 px.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from analysis.compiled.loops import inlined, part
from analysis.compiled.vectors import (
    LANES,
    above,
    address,
    fetch_later,
    fetch_soon,
    further,
    fused,
    load,
    load_from,
    spread,
    store,
)
from analysis.picture.cutting import (
    MAX_ROWS_PASSED,
    cut_bent_row,
    cut_leaning_row,
    cut_row,
    displacement,
    inside,
    inverse_slope,
)
from analysis.picture.splines import PAD

f4 = np.float32
_zero, _one, _two, _three, _four, _five = (np.uintp(i) for i in range(6))


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
def _six_rows(row: Any, stride: Any, a: Any, b: Any) -> Any:
    """Sum of the taps from the address ``row`` on, with weights ``a`` along and ``b`` across; and the last row."""
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
    return value + b[5] * _taps(row, a), row


@inlined
def pixels(c: Any, stride: Any, first: Any, tau_x: Any, tau_y: Any, t: Any) -> Any:
    """A vector of pixels; ``first`` is the flat index of the first of the 36 taps of its first pixel."""
    value, _ = _six_rows(address(c, first), stride, _weights(tau_x, t), _weights(tau_y, t))
    return value


@inlined
def _leaning_weights(tau: Any, limit: Any, w: Any) -> Any:
    """Weights moved on by a tap in the lanes where ``tau`` is above ``limit``: seven for the first six."""
    zero = spread(f4(0))
    return (
        above(tau, limit, zero, w[0]), above(tau, limit, w[0], w[1]), above(tau, limit, w[1], w[2]),
        above(tau, limit, w[2], w[3]), above(tau, limit, w[3], w[4]), above(tau, limit, w[4], w[5]),
        above(tau, limit, w[5], zero),
    )  # fmt: skip


@inlined
def _leaning_pixels(c: Any, stride: Any, first: Any, tau_x: Any, tau_y: Any, t: Any, steep: bool) -> Any:
    """A vector of pixels with tau_y up to 3/2, ``steep``: 5/2, that is with taps in seven or eight rows."""
    zero, one, half, more = spread(f4(0)), spread(f4(1)), spread(f4(0.5)), spread(f4(1.5))
    inner = tau_y - above(tau_y, half, one, zero)
    if steep:
        inner = inner - above(tau_y, more, one, zero)
    a = _weights(tau_x, t)
    b = _leaning_weights(tau_y, half, _weights(inner, t))
    seventh, eighth = b[6], zero
    if steep:
        seventh, eighth = above(tau_y, more, b[5], b[6]), above(tau_y, more, b[6], zero)
        b = _leaning_weights(tau_y, more, b)
    value, row = _six_rows(address(c, first), stride, a, b)
    row = further(row, stride)
    value += seventh * _taps(row, a)
    if steep:
        value += eighth * _taps(further(row, stride), a)
    return value


@part
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
            store(out, at + k, pixels(c, stride, first + k, x0 + r * x1, y0 + r * y1, t))


@part
def _warp_leaning_pieces(
    c: Any, stride: Any, n: int, where: Any, how: Any, ramp: Any, table: Any, out: Any, steep: bool
) -> None:
    """The same for pieces of ``cut_leaning_row``."""
    t = table
    r = load(ramp, _zero)
    for piece in range(n):
        first = np.uintp(where[piece, 0])
        tau_x = spread(how[piece, 0]) + r * spread(how[piece, 1])
        tau_y = spread(how[piece, 2]) + r * spread(how[piece, 3])
        if steep:
            value = _leaning_pixels(c, stride, first, tau_x, tau_y, t, True)
        else:
            value = _leaning_pixels(c, stride, first, tau_x, tau_y, t, False)
        store(out, np.uintp(where[piece, 1]), value)


@part
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
            store(out, at + k, pixels(c, stride, first + k, tau_x, tau_y, t))


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
            store(out, at + k, pixels(c, stride, start + k, x0 + r * sx, y0 + r * sy, t))
        at += line


@part
def warp_cut_rows(
    c: Any, stride: int, p: Any, order: int, x: Any, y: Any, first: int, count: int, size: int,
    where: Any, how: Any, ramp: Any, table: Any, out: Any, line: int,
) -> None:  # fmt: skip
    """The same for any motion of order 1 or 2, in pieces.

    Parameters
    ----------
    x, y : first column and row of the ZOI, px from the first sample of ``c``
    where, how : (>= count * size, 3) int64 and (.., 4) float32, for use here
    out : flat float32
        Written in whole vectors of which each may begin at any pixel: what is written too much is
        overwritten or never read.
    """
    reach = (size - 1) / 2
    n = np.intp(0)  # a literal 0 would have numba compile the loops twice
    inverse_x = inverse_slope(p[1])
    inverse_y = inverse_slope(p[4])
    # How many rows a vector passes; where they are few it need not be cut there.
    passed = abs(p[4]) * (LANES - 1) if order == 1 else np.inf
    for row in range(first, first + count):
        eta = row - reach
        u, v = displacement(p, order, -reach, eta)
        at = (row - first) * line
        if passed <= MAX_ROWS_PASSED:
            n = cut_leaning_row(
                stride, size, x + u, p[1], inverse_x, y + row + v, p[4], at, n, where, how
            )  # fmt: skip
        elif order == 1:
            n = cut_row(
                stride, size, x + u, p[1], inverse_x, y + row + v, p[4], inverse_y, at, n, where, how
            )  # fmt: skip
        else:
            x1 = 1 + p[1] + p[4] * eta - 2 * p[3] * reach
            y1 = p[7] + p[10] * eta - 2 * p[9] * reach
            n = cut_bent_row(stride, size, x + u, x1, p[3], y + row + v, y1, p[9], at, n, where, how)
    if passed <= MAX_ROWS_PASSED:
        _warp_leaning_pieces(c, np.uintp(stride), n, where, how, ramp, table, out, passed > 1)
    elif order == 1:
        _warp_pieces(c, np.uintp(stride), n, where, how, ramp, table, out)
    else:
        _warp_bent_pieces(c, np.uintp(stride), n, where, how, f4(p[3]), f4(p[9]), ramp, table, out)


ROWS = 8
"""Rows that are cut before they are warped; meanwhile the next ones are prefetched."""
BORDER = 8
"""Steps along a side of a tile at which it is looked whether it has left the image."""


@inlined
def moved(t: Any, c: int, x: Any, y: Any) -> Any:
    """The displacement along axis ``c`` at a place."""
    first = t[c, 1] + x * (t[c, 3] + x * t[c, 6])
    return (
        t[c, 0]
        + x * first
        + y * (t[c, 2] + x * (t[c, 4] + x * t[c, 7]) + y * (t[c, 5] + x * t[c, 8] + y * t[c, 9]))
    )


@inlined
def slopes(t: Any, c: int, x: Any, y: Any) -> Any:
    """Its derivatives along x and y, px per ``unit``."""
    along = t[c, 1] + x * (2 * t[c, 3] + 3 * x * t[c, 6]) + y * (t[c, 4] + 2 * x * t[c, 7] + y * t[c, 8])
    down = t[c, 2] + y * (2 * t[c, 5] + 3 * y * t[c, 9]) + x * (t[c, 4] + 2 * y * t[c, 8] + x * t[c, 7])
    return along, down


@part
def stays(picture: Any, t: Any, unit: Any, box: Any) -> bool:
    """Whether the border of a tile stays where corners of ZOIs may lie; ``box`` is its top, left, height and width."""
    top, left, height, width = box
    for k in range(-BORDER, BORDER + 1):
        for side in range(4):
            x: Any = (width - 1) / 2 * (k / BORDER if side < 2 else 2 * side - 5)
            y: Any = (height - 1) / 2 * (2 * side - 1 if side < 2 else k / BORDER)
            X = left + (width - 1) / 2 + x + moved(t, 0, x / unit, y / unit)
            Y = top + (height - 1) / 2 + y + moved(t, 1, x / unit, y / unit)
            if not inside(X, Y, picture.left, picture.right, picture.top, picture.bottom):
                return False
    return True


@inlined
def _along(t: Any, c: int, y: Any) -> Any:
    """The polynomial in x of a row."""
    level = t[c, 0] + y * (t[c, 2] + y * (t[c, 5] + y * t[c, 9]))
    return level, t[c, 1] + y * (t[c, 4] + y * t[c, 8]), t[c, 3] + y * t[c, 7], t[c, 6]


@inlined
def _from(a: Any, x: Any, e: Any) -> Any:
    """The same polynomial about ``x``, in px; ``e`` is 1 / unit."""
    value = a[0] + x * (a[1] + x * (a[2] + x * a[3]))
    return value, (a[1] + x * (2 * a[2] + 3 * x * a[3])) * e, (a[2] + 3 * x * a[3]) * e * e, a[3] * e * e * e


@part
def _cut(t: Any, unit: Any, box: Any, row: int, at: int, stride: int, n: int, where: Any, how: Any) -> int:
    """Append the pieces of a row to the list of ``n``, a vector each at most, and return their new number."""
    top, left, height, width = box
    e = 1 / unit
    y = (row - (height - 1) / 2) * e
    u, v = _along(t, 0, y), _along(t, 1, y)
    k = 0
    while k < width:
        x = (k - (width - 1) / 2) * e
        x0, x1, x2, x3 = _from(u, x, e)
        y0, y1, y2, y3 = _from(v, x, e)
        x0 += left + PAD + k
        y0 += top + PAD + row
        ix, iy = np.intp(x0), np.intp(y0)  # positive, so this is the floor
        fx, fy = x0 - ix, y0 - iy
        length = min(LANES, width - k)
        while length > 1:
            end = length - 1
            ex, ey = fx + end * (x1 + end * (x2 + end * x3)), fy + end * (y1 + end * (y2 + end * y3))
            if 0 <= ex < 1 and 0 <= ey < 1:
                break
            length -= 1
        where[n, 0], where[n, 1] = (iy - 2) * stride + ix - 2, at + k
        how[n, 0], how[n, 1], how[n, 2], how[n, 3] = fx - 0.5, x1, x2, x3
        how[n, 4], how[n, 5], how[n, 6], how[n, 7] = fy - 0.5, y1, y2, y3
        n += 1
        k += length
    return n


@inlined
def _cubic(how: Any, piece: int, first: int, r: Any) -> Any:
    a, b = spread(how[piece, first]), spread(how[piece, first + 1])
    return a + r * (b + r * (spread(how[piece, first + 2]) + r * spread(how[piece, first + 3])))


@part
def new_pieces(width: int) -> Any:
    """Arrays for ``warp_smooth`` of tiles of that width at most."""
    return np.empty((ROWS * width, 2), np.int64), np.empty((ROWS * width, 8), np.float32)


@inlined
def _fetch(c: Any, stride: int, t: Any, box: Any, row: int, also: Any) -> None:
    """Prefetch a row of other images, and of the deformed one what is warped ``ROWS`` later.

    Rows lie further apart than the processor prefetches by itself.
    """
    top, left, _, width = box
    images, samples, pitch, count = also
    moved_to = (top + row + ROWS + PAD + np.intp(t[1, 0])) * stride + left + PAD + np.intp(t[0, 0])
    here = (top + row) * pitch + left
    for x in range(0, width, LANES):
        fetch_soon(c, np.uintp(moved_to + x))
        for k in range(count):
            fetch_later(images, np.uintp(here + x + k * samples))


@part
def warp_smooth(
    c: Any, stride: int, t: Any, unit: Any, box: Any, pieces: Any, ramp: Any, table: Any, out: Any, line: int, also: Any
) -> None:  # fmt: skip
    """The deformed image over a tile, its rows ``line`` apart in ``out``, flat float32.

    Written in whole vectors, of which each may begin at any pixel: what is written too much is overwritten or not read.
    ``also`` are images that are read next: flat float32, samples of each, pitch, and how many.
    """
    where, how = pieces
    r = load(ramp, np.uintp(0))
    for first in range(0, box[2], ROWS):
        n = np.intp(0)  # a literal 0 would have numba compile the loops twice
        for row in range(first, min(first + ROWS, box[2])):
            _fetch(c, stride, t, box, row, also)
            n = _cut(t, unit, box, row, row * line, stride, n, where, how)
        for piece in range(n):
            tau_x, tau_y = _cubic(how, piece, 0, r), _cubic(how, piece, 4, r)
            value = pixels(c, np.uintp(stride), np.uintp(where[piece, 0]), tau_x, tau_y, table)
            store(out, np.uintp(where[piece, 1]), value)
