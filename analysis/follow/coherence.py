"""Which ZOIs move otherwise than all around them, and which belong together: compiled.

Strain varies from place to place, and displacement with it, but smoothly. A ZOI is compared with a fit of second degree
to its 5 x 5 neighbours that some wrong ones do not pull: the least sum of errors, by weights that are found again
(E. J. Schlossmacher, J. Am. Stat. Assoc. 68 (1973) 857-859, doi:10.1080/01621459.1973.10481436).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.compiled.loops import helper, part, shared
from analysis.compiled.shares import in_shares, part_of

ALLOWED_PX, ALLOWED_SIGMAS, ALLOWED_SPREADS = 0.05, 10.0, 6.0
"""How far a ZOI may lie from what its neighbours say: px, its own sigmas, and as many times what they lie off."""
SUPPORT = 3
"""Neighbours that move as a ZOI does, by their gradients, with which it does not stand alone: beside a crack."""
ROUGH, ALONE = 1, 2
# Of the fit: steps, ZOIs for the second degree, for the first; px
_STEPS, _FEW, _FLAT, _LEAST = 8, 9, 4, 1e-4


def _others() -> NDArray[np.float64]:
    """What a fit of second degree to the 24 others takes from each for the middle, (5, 5)."""
    y, x = (np.indices((5, 5)) - 2).reshape(2, -1)
    others = np.arange(25) != 12
    basis = np.stack([np.ones(25), x, y, x * x, x * y, y * y], axis=1)[others]
    weights = np.zeros(25)
    weights[others] = np.linalg.pinv(basis)[0]
    return weights.reshape(5, 5)


_WEIGHTS = _others()


@shared
def stand_out(p: Any, variance: Any, step: float, ok: Any, out: Any) -> None:
    """Which ZOIs lie off what their neighbours say.

    Parameters
    ----------
    p : (6, R, C)
        u, du_dx, du_dy, v, dv_dx, dv_dy; NaN where a ZOI is not ``ok``.
    variance : (21, R, C)
        ``StrainField.covariance``.
    step : float, px
        Between ZOIs.
    ok : (R, C) bool
    out : (R, C) uint8, written
        ``ALONE``, or ``ROUGH`` where only some of the neighbours move as it does.
    """
    in_shares(_stand_out_share, (p, variance, step, ok, out))


@part
def _stand_out_share(p: Any, variance: Any, step: float, ok: Any, out: Any, share: int) -> None:
    first, end = part_of(ok.shape[0], share)
    for r in range(first, end):
        _stand_out_in_row(p, variance, step, ok, r, out[r])


@part
def _stand_out_in_row(p: Any, variance: Any, step: float, ok: Any, r: int, out: Any) -> None:
    rows, columns = ok.shape
    smooth = np.zeros(columns, np.bool_)
    if 2 <= r < rows - 2 and columns > 4:
        _smooth_in_row(p, variance, r, smooth)
    for c in range(columns):
        if not ok[r, c] or smooth[c]:
            continue
        inner = 2 <= r < rows - 2 and 2 <= c < columns - 2
        if _is_supported(p, variance, step, ok, r, c):
            out[c] = inner * ROUGH
        elif _lies_off(p[0], variance[0, r, c], ok, r, c) or _lies_off(p[3], variance[15, r, c], ok, r, c):
            out[c] = ALONE
        else:
            out[c] = ROUGH


@part
def _smooth_in_row(p: Any, variance: Any, r: int, out: Any) -> None:
    """Which ZOIs of a row, with all their neighbours, lie where plain least squares expect them, but the ends."""
    count = len(out) - 4
    u, v = p[0, r, 2:-2].copy(), p[3, r, 2:-2].copy()
    for y in range(5):
        for x in range(5):
            weight = _WEIGHTS[y, x]
            for c in range(count):
                u[c] -= weight * p[0, r + y - 2, c + x]
                v[c] -= weight * p[3, r + y - 2, c + x]
    for c in range(count):
        sigma = math.sqrt(max(variance[0, r, c + 2], variance[15, r, c + 2]))
        out[c + 2] = max(abs(u[c]), abs(v[c])) <= ALLOWED_PX + ALLOWED_SIGMAS * sigma


@part
def _is_supported(p: Any, variance: Any, step: float, ok: Any, r: int, c: int) -> bool:
    """Whether enough of the eight around a ZOI move as it does."""
    number, alike = 0, 0
    for y in range(max(r - 1, 0), min(r + 2, ok.shape[0])):
        for x in range(max(c - 1, 0), min(c + 2, ok.shape[1])):
            if (y != r or x != c) and ok[y, x]:
                number += 1
                alike += _is_linked(p, variance, step, r, c, y, x)
    return alike >= min(number, SUPPORT)


@part
def _is_linked(p: Any, variance: Any, step: float, r: int, c: int, y: int, x: int) -> bool:
    """Whether the displacements of two ZOIs differ by what their gradients say."""
    for k in (0, 3):
        both = (
            0.5
            * step
            * ((x - c) * (p[k + 1, r, c] + p[k + 1, y, x]) + (y - r) * (p[k + 2, r, c] + p[k + 2, y, x]))
        )
        sigma = math.sqrt(variance[5 * k, r, c] + variance[5 * k, y, x])
        if not abs(p[k, y, x] - p[k, r, c] - both) <= ALLOWED_PX + ALLOWED_SIGMAS * sigma:
            return False
    return True


@part
def _lies_off(u: Any, variance: float, ok: Any, r: int, c: int) -> Any:
    """Whether a displacement of a ZOI lies off the robust fit to those around it."""
    basis, value, n = np.zeros((24, 6)), np.zeros(24), 0
    for y in range(max(r - 2, 0), min(r + 3, ok.shape[0])):
        for x in range(max(c - 2, 0), min(c + 3, ok.shape[1])):
            if (y != r or x != c) and ok[y, x]:
                a, b = float(x - c), float(y - r)
                basis[n, 0], basis[n, 1], basis[n, 2] = 1.0, a, b
                basis[n, 3], basis[n, 4], basis[n, 5] = a * a, a * b, b * b
                value[n] = u[y, x]
                n += 1
    if n < _FLAT:
        return False
    terms = 6 if n >= _FEW else 3
    basis, value = np.ascontiguousarray(basis[:n, :terms]), value[:n]
    weight, left, fit = np.ones(n), np.zeros(n), np.zeros(terms)
    for _ in range(_STEPS):
        normal = np.zeros((terms, terms))
        right = np.zeros(terms)
        for i in range(n):
            for j in range(terms):
                right[j] += weight[i] * basis[i, j] * value[i]
                for k in range(terms):
                    normal[j, k] += weight[i] * basis[i, j] * basis[i, k]
        for j in range(terms):
            normal[j, j] += 1e-6 * normal[0, 0]
        fit[:] = np.linalg.solve(normal, right)
        left[:] = np.abs(value - basis @ fit)
        weight = 1.0 / np.maximum(left, _LEAST)
    allowed = ALLOWED_PX + ALLOWED_SIGMAS * math.sqrt(variance) + ALLOWED_SPREADS * np.median(left)
    return abs(u[r, c] - fit[0]) > allowed


@helper
def label(p: Any, variance: Any, step: float, ok: Any, labels: Any) -> None:
    """Number the ZOIs that are linked to each other, side by side, from 1; ``labels`` (R, C), zero, is written."""
    rows, columns = ok.shape
    stack, number = np.empty((rows * columns, 2), np.intp), 0
    for first in range(rows * columns):
        if labels[first // columns, first % columns] or not ok[first // columns, first % columns]:
            continue
        number += 1
        stack[0, 0], stack[0, 1], top = first // columns, first % columns, 1
        labels[stack[0, 0], stack[0, 1]] = number
        while top > 0:
            top -= 1
            r, c = stack[top]
            for way in range(4):
                y, x = r + (way == 0) - (way == 1), c + (way == 2) - (way == 3)
                if y < 0 or x < 0 or y >= rows or x >= columns or labels[y, x] or not ok[y, x]:
                    continue
                if _is_linked(p, variance, step, r, c, y, x):
                    labels[y, x] = number
                    stack[top, 0], stack[top, 1] = y, x
                    top += 1
