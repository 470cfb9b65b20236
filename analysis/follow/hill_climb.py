"""Each ZOI's own whole-pixel displacement: the best of some candidates, then uphill. Compiled."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.compiled.loops import inlined, part, read_only, shared
from analysis.compiled.shares import in_shares, part_of

f4 = np.float32
Image = NDArray[np.float32]
Places = NDArray[np.int64]
MAX_MOVES = 12


@inlined
def _dot(a: Any, b: Any, offset: Any) -> Any:
    """Sums of the products of two rows less ``offset``, of the second, and of its squares."""
    p = f4(0)
    q = f4(0)
    r = f4(0)
    for n in range(a.size):
        k = np.uintp(n)
        value = b[k] - offset
        p += (a[k] - offset) * value
        q += value
        r += value * value
    return p, q, r


@part
def correlation(
    reference: Any, deformed: Any, offset: Any, top: int, left: int, dy: int, dx: int, size: int
) -> Any:
    """Zero-mean normalised correlation of a ZOI with its shifted self; -2 outside the image."""
    height, width = deformed.shape
    if top + dy < 0 or left + dx < 0 or top + dy + size > height or left + dx + size > width:
        return -2.0
    fg = 0.0
    g = 0.0
    gg = 0.0
    f = 0.0
    ff = 0.0
    for y in range(size):
        a = reference[top + y, left : left + size]
        b = deformed[top + dy + y, left + dx : left + dx + size]
        p, q, r = _dot(a, b, offset)
        _, s, t = _dot(a, a, offset)
        fg += p
        g += q
        gg += r
        f += s
        ff += t
    n = size * size
    spread = (ff - f * f / n) * (gg - g * g / n)
    return (fg - f * g / n) / np.sqrt(spread) if spread > 0 else -1.0


def climbed(
    reference: Image, deformed: Image, offset: f4, origins: Places, size: int, candidates: Places, moves: int
) -> tuple[Places, NDArray[np.float64]]:
    """Displacements (x, y) (A, 2) and scores (A,) of ``climb``; the images are read, whoever may write to them."""
    images, near = (read_only(reference), read_only(deformed)), np.ascontiguousarray(candidates)
    found, score = np.zeros((len(origins), 2), np.int64), np.zeros(len(origins))
    climb(*images, offset, origins, size, near, moves, found, score)
    return found, score


@shared
def climb(
    reference: Any, deformed: Any, offset: Any, origins: Any, size: int, candidates: Any, moves: int, out: Any,
    score: Any,
) -> None:  # fmt: skip
    """Best whole-pixel displacement (x, y) of each ZOI.

    Parameters
    ----------
    reference, deformed : (H, W) float32
    offset : float32
        Taken off both, so that sums of squares keep their digits.
    origins : (A, 2) int64
    candidates : (A, K, 2) int64, (x, y)
    moves : int
        Uphill from the best of them at most.
    out : (A, 2) int64 and score : (A,) float64, written; score -2 where nothing lies in the image
    """
    in_shares(_climb_share, (reference, deformed, offset, origins, size, candidates, moves, out, score))


@part
def _climb_share(
    reference: Any, deformed: Any, offset: Any, origins: Any, size: int, candidates: Any, moves: int, out: Any,
    score: Any, share: int,
) -> None:  # fmt: skip
    first, end = part_of(len(origins), share)
    for z in range(first, end):
        top, left = origins[z]
        best = -2.0
        x = candidates[z, 0, 0]
        y = candidates[z, 0, 1]
        for k in range(candidates.shape[1]):
            cx = candidates[z, k, 0]
            cy = candidates[z, k, 1]
            if k > 0 and cx == candidates[z, k - 1, 0] and cy == candidates[z, k - 1, 1]:
                continue
            value = correlation(reference, deformed, offset, top, left, cy, cx, size)
            if value > best:
                best, x, y = value, cx, cy
        for _ in range(moves):
            sx = 0
            sy = 0
            for ny in range(-1, 2):
                for nx in range(-1, 2):
                    if nx != 0 or ny != 0:
                        value = correlation(reference, deformed, offset, top, left, y + ny, x + nx, size)
                        if value > best:
                            best, sx, sy = value, nx, ny
            if sx == 0 and sy == 0:
                break
            x += sx
            y += sy
        out[z, 0] = x
        out[z, 1] = y
        score[z] = best
