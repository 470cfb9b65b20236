"""The iteration: warp, take moments of the difference, solve, compose, until the step is small.

One compiled loop over ZOIs; each is done by one thread, so its numbers depend neither on the number of threads nor,
from the same start, on the other ZOIs. The first step of many is made for a tile of them at once (``shared``).

A step of d px leaves about d (0.003 + 1.15 sigma_u + 0.03 d): the iteration stops by this measured law. A fixed share
(0.12) in its place needed two iterations where one was enough. The law holds for affine ZOIs with a uniform or
Gaussian window; measure it again for another window.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import prange

from analysis.compiled.loops import helper, inlined, parallel, part, shared
from analysis.compiled.shares import in_shares, part_of
from analysis.compiled.threads import SHARES, caller, keep_apart, next_piece
from analysis.compiled.vectors import LANES, fetch_later, fetch_soon
from analysis.fit.kernel_args import (
    CONVERGED,
    DIVERGED,
    IMAGES,
    LEFT_IMAGE,
    RUNNING,
    FitArgs,
    OutArgs,
    PictureArgs,
    StopArgs,
)
from analysis.fit.moments import (
    CHANNELS,
    DEGREES,
    DIFFERENCE_ROWS,
    add_difference_columns,
    difference_moments,
    weighted_rows,
)
from analysis.fit.shapes import N_HELD, bent, shares
from analysis.picture.cutting import ROWS, displacement, inside, new_plan, plan_rows
from analysis.picture.splines import PAD
from analysis.picture.warp import warp_cut_rows, warp_rows

f4 = np.float32

GAIN_RANGE = (0.15, 6.0)
"""A step is divided by the estimated gain only within this range."""
LEFT_BY_NOISE = 1.15
"""Share of a step left as error after it, per px of uncertainty from one image (measured: 0.5-1 rms)."""
LEFT_BY_MISFIT = 0.003  # the same without noise (measured: up to 0.002)
LEFT_BY_LENGTH = 0.03
"""The same per px of the step, the next order of the expansion (measured: 0.004-0.03)."""
MAX_STEP = 3.0
"""Pixels; a longer step at the edge of the ZOI is shortened to this."""
CHUNK = 32
"""ZOIs that a thread takes at a time, where there are many."""
AHEAD, BEYOND = 16, 3
"""ZOIs ahead of the present one whose pixels are prefetched; taps beyond the pixel that they make."""


@part
def _within(picture: Any, p: Any, order: int, cx: Any, cy: Any, reach: Any) -> bool:
    """Whether the corners of the warped ZOI stay where they may lie."""
    for corner in range(4):
        x = reach if corner & 1 else -reach
        y = reach if corner & 2 else -reach
        u, v = displacement(p, order, x, y)
        if not inside(cx + x + u, cy + y + v, picture.left, picture.right, picture.top, picture.bottom):
            return False
    return True


@helper
def compose(p: Any, order: int, d: Any) -> None:
    """W := W o (identity + d)^-1, in place; exact for order 1, to second order in x for order 2."""
    half = 3 if order == 1 else 6
    a = 1 + d[1]
    b = d[2]
    c = d[half + 1]
    e = 1 + d[half + 2]
    det = a * e - b * c
    ia, ib, ic, ie = e / det, -b / det, -c / det, a / det
    # x = M (y - t) of the inverse step; for order 2 less M times its quadratic part at M (y - t).
    tx = -(ia * d[0] + ib * d[half])
    ty = -(ic * d[0] + ie * d[half])
    if order == 1:
        for r in range(0, 6, 3):
            ux, uy = p[r + 1] + (r == 0), p[r + 2] + (r == 3)
            p[r] += ux * tx + uy * ty
            p[r + 1] = ux * ia + uy * ic - (r == 0)
            p[r + 2] = ux * ib + uy * ie - (r == 3)
        return
    # The inverse step as a quadratic polynomial: X = tx + ia x + ib y + q . (x^2, xy, y^2), Y likewise.
    qx = np.empty(3)
    qy = np.empty(3)
    for k in range(3):
        qx[k] = -(ia * d[3 + k] + ib * d[9 + k])
        qy[k] = -(ic * d[3 + k] + ie * d[9 + k])
    for r in range(0, 12, 6):
        p0, ux, uy = p[r], p[r + 1] + (r == 0), p[r + 2] + (r == 6)
        xx, xy, yy = p[r + 3], p[r + 4], p[r + 5]
        p[r] = p0 + ux * tx + uy * ty + xx * tx * tx + xy * tx * ty + yy * ty * ty
        gx = ux + 2 * xx * tx + xy * ty
        gy = uy + 2 * yy * ty + xy * tx
        p[r + 1] = gx * ia + gy * ic - (r == 0)
        p[r + 2] = gx * ib + gy * ie - (r == 6)
        p[r + 3] = gx * qx[0] + gy * qy[0] + xx * ia * ia + xy * ia * ic + yy * ic * ic
        p[r + 4] = gx * qx[1] + gy * qy[1] + 2 * xx * ia * ib + xy * (ia * ie + ib * ic) + 2 * yy * ic * ie
        p[r + 5] = gx * qx[2] + gy * qy[2] + xx * ib * ib + xy * ib * ie + yy * ie * ie


@inlined
def _moments(
    picture: Any, table: Any, fit: Any, top: int, first: int, q: Any, buffers: Any, next_one: Any, m: Any, bent_by: Any
) -> Any:  # fmt: skip
    """Warp one ZOI and write J' w d to ``m`` and the sums with the shapes to ``bent_by``; returns d' w d.

    ``next_one`` (first row and column of the next ZOI, motion down and right) is prefetched meanwhile; a negative
    row: it is not.
    """
    plan, ramp, g, columns, sums = buffers
    starts, taus, where, how = plan
    size, order, rows = fit.size, fit.order, fit.rows
    stride = picture.width + 2 * PAD
    line = rows.shape[1]
    reach = (size - 1) / 2
    whole = False
    if order == 1:
        u, v = displacement(q, order, -reach, -reach)
        whole = plan_rows(q, first + PAD + u, top + PAD + v, size, stride, starts, taus)
    columns[:] = 0
    for y in range(0, size, ROWS):
        count = min(ROWS, size - y)
        if next_one[0] >= 0:
            _fetch_rows(picture, fit, next_one, y, count)
        if whole:
            warp_rows(
                picture.c, np.uintp(stride), f4(q[1]), f4(q[4]), y, count, size, starts, taus,
                ramp, table, g, np.uintp(line),
            )  # fmt: skip
        else:
            warp_cut_rows(
                picture.c, stride, q, order, first + PAD, top + PAD, y, count, size, where, how,
                ramp, table, g, line,
            )  # fmt: skip
        at = np.uintp((top + y) * fit.pitch + first)
        add_difference_columns(
            fit.images, np.uintp(fit.samples), at, np.uintp(fit.pitch), g, np.uintp(0), np.uintp(line), line, y,
            count, rows, columns,
        )  # fmt: skip
    return moments_of(fit, columns, np.uintp(0), sums, m, bent_by)


@inlined
def moments_of(fit: Any, columns: Any, place: Any, sums: Any, m: Any, bent_by: Any) -> Any:
    """J' w d (P,) of a ZOI that begins at column ``place`` of column sums, and the sums with the shapes; d' w d."""
    mix, order = fit.mix, fit.order
    half = 3 if order == 1 else 6
    energy = difference_moments(columns, place, fit.rows, fit.rows.shape[1], sums)
    x, xx = mix[1, 1], mix[2, 2]
    for k in range(4, CHANNELS):
        m[2 * half + 2 + k] = sums[k, 0, 0]
    for k in range(4):
        n = k * half if k < 2 else 2 * half + 3 * (k - 2)
        m[n], m[n + 1], m[n + 2] = sums[k, 0, 0], sums[k, 0, 1] / x, sums[k, 1, 0] / x
        if k < 2:
            shares(sums, k, bent_by)
        if k < 2 and order == 2:
            m[n + 3] = (sums[k, 0, 2] - mix[2, 0] * sums[k, 0, 0]) / xx
            m[n + 4] = sums[k, 1, 1] / x**2
            m[n + 5] = (sums[k, 2, 0] - mix[2, 0] * sums[k, 0, 0]) / xx
    return energy


@inlined
def solve(fit: Any, z: int, m: Any, step: Any, energy: Any, solved: Any) -> Any:
    """Parameters of one linear fit, of ZOI ``z``, and the weighted sum of squares it leaves.

    What noise adds is taken off as far as there is noise: a picture that is its own reference has none.
    """
    weighted_rows(fit.inverse, np.uintp(z * len(m) * len(m)), m, len(m), solved)
    left = energy
    for i in range(len(m)):
        left -= solved[i] * m[i]
    if left < 0:  # by rounding
        left = 0.0
    share = f4(min(left, fit.expected[z]) / fit.expected[z] * fit.noise[z])
    for i in range(len(m)):
        step[i] = solved[i] + share * fit.bias[z, i]
    return left


@inlined
def _fetch(picture: Any, fit: Any, origin: Any, q: Any) -> None:
    """Prefetch what a ZOI to come needs of the images and its neighbours do not: its last rows and columns.

    Rows lie further apart than the processor prefetches by itself. ``q`` is about where the ZOI has moved.
    """
    size = fit.size
    fresh = min(fit.spacing, size)
    down, right = int(q[len(q) // 2]) + PAD + BEYOND, int(q[0]) + PAD + BEYOND
    for x in range(size - fresh + LANES - 1, size + LANES - 1, LANES):
        column = origin[1] + min(x, size - 1)
        for y in range(origin[0] + size - fresh, origin[0] + size):
            for k in range(IMAGES):
                fetch_later(fit.images, np.uintp(y * fit.pitch + column + k * fit.samples))
            fetch_later(picture.c, np.uintp((y + down) * (picture.width + 2 * PAD) + column + right))


@inlined
def _fetch_rows(picture: Any, fit: Any, next_one: Any, y: int, count: int) -> None:
    """Prefetch some rows of the next ZOI, where they reach beyond this one: while it is computed they come nearer."""
    top, left, down, right = next_one
    fresh = min(fit.spacing, fit.size)
    for row in range(top + y, top + y + count):
        for x in range(left + fit.size - fresh + LANES - 1, left + fit.size + LANES - 1, LANES):
            for k in range(IMAGES):
                fetch_soon(fit.images, np.uintp(row * fit.pitch + x + k * fit.samples))
            fetch_soon(picture.c, np.uintp((row + down) * (picture.width + 2 * PAD) + x + right))


@inlined
def fetch_all(array: Any, z: int) -> None:
    """Prefetch what an array (A, m, n) holds of ZOI ``z``."""
    each = array.shape[1] * array.shape[2]
    for n in range(0, each, LANES):
        fetch_later(array, np.uintp(z * each + n))


@parallel
def track(picture: PictureArgs, table: Any, fit: FitArgs, stop: StopArgs, out: OutArgs, todo: Any) -> None:
    """Measure ZOIs from the values in ``out.p`` and write what is found to ``out``.

    ``table`` (18,) has the weights of the taps (``splines.tap_table``). It is no part of the picture, since
    read from a tuple it lets the compiler sum in another order, and the last digit of float32 changes. ``todo`` (K,)
    are the places in ``out``; those whose iterations have begun go on.
    """
    counters, calling = np.zeros(SHARES, np.int64), caller()
    for share in prange(SHARES):
        keep_apart(calling)
        _track_share(picture, table, fit, stop, out, todo, counters, np.int64(share))


@part
def _track_share(
    picture: Any, table: Any, fit: Any, stop: Any, out: Any, todo: Any, counters: Any, share: int
) -> None:
    """The pieces of all ZOIs that one thread takes."""
    at_once = min(CHUNK, 1 + len(todo) // SHARES)  # of some lost ones each may take as long as a frame
    pieces = (len(todo) + at_once - 1) // at_once
    piece = next_piece(counters, share, pieces)
    while piece >= 0:
        start = piece * at_once
        _track_some(picture, table, fit, stop, out, todo, start, min(start + at_once, len(todo)))
        piece = next_piece(counters, share, pieces)


@part
def _track_some(
    picture: Any, table: Any, fit: Any, stop: Any, out: Any, todo: Any, start: int, end: int
) -> None:
    """``track`` for some ZOIs."""
    p, state, iterations = out.p, out.state, out.iterations
    count = fit.inverse.shape[1]
    half = p.shape[1] // 2
    reach = (fit.size - 1) / 2
    line = fit.rows.shape[1]
    g = np.zeros(ROWS * line + LANES, np.float32)
    ramp = np.arange(line).astype(np.float32)
    plan = new_plan(fit.size)
    columns = np.empty((DIFFERENCE_ROWS, line), np.float32)
    sums = np.empty((CHANNELS, DEGREES, DEGREES))
    buffers = plan, ramp, g, columns, sums
    m = np.empty(count)
    step = np.empty(count)
    solved = np.empty(count + LANES, np.float32)
    bent_by, known = np.empty(2 * N_HELD), np.zeros(2 * N_HELD, np.float32)
    for k in range(start, end):
        i = todo[k]
        z = fit.which[i]
        top, first = fit.origins[z]
        q = p[i]
        _fetch(picture, fit, fit.origins[fit.which[todo[min(k + AHEAD, len(todo) - 1)]]], q)
        after = fit.which[todo[min(k + 2, len(todo) - 1)]]
        fetch_all(fit.inverse, after)
        fetch_all(fit.cross, after)
        coming = fit.origins[fit.which[todo[min(k + 1, end - 1)]]]
        begun = np.intp(iterations[i])
        state[i] = RUNNING
        if begun == 0:
            out.left[i] = out.bending[i] = np.nan
            out.cubic[i, :] = np.nan
            out.nuisance[i, :] = np.nan
        for iteration in range(begun, stop.max_iterations):
            if not _within(picture, q, fit.order, first + reach, top + reach, reach):
                state[i] = LEFT_IMAGE
                break
            motion = int(q[half]) + PAD + BEYOND, int(q[0]) + PAD + BEYOND
            next_one = (coming[0] if iteration == begun else -1, coming[1], *motion)
            energy = _moments(picture, table, fit, top, first, q, buffers, next_one, m, bent_by)
            out.left[i] = solve(fit, z, m, step, energy, solved)
            take(fit, stop, out, i, z, q, step, step, bent_by, known, solved)
            if state[i] != RUNNING:
                break


@inlined
def take(
    fit: Any, stop: Any, out: Any, i: int, z: int, q: Any, step: Any, whole: Any, bent_by: Any, known: Any, solved: Any
) -> None:  # fmt: skip
    """Move ``q`` (modes,) of ZOI ``z`` by one linear fit, ``step`` (P,); what it shows is written to ``out`` at ``i``.

    ``whole`` (P,) is the fit to all of the difference, of which ``bent_by`` (14,) are the sums with the shapes and
    ``known`` (14,), px, is what the warp had of them; ``solved`` is for use.
    """
    modes = len(q)
    gain: Any = 1 + step[modes]
    out.nuisance[i, 0] = gain
    out.nuisance[i, 1] = step[modes + 3]
    out.nuisance[i, 2] = (step[modes + 6] + step[modes + 7]) / gain
    gain = min(max(gain, GAIN_RANGE[0]), GAIN_RANGE[1])
    out.bending[i] = bent(bent_by, fit.cross, z, whole, gain, fit.squares, known, solved, i, out.cubic)
    longest = 0.0
    for k in range(modes):
        longest = max(longest, abs(step[k]))
    longest /= gain
    if longest < 1e3:
        brake = min(1.0, MAX_STEP / longest) if longest > 0 else 1.0
        for k in range(modes):
            step[k] *= fit.units[k] * (brake / gain)
        compose(q, fit.order, step)
        out.iterations[i] += 1
        if brake == 1.0 and _converged(
            step, modes // 2, fit.size / 6.0, stop.length[z], stop.slope[z], stop.trust[z]
        ):
            out.state[i] = CONVERGED
    else:
        out.state[i] = DIVERGED


@helper
def _converged(step: Any, half: int, lever: Any, length_left: Any, slope_left: Any, trust: Any) -> Any:
    """Whether the error that this step has left is below the tolerances of u, v and the gradients."""
    move = max(abs(step[0]), abs(step[half]))
    turn = 0.0
    for k in range(1, 3):
        turn = max(turn, abs(step[k]), abs(step[half + k]))
    return is_short(max(move, turn * lever), lever, length_left, slope_left, trust)


@helper
def is_short(length: Any, lever: Any, length_left: Any, slope_left: Any, trust: Any) -> Any:
    """Whether a step of ``length`` px leaves less than the tolerances."""
    left = length * (LEFT_BY_MISFIT + LEFT_BY_NOISE * trust + LEFT_BY_LENGTH * length)
    return left <= length_left and left <= slope_left * lever


@shared
def warp_zois(picture: PictureArgs, table: Any, origins: Any, size: int, p: Any, out: Any) -> None:
    """The deformed image in every warped ZOI of order 1, (A, n, n) float32, written to ``out``."""
    in_shares(_warp_share, (picture, table, origins, size, p, out))


@part
def _warp_share(picture: Any, table: Any, origins: Any, size: int, p: Any, out: Any, share: int) -> None:
    line = (size + LANES - 1) // LANES * LANES
    rows, ramp = np.empty(line + LANES, np.float32), np.arange(line).astype(np.float32)
    _, _, where, how = new_plan(size)
    first, end = part_of(len(origins), share)
    for z in range(first, end):
        for y in range(size):
            warp_cut_rows(
                picture.c, picture.width + 2 * PAD, p[z], 1, origins[z, 1] + PAD, origins[z, 0] + PAD, y, 1, size,
                where, how, ramp, table, rows, line,
            )  # fmt: skip
            out[z, y] = rows[:size]


@helper
def compose_all(p: Any, steps: Any) -> None:
    """``compose`` for every ZOI of order 1, in place."""
    for z in range(len(p)):
        compose(p[z], 1, steps[z])


@helper
def within_image(picture: PictureArgs, origins: Any, size: int, p: Any, out: Any) -> None:
    """Whether each warped ZOI of order 1 lies in the image, written to ``out`` (A,) bool."""
    reach = (size - 1) / 2
    for z in range(len(p)):
        out[z] = _within(picture, p[z], 1, origins[z, 1] + reach, origins[z, 0] + reach, reach)
