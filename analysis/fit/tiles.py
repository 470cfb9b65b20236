"""Tiles: ZOIs near each other, and the motion of third degree that they share. Compiled but for the layout."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.compiled.loops import helper, part
from analysis.picture.warp import moved, slopes

NODES = 8, 16
"""ZOIs of a tile down and along, about: the larger it is, the fewer pixels belong to two, and the farther is the motion
from a polynomial."""
MIN_ROWS, MIN_TILES = 2, 16
"""A tile has fewer ZOIs down, but not less than so many, where there were fewer tiles than this: threads share them."""
LOST = 0.25
"""A ZOI that departs more from the motion of its tile is left out of it and goes its own way, px."""
RIDGE = 1e-4
"""Weight of zero for the coefficients of second and third degree: a single row of ZOIs would not determine them."""
TERMS = 10
"""Coefficients of a motion along one axis (``smooth``)."""


class Tiles(NamedTuple):
    """Which ZOIs lie near each other, by their places in the reference alone.

    Attributes
    ----------
    order : (A,) int64
        The ZOIs tile by tile; in a tile row by row.
    ends : (T + 1,) int64
        Where tiles begin in ``order``.
    most : int
        ZOIs of the largest.
    height, width : int, px
        Of the highest and of the widest.
    """

    order: NDArray[np.int64]
    ends: NDArray[np.int64]
    most: int
    height: int
    width: int

    @classmethod
    def of(cls, origins: NDArray[np.int64], size: int, spacing: int) -> Tiles:
        """Those of ZOIs (A, 2), about ``spacing`` px apart, which need lie on no lattice."""
        rows = min(NODES[0], max(MIN_ROWS, len(origins) // (NODES[1] * MIN_TILES)))
        from_corner = origins - origins.min(axis=0, initial=np.iinfo(np.int64).max)
        span = from_corner.max(axis=0, initial=0) + 1
        count = np.maximum(1, np.rint(span / (spacing * np.array([rows, NODES[1]]))).astype(np.int64))
        down, along = (from_corner * count // span).T
        tile = down * count[1] + along
        order = np.argsort((tile * span[0] + from_corner[:, 0]) * span[1] + from_corner[:, 1], kind="stable")
        ends = np.flatnonzero(np.diff(tile[order], prepend=-1, append=-1)).astype(np.int64)
        high, wide = np.minimum(-(-span // count), span) + size
        return cls(order, ends, int(np.diff(ends).max(initial=0)), int(high), int(wide))


@part
def fit_motion(p: Any, members: Any, at: Any, joined: Any, lever: Any, unit: Any, normal: Any, t: Any) -> int:
    """The motion (2, 10) through values and gradients of some ZOIs, by least squares, written to ``t``; their number.

    Parameters
    ----------
    p : (B, 6)
    members : (n, 2)
        Their places in ``p``, and (not read) their numbers.
    at : (n, 2)
        Their centres (x, y) from the middle of the tile, in units of ``unit`` px.
    joined : (n,) bool
        Which of them count.
    lever : float, px
        A gradient counts as much as a displacement so many times as large.
    normal : (10, 10), for use here
    """
    value, along, down = np.empty(TERMS), np.zeros(TERMS), np.zeros(TERMS)
    by, count = lever / unit, 0
    normal[:] = 0
    t[:] = 0
    for k in range(len(members)):
        if not joined[k]:
            continue
        count += 1
        i, x, y = members[k, 0], at[k, 0], at[k, 1]
        value[0], value[1], value[2], value[3], value[4], value[5] = 1.0, x, y, x * x, x * y, y * y
        value[6], value[7], value[8], value[9] = x * x * x, x * x * y, x * y * y, y * y * y
        along[1], along[3], along[4], along[6], along[7], along[8] = 1, 2 * x, y, 3 * x * x, 2 * x * y, y * y
        down[2], down[4], down[5], down[7], down[8], down[9] = 1, x, 2 * y, x * x, 2 * x * y, 3 * y * y
        for j in range(TERMS):
            a, b = by * along[j], by * down[j]
            for c in range(2):
                t[c, j] += value[j] * p[i, 3 * c] + lever * (a * p[i, 3 * c + 1] + b * p[i, 3 * c + 2])
            for m in range(j + 1):
                normal[j, m] += value[j] * value[m] + by * (a * along[m] + b * down[m])
    if count:
        for j in range(3, TERMS):
            normal[j, j] += RIDGE * count
        _solve_both(normal, t)
    return count


@part
def _solve_both(normal: Any, t: Any) -> None:
    """Cholesky's solution, in place; the lower half of ``normal`` is read."""
    n = len(normal)
    for i in range(n):
        for j in range(i + 1):
            total = normal[i, j]
            for k in range(j):
                total -= normal[i, k] * normal[j, k]
            normal[i, j] = np.sqrt(total) if i == j else total / normal[j, j]
    for c in range(2):
        for i in range(n):
            total = t[c, i]
            for k in range(i):
                total -= normal[i, k] * t[c, k]
            t[c, i] = total / normal[i, i]
        for i in range(n - 1, -1, -1):
            total = t[c, i]
            for k in range(i + 1, n):
                total -= normal[k, i] * t[c, k]
            t[c, i] = total / normal[i, i]


