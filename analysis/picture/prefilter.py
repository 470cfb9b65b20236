"""The deformed image as a spline: the prefilter along x and y, a compiled loop."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import prange
from numpy.typing import NDArray

from analysis.compiled.loops import helper, inlined, parallel
from analysis.compiled.vectors import LANES, load, spread, store
from analysis.picture.splines import LINE, PAD, PREFILTER_REACH

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
        beside, starts = np.arange(2 * PREFILTER_REACH + 1), np.empty(RING, np.intp)
        ahead = part * PART - PREFILTER_REACH
        last = min(part * PART + PART, height)
        for first in range(part * PART, last, BAND):
            count = min(BAND, last - first)
            for y in range(ahead, first + count + PREFILTER_REACH):
                _mirrored_line(image[_mirror(y, height)], offset, line)
                _filter(line, beside, 0, across, taps, ring[(y + PREFILTER_REACH) % RING])
            ahead = first + count + PREFILTER_REACH
            for i in range(RING):
                starts[i] = (first + i) % RING * ring.shape[1]
            for x in range(0, across, STRIP):
                for y in range(count):
                    _filter(ring, starts[y:], x, min(x + STRIP, across), taps, band[y])
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
