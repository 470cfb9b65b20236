"""The deformed image as a spline: the prefilter along x and y, a compiled loop.

Each pole z is the filter 1/(1 - z B) 1/(1 - z F), B a sample back and F one forward (Unser et al., see ``splines``).
Across the rows it is a recursion down and one up, since columns lie side by side in a vector. Along a row it is the
product of 1 + z_k/(1 + z_k^2) (B^n + F^n), n = 1, 2, 4, 8, z_k = z^n, up to a factor: LANES samples are made at once.
No coefficient depends on what else is filtered: along a row it ends, and across the rows it begins at fixed ones. A
picture of 1280x1024 takes 1.1 ms on one thread, a symmetric filter of 31 taps 2.3 (November 2026).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.compiled.loops import part, shared
from analysis.compiled.shares import in_shares
from analysis.compiled.threads import SHARES, next_piece
from analysis.compiled.vectors import (
    LANES,
    ahead_1,
    ahead_2,
    ahead_4,
    ahead_8,
    back_1,
    back_2,
    back_4,
    back_8,
    fused,
    load,
    load_samples,
    spread,
    store,
    total,
)
from analysis.picture.splines import LINE, PAD, Box

f4 = np.float32

PART, WARM = 64, 16
"""Rows that a thread comes for at a time, and rows above and below them in which the recursions begin."""
REACH, BEHIND = 32, 6 * LANES
"""Samples beside those wanted of a row that are filtered along it, whole vectors and as far as the poles reach; and how
far the result is behind what is read."""


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
    image: NDArray[Any], offset: Any, poles: NDArray[np.float32], box: Box, out: NDArray[np.float32]
) -> bool:
    """Spline coefficients of ``image - offset`` (uint8, uint16 or float32), mirrored PAD pixels beyond each edge.

    Written to ``out`` (``room_for``); far outside ``box`` they are not computed. ``poles`` as of
    ``splines.prefilter_poles``. Returns whether all samples that were read are finite.
    """
    height, width = image.shape
    stride = width + 2 * PAD
    for n in range(out.size - LANES, out.size):
        out[n] = 0
    counters, totals = np.zeros(SHARES, np.int64), np.zeros(SHARES)
    in_shares(_filter_share, (image, offset, poles, box, counters, totals, out))
    for y in range(PAD):
        if box.top == 0:
            _copy_row(out, _mirror(y - PAD, height) + PAD, stride, y)
        if box.bottom == height:
            _copy_row(out, _mirror(height + y, height) + PAD, stride, PAD + height + y)
    return math.isfinite(totals.sum())


@part
def _filter_share(
    image: Any, offset: Any, poles: Any, box: Any, counters: Any, totals: Any, out: Any, share: int
) -> None:
    """The parts of all rows that one thread takes, one after the other; the sum of some results shows NaN."""
    first = box.top // PART
    parts = (box.bottom + PART - 1) // PART - first
    part = next_piece(counters, share, parts)
    if part < 0:  # as for most shares: nothing is left
        return
    height, width = image.shape
    left, right = max(box.left - REACH, 0), min(box.right + REACH, width)
    # An odd number of cache lines a row, or the rows would displace each other.
    rows = np.zeros((PART, ((width + 2 * REACH + BEHIND) // LINE + 1 | 1) * LINE), np.float32)
    half_way, found = np.empty((PART + 2 * WARM) * 2 * LANES, np.float32), f4(0)
    lines, narrow = np.empty(PART + 2 * WARM, np.int64), np.zeros((PART + 2 * WARM, LANES), np.float32)
    steps = _steps(poles)
    while part >= 0:
        top = (first + part) * PART
        bottom = min(top + PART, height)
        for k in range(bottom - top + 2 * WARM):
            lines[k] = _mirror(top - WARM + k, height)
            for x in range(width if width < LANES else 0):
                narrow[k, x] = image[lines[k], x]
        for x in range(left, right, 2 * LANES):
            found += _filter_across(image, offset, x, bottom - top, poles, half_way, lines, narrow, rows)
        for y in range(top, bottom):
            here = out[(y + PAD) * (width + 2 * PAD) :]
            _mirror_ends(rows[y - top], REACH, left, right, width)
            _filter_along(rows[y - top], box.left, box.right, width, steps, here)
            _mirror_ends(here, PAD, box.left, box.right, width)
        part = next_piece(counters, share, parts)
    totals[share] = found


@part
def _filter_across(
    image: Any, offset: Any, x: int, count: int, poles: Any, half_way: Any, lines: Any, narrow: Any, out: Any
) -> Any:
    """Filter two vectors of columns, from ``x`` on, across the rows ``lines``, into ``count`` rows of ``out``.

    Before its first row a picture goes on as it begins. Where a row ends its last vector is taken again; one that is
    shorter is in ``narrow``. Returns what is not finite where a sample is not.
    """
    width, first, second = image.shape[1], poles[1], poles[2]
    gain, less, z, w = spread(poles[0]), spread(offset), spread(first), spread(second)
    even_z, even_w = spread(1 / (f4(1) - first)), spread(1 / (f4(1) - second))
    whole, last = width >= LANES, max(width - LANES, 0)
    x0, x1 = min(x, last), min(x + LANES, last)
    a0 = a1 = b0 = b1 = spread(f4(0))
    for k in range(count + 2 * WARM):
        at = lines[k] * width
        g0 = (load_samples(image, np.uintp(at + x0)) if whole else load(narrow, np.uintp(k * LANES))) - less
        g1 = load_samples(image, np.uintp(at + x1)) - less if whole else g0
        if k == 0:
            a0, a1 = g0 * even_z, g1 * even_z
            b0, b1 = a0 * even_w, a1 * even_w
        a0, a1 = fused(z, a0, g0), fused(z, a1, g1)
        b0, b1 = fused(w, b0, a0), fused(w, b1, a1)
        store(half_way, np.uintp(2 * k * LANES), b0)
        store(half_way, np.uintp((2 * k + 1) * LANES), b1)
    a0, a1 = b0 * even_z, b1 * even_z
    b0, b1 = a0 * even_w, a1 * even_w
    for k in range(count + 2 * WARM - 1, WARM - 1, -1):
        at = np.uintp(2 * k * LANES)
        a0, a1 = fused(z, a0, load(half_way, at)), fused(z, a1, load(half_way, at + np.uintp(LANES)))
        b0, b1 = fused(w, b0, a0), fused(w, b1, a1)
        if k < WARM + count:
            to = (k - WARM) * out.shape[1] + REACH
            store(out, np.uintp(to + x0), b0 * gain)
            store(out, np.uintp(to + x1), b1 * gain)
    return total(b0 + b1)


@part
def _steps(poles: Any) -> Any:
    """The weights of both neighbours in the six passes of ``_filter_along``."""
    steps = np.empty(6, np.float32)
    for k in range(6):
        power = poles[1] ** (1 << k) if k < 4 else poles[2] ** (k - 3)
        steps[k] = power / (1 + power * power)
    return steps


@part
def _filter_along(line: Any, left: int, right: int, width: int, steps: Any, out: Any) -> None:
    """Filter a row, whose column 0 is at ``line[REACH]``, into ``out``, where it is at ``PAD``.

    Each pass needs a vector more of the one before, and so is a vector behind it.
    """
    z, z2, z4, z8 = spread(steps[0]), spread(steps[1]), spread(steps[2]), spread(steps[3])
    w, w2, none = spread(steps[4]), spread(steps[5]), spread(f4(0))
    a0 = a1 = b0 = b1 = c0 = c1 = d0 = d1 = e0 = e1 = f0 = f1 = none
    for at in range(left, right + REACH + BEHIND, LANES):
        a2 = load(line, np.uintp(at))
        b2 = fused(z, back_1(a0, a1) + ahead_1(a1, a2), a1)
        c2 = fused(z2, back_2(b0, b1) + ahead_2(b1, b2), b1)
        d2 = fused(z4, back_4(c0, c1) + ahead_4(c1, c2), c1)
        e2 = fused(z8, back_8(d0, d1) + ahead_8(d1, d2), d1)
        f2 = fused(w, back_1(e0, e1) + ahead_1(e1, e2), e1)
        done = fused(w2, back_2(f0, f1) + ahead_2(f1, f2), f1)
        a0, b0, c0, d0, e0, f0 = a1, b1, c1, d1, e1, f1
        a1, b1, c1, d1, e1, f1 = a2, b2, c2, d2, e2, f2
        x = at - BEHIND - REACH
        if left <= x <= width + PAD - LANES:
            store(out, np.uintp(x + PAD), done)
        elif left <= x:  # the next row is another thread's
            store(line, np.uintp(0), done)
            for n in range(right - x):
                out[x + n + PAD] = line[n]


@part
def _mirror_ends(row: Any, beyond: int, left: int, right: int, width: int) -> None:
    """What a row, whose column 0 is at ``beyond``, has mirrored ``beyond`` an image that it reaches the end of."""
    for x in range(beyond if left == 0 else 0):
        row[x] = row[beyond + _mirror(x - beyond, width)]
    for x in range(beyond if right >= width else 0):
        row[beyond + width + x] = row[beyond + _mirror(width + x, width)]


@part
def _copy_row(out: Any, source: int, stride: int, to: int) -> None:
    for x in range(stride):
        out[to * stride + x] = out[source * stride + x]