@part
def departures(p: Any, members: Any, at: Any, t: Any, lever: Any, unit: Any, out: Any) -> None:
    """How far ZOIs are from the motion, (n, 2), px: u or v, and the gradients over the ``lever``."""
    e = 1 / unit
    for k in range(len(members)):
        i, place, turn = members[k, 0], 0.0, 0.0
        for c in range(2):
            along, down = slopes(t, c, at[k, 0], at[k, 1])
            place = max(place, abs(p[i, 3 * c] - moved(t, c, at[k, 0], at[k, 1])))
            turn = max(turn, abs(p[i, 3 * c + 1] - along * e), abs(p[i, 3 * c + 2] - down * e))
        out[k, 0], out[k, 1] = place, turn * lever


@helper
def within_zoi(t: Any, x: Any, y: Any, unit: Any, half: Any, mix: Any, q: Any, known: Any) -> None:
    """The motion of the tile around a ZOI: its affine part, as six parameters, and what it has beyond, px.

    ``q`` (6,) and ``known`` (14,), of the seven shapes (``shapes.N_HELD``) of u and of v, are written. A fit finds
    displacements along the axes of the deformed picture; those of the reference follow by (I + grad u)^-1.
    """
    s = half / unit
    s2, s3 = s * s, s * s * s
    k2, k3 = mix[2, 0] / mix[2, 2], mix[3, 1] / mix[3, 3]
    for c in range(2):
        a20 = (t[c, 3] + 3 * x * t[c, 6] + y * t[c, 7]) * s2
        a11 = (t[c, 4] + 2 * x * t[c, 7] + 2 * y * t[c, 8]) * s2
        a02 = (t[c, 5] + x * t[c, 8] + 3 * y * t[c, 9]) * s2
        a30, a21, a12, a03 = t[c, 6] * s3, t[c, 7] * s3, t[c, 8] * s3, t[c, 9] * s3
        along, down = slopes(t, c, x, y)
        q[3 * c] = moved(t, c, x, y) - k2 * (a20 + a02)
        q[3 * c + 1] = (along * s - k3 * a30 - k2 * a12) / half
        q[3 * c + 2] = (down * s - k3 * a03 - k2 * a21) / half
        n, tilt = 7 * c, mix[2, 2] * mix[1, 1]
        known[n], known[n + 1], known[n + 2] = a20 / mix[2, 2], a02 / mix[2, 2], a11 / mix[1, 1] ** 2
        known[n + 3], known[n + 4] = a30 / mix[3, 3], a21 / tilt
        known[n + 5], known[n + 6] = a12 / tilt, a03 / mix[3, 3]
    a, b, c_, e = 1 + q[1], q[2], q[4], 1 + q[5]
    det = a * e - b * c_
    for n in range(7):
        u, v = known[n], known[n + 7]
        known[n], known[n + 7] = (e * u - b * v) / det, (a * v - c_ * u) / det
