"""One warp for the ZOIs of a tile: the first step of their iteration, of order 1. Compiled.

Where ZOIs overlap, each pixel would be warped for each of them, 16 times at a step of a quarter of their size. Here the
ZOIs of a tile (``tiles``) share one motion of third degree through what is predicted for each, one warp, and the sums
down the columns of those that begin in the same row. What is left to each is its sums across and its linear fit.

A ZOI takes the affine part of the motion around its centre for its own start. What the motion has beyond that, rho of
seven shapes a component, the difference of the images lacks: to first order gain J_s rho, so that the moments are those
of an affine start less gain C rho, C = J' w J_s (``shapes.cross_moments``). The gain follows from its own row of the
fit: with m the moments and h that row of H^-1 it is (1 + h m) / (1 + h C rho).

A ZOI whose step ends its iteration is done; the others, those of tiles that a common motion does not fit, and those
that stand alone, go on by ``iteration.track``. So a ZOI's last digits depend on which others are measured with it: by
0.003 to 0.02 of its sigma (rms), 0.05 at most. Neither the number of threads nor their timing changes a bit, since one
thread does a tile.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import prange

from analysis.compiled.loops import inlined, parallel, part
from analysis.compiled.threads import SHARES, caller, keep_apart, next_piece
from analysis.compiled.vectors import LANES
from analysis.fit.iteration import GAIN_RANGE, fetch_all, is_short, moments_of, solve, take
from analysis.fit.kernel_args import DIVERGED, IMAGES, FitArgs, OutArgs, PictureArgs, StopArgs
from analysis.fit.moments import (
    CHANNELS,
    DEGREES,
    DIFFERENCE_ROWS,
    add_difference_columns,
    dot,
    weighted_rows,
)
from analysis.fit.shapes import N_HELD
from analysis.fit.tiles import LOST, TERMS, Tiles, departures, fit_motion, within_zoi
from analysis.picture.splines import PAD
from analysis.picture.warp import new_pieces, stays, warp_smooth

MODES = 6
MIN_SAVED = 0.8
"""Pixels of a tile over those of its ZOIs, above which sharing saves too little."""
MIN_JOINED = 1 / 3
"""Share of the ZOIs of a tile that must follow its motion."""
ROUNDS = 4
"""Times that ZOIs are left out at most: those that depart more than half as much as the worst, and more than LOST."""
MIN_DONE = 0.5
"""Share of those that must be done in one pass, for the tile to be warped."""


@parallel
def share_warps(
    picture: PictureArgs, table: Any, fit: FitArgs, stop: StopArgs, out: OutArgs, tiles: Tiles
) -> None:
    """One step of the ZOIs of all tiles that share a motion; those it does not suffice for have not CONVERGED.

    Arguments as for ``iteration.track``.
    """
    place = np.full(len(fit.origins), -1, np.int64)
    for i in range(len(fit.which)):
        place[fit.which[i]] = i
    counters, calling = np.zeros(SHARES, np.int64), caller()
    for share in prange(SHARES):
        keep_apart(calling)
        _some_tiles(picture, table, fit, stop, out, tiles, place, counters, np.int64(share))


@part
def _some_tiles(
    picture: Any, table: Any, fit: Any, stop: Any, out: Any, tiles: Any, place: Any, counters: Any, share: int
) -> None:
    """The tiles that one thread takes."""
    count = len(tiles.ends) - 1
    tile = next_piece(counters, share, count)
    if tile < 0:
        return
    line = (tiles.width + LANES - 1) // LANES * LANES + LANES
    g = np.zeros(tiles.height * line + 2 * LANES, np.float32)
    columns = np.zeros((DIFFERENCE_ROWS, line), np.float32)
    pieces, ramp = new_pieces(tiles.width), np.arange(LANES).astype(np.float32)
    members, at = np.empty((tiles.most, 2), np.int64), np.empty((tiles.most, 2))
    joined, normal, t = np.empty(tiles.most, np.bool_), np.empty((TERMS, TERMS)), np.empty((2, TERMS))
    while tile >= 0:
        n = 0
        for k in range(tiles.ends[tile], tiles.ends[tile + 1]):
            z = tiles.order[k]
            if place[z] >= 0:
                members[n, 0], members[n, 1] = place[z], z
                n += 1
        box, unit = _laid(fit, members[:n], at[:n])
        if _shares(picture, fit, stop, out, members[:n], at[:n], joined[:n], box, unit, normal, t):
            stride = picture.width + 2 * PAD
            also = fit.images, fit.samples, fit.pitch, IMAGES
            warp_smooth(picture.c, stride, t, unit, box, pieces, ramp, table, g, line, also)
            _steps(fit, stop, out, members[:n], at[:n], joined[:n], box, unit, t, g, line, columns)
        tile = next_piece(counters, share, count)


@part
def _laid(fit: Any, members: Any, at: Any) -> Any:
    """The rectangle of some ZOIs (top, left, height, width) and half of its longer side; their centres go to ``at``."""
    top = left = np.int64(1 << 40)
    bottom = right = np.int64(0)
    for k in range(len(members)):
        y, x = fit.origins[members[k, 1]]
        top, left, bottom, right = min(top, y), min(left, x), max(bottom, y), max(right, x)
    height, width = bottom - top + fit.size, right - left + fit.size
    unit = max(height, width) / 2
    for k in range(len(members)):
        y, x = fit.origins[members[k, 1]]
        at[k, 0] = (x - left - (width - fit.size) / 2) / unit
        at[k, 1] = (y - top - (height - fit.size) / 2) / unit
    return (top, left, height, width), unit


@part
def _shares(
    picture: Any, fit: Any, stop: Any, out: Any, members: Any, at: Any, joined: Any, box: Any, unit: Any,
    normal: Any, t: Any,
) -> bool:  # fmt: skip
    """Whether the ZOIs of a tile have a motion in common, written to ``t``, and which follow it, to ``joined``."""
    lever, pixels = fit.size / 6.0, box[2] * box[3]
    joined[:] = True
    enough = max(MIN_JOINED * len(members), pixels / (MIN_SAVED * fit.size**2))
    count, worst, away = len(members), np.inf, np.empty((len(members), 2))
    for _ in range(ROUNDS):
        if worst <= LOST or count < enough:
            break
        count = fit_motion(out.p, members, at, joined, lever, unit, normal, t)
        departures(out.p, members, at, t, lever, unit, away)
        worst = _leave_out(away[:, 0], joined)
    if worst > LOST or count < enough:
        return False
    done = 0
    for k in range(len(members)):
        if joined[k]:
            z = members[k, 1]
            done += is_short(max(away[k, 0], away[k, 1]), lever, stop.length[z], stop.slope[z], stop.trust[z])
    return done >= MIN_DONE * count and stays(picture, t, unit, box)


@part
def _leave_out(away: Any, joined: Any) -> Any:
    """The largest departure of those that have joined, px; ``joined`` is anew those that depart little beside it."""
    worst = 0.0
    for k in range(len(away)):
        if joined[k] and not away[k] <= worst:
            worst = away[k]
    for k in range(len(away)):
        joined[k] = away[k] <= max(LOST, worst / 2)
    return worst


@part
def _steps(
    fit: Any, stop: Any, out: Any, members: Any, at: Any, joined: Any, box: Any, unit: Any, t: Any, g: Any, line: int,
    columns: Any,
) -> None:  # fmt: skip
    """One linear fit of each ZOI that shares the warp ``g``; columns once for those that begin in the same row."""
    top, left, _, _ = box
    size = fit.size
    count = fit.inverse.shape[1]
    sums, m = np.empty((CHANNELS, DEGREES, DEGREES)), np.empty(count)
    step, whole, lacking = np.empty(count), np.empty(count), np.empty(count)
    solved, bent_by = np.empty(count + LANES, np.float32), np.empty(2 * N_HELD)
    known, q = np.zeros(2 * N_HELD + LANES, np.float32), np.empty(MODES)
    k = 0
    while k < len(members):
        if not joined[k]:
            k += 1
            continue
        y, x = fit.origins[members[k, 1]]
        end, last = k, x
        while end < len(members) and fit.origins[members[end, 1], 0] == y:
            if joined[end]:
                beside = fit.origins[members[end, 1], 1]
                if beside - last > size:
                    break
                last = beside
                fetch_all(fit.inverse, members[end, 1])
                fetch_all(fit.cross, members[end, 1])
            end += 1
        wide = last - x + size
        columns[:, : wide + LANES] = 0
        add_difference_columns(
            fit.images, np.uintp(fit.samples), np.uintp(y * fit.pitch + x), np.uintp(fit.pitch), g,
            np.uintp((y - top) * line + x - left), np.uintp(line), wide, 0, size, fit.rows, columns,
        )  # fmt: skip
        for n in range(k, end):
            if joined[n]:
                i, z = members[n]
                within_zoi(t, at[n, 0], at[n, 1], unit, size / 2, fit.mix, q, known)
                energy = moments_of(fit, columns, np.uintp(fit.origins[z, 1] - x), sums, m, bent_by)
                left_over = solve(fit, z, m, whole, energy, solved)
                beyond = _affine(fit, z, whole, known, lacking, solved, step)
                out.left[i] = left_over + beyond
                take(fit, stop, out, i, z, q, step, whole, bent_by, known, solved)
                if out.state[i] != DIVERGED:
                    out.p[i] = q
        k = end


@inlined
def _affine(fit: Any, z: int, whole: Any, known: Any, lacking: Any, solved: Any, step: Any) -> Any:
    """The fit ``step`` (P,) from an affine start, of ``whole`` (P,) to a difference that lacks ``known`` (14,) shapes.

    Returns what those would have added to the sum of squares.
    """
    count = len(whole)
    for k in range(count):
        at = np.uintp((z * count + k) * 2 * N_HELD)
        lacking[k] = dot(fit.cross, at, known, np.uintp(0), 2 * N_HELD)
    weighted_rows(fit.inverse, np.uintp(z * count * count), lacking, count, solved)
    gain: Any = (1 + whole[MODES]) / (1 + solved[MODES])
    for k in range(count):
        step[k] = whole[k] - gain * solved[k]
    beyond = 0.0
    for c in range(2):
        for k in range(c * N_HELD, (c + 1) * N_HELD):
            beyond += known[k] * known[k] * fit.squares[z, c]
    gain = min(max(gain, GAIN_RANGE[0]), GAIN_RANGE[1])
    return gain * gain * beyond
