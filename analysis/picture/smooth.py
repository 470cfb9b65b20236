"""Rows of the deformed image under a motion of third degree: what ZOIs near each other share. Compiled.

A motion is (2, 10): of u and of v, px, the coefficients of 1, x, y, x^2, xy, y^2, x^3, x^2 y, x y^2, y^3, with x and
y in units of ``unit`` px from the middle of a tile. Along a row the fractions are polynomials of third degree, too:
within 16 px a sine of 0.3 px and 128 px period bends by 0.02 px.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from analysis.compiled.loops import helper, inlined
from analysis.compiled.vectors import LANES, fetch_later, fetch_soon, load, spread, store
from analysis.picture.cutting import inside
from analysis.picture.splines import PAD
from analysis.picture.warp import pixels

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


@helper
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


@helper
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


@helper
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


@helper
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
