"""The deformed image as a spline: the prefilter along x and y, a compiled loop."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import prange
from numpy.typing import NDArray

from analysis.compiled.loops import helper, inlined, parallel
from analysis.compiled.shares import SHARES, next_piece
from analysis.compiled.vectors import LANES, load, spread, store
from analysis.picture.splines import LINE, PAD, PREFILTER_REACH, Box

f4 = np.float32

GROUP = 4 * LANES
"""Samples that are filtered at a time: one sum after the other would wait for each product."""
BAND, STRIP = 16, 2 * GROUP
"""Rows and columns that are filtered along y at a time, so that a row is read once from afar, not 31 times."""
PART, RING = 128, BAND + 2 * PREFILTER_REACH
"""Rows that one thread filters one after the other, and how many of them it keeps filtered along x."""
_lanes = np.uintp(LANES)
_two, _three = np.uintp(2), np.uintp(3)


@helper
def _mirror(i: int, n: int) -> int:
    """Index i reflected about the first and last of n samples, which are not repeated."""
    if n == 1:
        return 0
    period = 2 * (n - 1)
    i = abs(i) % period
    return min(i, period - i)


@parallel
def coefficients(image: NDArray[Any], offset: Any, taps: NDArray[np.float32], box: Box) -> Any:
    """Spline coefficients of ``image - offset`` (uint8, uint16 or float32), mirrored PAD pixels beyond each edge.

    Returns flat float32: (H + 2 PAD) rows of W + 2 PAD, and a vector more than that; outside ``box``
    they are not computed. ``taps`` is one side of the symmetric prefilter.
    """
    height, width = image.shape
    stride = width + 2 * PAD
    out = np.empty((height + 2 * PAD) * stride + LANES, np.float32)
    for n in range(out.size - LANES, out.size):
        out[n] = 0
    counter = np.zeros(1, np.int64)
    for _ in prange(SHARES):
        _filter_share(image, offset, taps, box, counter, out)
    for y in range(PAD):
        if box.top == 0:
            _copy_row(out, _mirror(y - PAD, height) + PAD, stride, y)
        if box.bottom == height:
            _copy_row(out, _mirror(height + y, height) + PAD, stride, PAD + height + y)
    return out


@helper
def _filter_share(image: Any, offset: Any, taps: Any, box: Any, counter: Any, out: Any) -> None:
    """What one thread comes to do of all rows."""
    top = box.top + next_piece(counter) * PART
    while top < box.bottom:
        _filter_part(image, offset, taps, box, top, min(top + PART, box.bottom), out)
        top = box.top + next_piece(counter) * PART


@helper
def _filter_part(image: Any, offset: Any, taps: Any, box: Any, top: int, bottom: int, out: Any) -> None:
    """Rows ``top`` .. of the coefficients, along x and y in one go, so that what lies between stays in the cache."""
    height, width = image.shape
    stride = width + 2 * PAD
    left = box.left // GROUP * GROUP
    right = (box.right + GROUP - 1) // GROUP * GROUP
    line = np.zeros((width + GROUP - 1) // GROUP * GROUP + 2 * PREFILTER_REACH, np.float32)
    # An odd number of cache lines a row, or the rows would displace each other.
    ring = np.empty((RING, line.size - 2 * PREFILTER_REACH + LINE), np.float32)
    band = np.empty((BAND, line.size), np.float32)
    beside, starts = np.arange(2 * PREFILTER_REACH + 1), np.empty(RING, np.intp)
    ahead = top - PREFILTER_REACH
    for first in range(top, bottom, BAND):
        count = min(BAND, bottom - first)
        for y in range(ahead, first + count + PREFILTER_REACH):
            _mirrored_line(image[_mirror(y, height)], offset, left, right, line)
            _filter(line, beside, left, right, taps, ring[(y + PREFILTER_REACH) % RING])
        ahead = first + count + PREFILTER_REACH
        for i in range(RING):
            starts[i] = (first + i) % RING * ring.shape[1]
        for x in range(left, right, STRIP):
            for y in range(count):
                _filter(ring, starts[y:], x, min(x + STRIP, right), taps, band[y])
        for y in range(count):
            row = out[(first + y + PAD) * stride : (first + y + PAD + 1) * stride]
            for x in range(left, min(right, width)):
                row[PAD + x] = band[y, x]
            for x in range(PAD if left == 0 else 0):
                row[x] = band[y, _mirror(x - PAD, width)]
            for x in range(PAD if right >= width else 0):
                row[PAD + width + x] = band[y, _mirror(width + x, width)]


@helper
def _copy_row(out: Any, source: int, stride: int, to: int) -> None:
    for x in range(stride):
        out[to * stride + x] = out[source * stride + x]


@helper
def _mirrored_line(row: Any, offset: Any, left: int, right: int, line: Any) -> None:
    """Columns ``left`` .. ``right`` of a row less ``offset``, ``PREFILTER_REACH`` more beside, mirrored beyond it."""
    width, reach = row.size, PREFILTER_REACH
    for x in range(max(left - reach, 0), min(right + reach, width)):
        line[x + reach] = f4(row[x]) - offset
    for x in range(reach if left < reach else 0):
        line[x] = line[_mirror(x - reach, width) + reach]
    for x in range(reach if right + reach > width else 0):
        line[width + reach + x] = line[_mirror(width + x, width) + reach]


@helper
def _filter(rows: Any, starts: Any, first: int, last: int, taps: Any, out: Any) -> None:
    """Symmetric filter of the samples ``first`` .. ``last``; ``starts`` (31,) are the flat indices of its taps."""
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
