"""The deformed image as a spline: the prefilter along x and y, a compiled loop."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.compiled.convolution import GROUP, REACH, ROWS, STRIP, filter_across, filter_along
from analysis.compiled.loops import part, shared
from analysis.compiled.shares import in_shares
from analysis.compiled.threads import SHARES, next_piece
from analysis.compiled.vectors import LANES
from analysis.picture.splines import LINE, PAD, Box

f4 = np.float32

BAND = 4 * ROWS
"""Rows that are filtered along y at a time, so that a row is read once from afar, not 31 times."""
PART, RING = 64, BAND + 2 * REACH
"""Rows that a thread comes for at a time, and how many it keeps filtered along x."""
_reach = np.uintp(REACH)


@part
def _mirror(i: int, n: int) -> int:
    """Index i reflected about the first and last of n samples, which are not repeated."""
    if n == 1:
        return 0
    period = 2 * (n - 1)
    i = abs(i) % period
    return min(i, period - i)


def room_for(shape: tuple[int, int]) -> NDArray[np.float32]:
    """Memory for the ``coefficients`` of images (H, W): (H + 2 PAD) rows of W + 2 PAD, and a vector more than that.

    To be used again: fresh memory takes as long as the filter. numpy asks for large pages, numba does not.
    """
    height, width = shape
    return np.empty((height + 2 * PAD) * (width + 2 * PAD) + LANES, np.float32)


@shared
def coefficients(
    image: NDArray[Any], offset: Any, taps: NDArray[np.float32], box: Box, out: NDArray[np.float32]
) -> bool:
    """Spline coefficients of ``image - offset`` (uint8, uint16 or float32), mirrored PAD pixels beyond each edge.

    Written to ``out`` (``room_for``); outside ``box`` they are not computed. ``taps`` is one side of the symmetric
    prefilter. Returns whether all samples that were read are finite: a pass of its own took a tenth of the time.
    """
    height, width = image.shape
    stride = width + 2 * PAD
    for n in range(out.size - LANES, out.size):
        out[n] = 0
    counters, totals = np.zeros(SHARES, np.int64), np.zeros(SHARES)
    in_shares(_filter_share, (image, offset, taps, box, counters, totals, out))
    for y in range(PAD):
        if box.top == 0:
            _copy_row(out, _mirror(y - PAD, height) + PAD, stride, y)
        if box.bottom == height:
            _copy_row(out, _mirror(height + y, height) + PAD, stride, PAD + height + y)
    return math.isfinite(totals.sum())


@part
def _filter_share(
    image: Any, offset: Any, taps: Any, box: Any, counters: Any, totals: Any, out: Any, share: int
) -> None:
    """The parts of all rows that one thread takes, one after the other; the sum of the samples shows NaN."""
    parts = (box.bottom - box.top + PART - 1) // PART
    part = next_piece(counters, share, parts)
    if part < 0:  # as for most shares: nothing is left
        return
    width = image.shape[1]
    line = np.zeros((width + GROUP - 1) // GROUP * GROUP + 2 * REACH, np.float32)
    # An odd number of cache lines a row, or the rows would displace each other.
    ring = np.empty((RING, line.size - 2 * REACH + LINE), np.float32)
    band = np.empty((BAND, line.size), np.float32)
    buffers = line, ring, band, np.empty(RING, np.intp)
    ahead, total = -1, 0.0
    while part >= 0:
        top = box.top + part * PART
        if ahead != top + REACH:  # else the rows above are still in the ring
            ahead = top - REACH
        bottom = min(top + PART, box.bottom)
        ahead, read = _filter_part(image, offset, taps, box, top, bottom, ahead, buffers, out)
        total += read
        part = next_piece(counters, share, parts)
    totals[share] = total


@part
def _filter_part(
    image: Any, offset: Any, taps: Any, box: Any, top: int, bottom: int, ahead: int, buffers: Any, out: Any
) -> Any:
    """Rows ``top`` .. of the coefficients, along x and y in one go, so that what lies between stays in the cache.

    Rows before ``ahead`` are in the ring already; returns up to where they are then, and the sum of those read.
    """
    height, width = image.shape
    line, ring, band, starts = buffers
    left = box.left // GROUP * GROUP
    right = (box.right + GROUP - 1) // GROUP * GROUP
    total = 0.0
    for first in range(top, bottom, BAND):
        count = min(BAND, bottom - first)
        for y in range(ahead, first + count + REACH):
            total += _mirrored_line(image[_mirror(y, height)], offset, left, right, line)
            row = ring[(y + REACH) % RING]
            for x in range(left, right, GROUP):
                filter_along(line, np.uintp(x) + _reach, taps, row, np.uintp(x))
        ahead = first + count + REACH
        for i in range(RING):
            starts[i] = (first + i) % RING * ring.shape[1]
        for x in range(left, right, STRIP):
            for y in range(0, count, ROWS):
                filter_across(ring, starts, np.uintp(y), np.uintp(x), taps, band)
        for y in range(count):
            _put_row(band[y], left, right, width, out[(first + y + PAD) * (width + 2 * PAD) :])
    return ahead, total


@part
def _put_row(row: Any, left: int, right: int, width: int, out: Any) -> None:
    """A row of the coefficients, and what it has mirrored beyond the image."""
    here, there = row[left : min(right, width)], out[PAD + left : PAD + min(right, width)]
    for x in range(len(here)):
        there[x] = here[x]
    for x in range(PAD if left == 0 else 0):
        out[x] = row[_mirror(x - PAD, width)]
    for x in range(PAD if right >= width else 0):
        out[PAD + width + x] = row[_mirror(width + x, width)]


@part
def _copy_row(out: Any, source: int, stride: int, to: int) -> None:
    for x in range(stride):
        out[to * stride + x] = out[source * stride + x]


@part
def _mirrored_line(row: Any, offset: Any, left: int, right: int, line: Any) -> Any:
    """Columns ``left`` .. ``right`` of a row less ``offset``, REACH more beside, mirrored beyond it; their sum."""
    width = row.size
    # Parts of the arrays, since of an index that may be negative no vectors are made.
    first, end = max(left - REACH, 0), min(right + REACH, width)
    here, there = row[first:end], line[first + REACH : end + REACH]
    total = f4(0)
    for x in range(len(here)):
        there[x] = f4(here[x]) - offset
        total += there[x]
    for x in range(REACH if left < REACH else 0):
        line[x] = line[_mirror(x - REACH, width) + REACH]
    for x in range(REACH if right + REACH > width else 0):
        line[width + REACH + x] = line[_mirror(width + x, width) + REACH]
    return total
