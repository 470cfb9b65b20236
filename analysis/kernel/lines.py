"""Bands and noise of lines: what alternating light, a rolling shutter or a sensor adds to whole rows or columns.

What the fits leave shows them, averaged along each line over all ZOIs: the pattern and small errors of the displacement
cancel there. Bands of the reference are moved with it: as far as the lines of the two pictures stay parallel, taking
both off the deformed one makes the pictures alike again.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.field import Status
from analysis.kernel.solve import Solution

Floats = NDArray[np.float64]
Pixels = NDArray[np.float32]
Places = NDArray[np.intp]

LINES = 8.0
"""Variance of the means of lines over what noise of single pixels would leave in them: real pictures have up to 3.1."""
SAMPLE, MAX_ZOIS = 30, 1000
"""ZOIs that show whether there are lines, and how strong each is, at most."""


ROUNDS = 3
"""How often lines are taken off; each time more ZOIs show them."""
APART = 0.5
"""Distance of two lines in the deformed image, px, below which they count as one."""


def mend(solution: Solution) -> None:
    """Measure once more without wild pixels, and without lines, where the image has some."""
    from analysis.picture.impulses import without_impulses

    if not solution.reference.cleaned and solution.is_disturbed:
        mended = without_impulses(solution.image)
        if mended is not None:
            solution.measure_in(mended)
    for _ in range(ROUNDS):
        mended = without_lines(solution, solution.status == Status.OK) if solution.leaves_much else None
        if mended is None:
            return
        solution.had_lines = True
        solution.measure_in(mended)


def without_lines(solution: Solution, ok: NDArray[np.bool_]) -> Pixels | None:
    """The deformed image without lines, (H, W); None where the ZOIs ``ok`` (A,) show none."""
    if not ok.any():
        return None
    axis = lines_along(left_by_fit(solution, some(ok, SAMPLE)))
    if axis is None:
        return None
    which = some(ok, MAX_ZOIS)
    left = left_by_fit(solution, which).mean(axis=2 - axis)
    added = _profile(solution, which, left, axis)
    out = solution.image.astype(np.float32) - np.expand_dims(added, 1 - axis).astype(np.float32)
    out.flags.writeable = False
    return out


def lines_along(left: Pixels) -> int | None:
    """Whether what is left of ZOIs (N, n, n) is one value a row (0) or a column (1); None: neither."""
    within = inner(left)
    variance = max(float(np.mean(within**2)), 1e-12)
    shares = [float(np.mean(within.mean(axis=2 - k) ** 2)) * within.shape[1] / variance for k in (0, 1)]
    return int(np.argmax(shares)) if max(shares) > LINES else None


def inner(left: NDArray[np.floating]) -> NDArray[np.floating]:
    """What is left without the rims of the ZOIs and the mean of each, (N, m, m)."""
    rim = left.shape[1] // 8
    part = left[:, rim:-rim, rim:-rim]
    return np.asarray(part - part.mean(axis=(1, 2), keepdims=True))


def some(ok: NDArray[np.bool_], count: int) -> Places:
    """About ``count`` of those that are true, evenly spaced."""
    which = np.flatnonzero(ok)
    return which[:: max(1, len(which) // count)]


def left_by_fit(solution: Solution, which: Places) -> Pixels:
    """What displacement and gain leave of some ZOIs, (N, n, n), GL."""
    from analysis.fit.iteration import warp_zois

    ready, size = solution.reference.prepared, solution.reference.grid.size
    origins = ready.origins[which]
    p = np.ascontiguousarray(solution.found.p[which][:, solution.reference.affine])
    left = np.empty((len(which), size, size), np.float32)
    warp_zois(solution.picture, solution.table, origins, size, p, left)
    left -= zois_of(ready.images[3], origins, size)
    gain = solution.found.nuisance[which, 0].astype(np.float32)
    left -= (gain[:, None, None] - 1) * zois_of(ready.images[2], origins, size)
    return left


def zois_of(image: Pixels, origins: Places, size: int) -> Pixels:
    """The ZOIs of an image whose first pixels are ``origins`` (N, 2: row, column), (N, n, n)."""
    out = np.empty((len(origins), size, size), image.dtype)
    for to, (y, x) in zip(out, origins.tolist(), strict=True):
        to[:] = image[y : y + size, x : x + size]
    return out


def _profile(solution: Solution, which: Places, left: Floats, axis: int) -> Floats:
    """What each row (``axis`` 0) or column (1) of the deformed image has too much, from the means (N, n) of lines."""
    from scipy.interpolate import CubicSpline

    ready, size = solution.reference.prepared, solution.reference.grid.size
    p = solution.found.p[which][:, solution.reference.affine]
    at, stretch = (p[:, 3], p[:, 5]) if axis == 0 else (p[:, 0], p[:, 1])
    along = np.arange(size)
    line = ready.origins[which, axis][:, None] + along
    moved = line + at[:, None] + stretch[:, None] * (along - (size - 1) / 2)
    count = np.bincount(line.ravel())
    seen = count > 0
    place, mean = (np.bincount(line.ravel(), v.ravel())[seen] / count[seen] for v in (moved, left))
    kept = apart(place)
    lines = np.arange(ready.shape[axis])
    if len(kept) < 2:
        return np.zeros(len(lines))
    near = np.abs(lines - np.interp(lines, place[kept], place[kept])) < 1
    spline: Any = CubicSpline(place[kept], mean[kept])
    return np.where(near, spline(lines), 0.0)


def apart(place: Floats) -> list[int]:
    """Which of the places (N,), px, to take, in rising order: each at least ``APART`` beyond the one before.

    The lines of ZOIs that moved apart or over one another come out of order, or on the same place, where a curve
    through all of them has no limits.
    """
    kept: list[int] = []
    for k in np.argsort(place, kind="stable").tolist():
        if not kept or place[k] - place[kept[-1]] >= APART:
            kept.append(k)
    return kept
