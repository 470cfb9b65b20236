"""A measured field without ZOIs that stand out, and with the parts that it has come apart into. Compiled.

What a specimen does is coherent: a ZOI that was found elsewhere is not. Strain varies from place to place, and
displacement with it, but smoothly. A ZOI is compared with a fit of second degree to its 5 x 5 neighbours that some
wrong ones do not pull: the least sum of errors, by weights that are found again (E. J. Schlossmacher, J. Am. Stat.
Assoc. 68 (1973) 857-859, doi:10.1080/01621459.1973.10481436).

Parts that are coherent in themselves and jump against each other, by more than strain as on both sides of the gap may
make, have come apart: they share no strain.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.compiled.loops import helper, part, shared
from analysis.compiled.shares import in_shares, part_of
from analysis.field import PAIR_INDEX, Status, StrainField
from analysis.field.grid import overlap

ALLOWED_PX, ALLOWED_SIGMAS, ALLOWED_SPREADS = 0.05, 10.0, 6.0
"""How far a ZOI may lie from what its neighbours say: px, its own sigmas, and as many times what they lie off."""
SUPPORT = 3
"""Neighbours that move as a ZOI does, by their gradients, with which it does not stand alone: beside a crack."""
ROUGH, ALONE = 1, 2
# Of the fit: steps, ZOIs for the second degree, for the first; px
_STEPS, _FEW, _FLAT, _LEAST = 8, 9, 4, 1e-4

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

PART = 0.1
"""Share of the valid ZOIs that makes a part."""
MANY, CERTAIN, REACHES = 0.02, 1.5, (1, 2, 4)
"""Share of ZOIs that stand out from which on what is left is looked at, and widens the uncertainties above so much."""
NEAR = 11
"""Side of a square of ZOIs that holds one that stands out, wherever it lies about a ZOI that is among them."""
ROUNDS = 4
"""What is wrong hides others from its neighbours until it is left out."""
OPENED = 0.25
"""Of the side of a ZOI: a jump of less is a crack, which is part of the extension of its region, and uneven strain."""
MIN_PAIRS = 3
"""ZOIs that face each other across a gap from which on a jump is one."""
_VARIANCES = [PAIR_INDEX[i, i] for i in range(6)]


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


def coherent(field: StrainField) -> StrainField:
    """The field without ZOIs that stand out, which are LOST, and with its parts where it has come apart."""
    from analysis.compiled.loops import read_only

    step, rough, odd = float(field.grid.step), False, np.zeros(field.grid.shape, np.bool_)
    valid = field.n_valid
    for _ in range(ROUNDS):
        p, variance = read_only(_affine(field)), read_only(np.ascontiguousarray(field.covariance))
        out = np.zeros(field.grid.shape, np.uint8)
        stand_out(p, variance, step, read_only(field.ok), out)
        rough = rough or bool(out.any())
        if not (out == ALONE).any():
            break
        odd |= out == ALONE
        field = _without(field, odd)
    if field.n_valid < (1 - MANY) * valid:
        near = _among(odd)
        widened = np.where(near, np.float32(_incoherence(field, near)), np.float32(1))
        field = replace(field, covariance=field.covariance * widened)
    # As a rule ZOIs on a crack have no value.
    if rough or field.n_valid < field.grid.n_active:
        labels = np.zeros(field.grid.shape, np.int32)
        label(p, variance, step, read_only(field.ok), labels)
        field = replace(field, parts=_parts(field, labels))
    return field


def _among(odd: Bools) -> Bools:
    """The ZOIs (R, C) that lie among those that stand out; a part of the picture without such is not among them."""
    from scipy.ndimage import binary_dilation, binary_erosion

    around = np.ones((NEAR, NEAR), np.bool_)
    return np.asarray(binary_erosion(binary_dilation(odd, around), around, border_value=1))


def _affine(field: StrainField) -> Floats:
    """u, du_dx, du_dy, v, dv_dx, dv_dy, (6, R, C)."""
    shape = field.grid.shape
    whole = field.parameters.reshape(2, -1, *shape)[:, :3]
    return np.ascontiguousarray(whole.reshape(6, *shape), np.float64)


def _incoherence(field: StrainField, near: Bools) -> float:
    """Variance of a mean over that of its noise: what neighbours differ by beyond quadratics, and how far it reaches.

    Of the ZOIs ``near`` (R, C), among ones that stand out: what is wrong there says nothing of the rest.

    By differences of the second order along x of such along y, between ZOIs 1, 2 and 4 steps apart. Values that are
    wrong alone show it all in the nearest; what shows half of it only ``n`` steps apart is shared by n x n ZOIs.
    """
    u, sigma = _affine(field)[[0, 3]], np.sqrt(field.covariance[_VARIANCES][[0, 3]])
    second, found = np.array([1.0, -2.0, 1.0]) / 2, []
    for apart in REACHES:
        if min(field.grid.shape) <= 2 * apart + 1:
            break
        lines, columns = ([slice(k * apart, n - (2 - k) * apart) for k in range(3)] for n in u.shape[1:])
        each = product(zip(second, lines, strict=True), zip(second, columns, strict=True))
        left = sum(a * b * u[:, line, column] for (a, line), (b, column) in each)
        rho = overlap(field.window, field.grid.size, field.grid.step * apart, 3, 0)
        noise = second @ rho[abs(np.subtract.outer(np.arange(3), np.arange(3)))] @ second
        inner = np.s_[..., apart:-apart, apart:-apart]
        share = np.where(near[inner], (left / sigma[inner]) ** 2, np.nan)
        found.append(float(np.nanmean(share)) / noise**2 if np.isfinite(share).any() else np.nan)
    if not found or not np.isfinite(found).all():
        return 1.0
    reach = next(n for n, much in zip(REACHES, found, strict=False) if much >= max(found) / 2)
    return max(max(found) * reach**2, 1.0) if max(found) > CERTAIN else 1.0


def _without(field: StrainField, alone: Bools) -> StrainField:
    """The field with ZOIs (R, C) that are LOST."""
    blur = field.blur
    if blur is not None:
        blur = blur.copy()
        blur[0, alone] = np.nan
    none = np.where(alone, np.float32(np.nan), np.float32(0))
    return replace(
        field,
        parameters=field.parameters + none,
        covariance=field.covariance + none,
        covariance_reference=field.covariance_reference + none,
        residual=field.residual + none,
        blur=blur,
        status=np.where(alone, np.uint8(Status.LOST), field.status),
    )


def _parts(field: StrainField, labels: NDArray[np.int32]) -> NDArray[np.uint8] | None:
    """Numbers of the parts that have come apart, from 1, 0 beside them, (R, C); None where none have."""
    counts = np.bincount(labels.ravel())[1:]
    large = np.flatnonzero(counts >= PART * counts.sum()) + 1
    if len(large) < 2:
        return None
    parts = np.zeros(labels.shape, np.uint8)
    for number, k in enumerate(large, 1):
        parts[labels == k] = number
    for number in range(2, len(large) + 1):
        for other in range(1, number):
            if not any(_jumps(field, parts, (other, number), way) for way in (1, 2)):
                parts[parts == number] = other
    return parts if len(np.unique(parts[parts > 0])) > 1 else None


def _jumps(field: StrainField, parts: NDArray[np.uint8], two: tuple[int, int], way: int) -> bool:
    """Whether two parts move against each other by more than strain may make, along x (``way`` 1) or y (2)."""

    across, p = np.moveaxis(parts, -way, -1), np.moveaxis(_affine(field), -way, -1)
    sigma = np.moveaxis(np.sqrt(field.covariance[_VARIANCES]), -way, -1)
    line, at = np.nonzero(np.isin(across, two))
    beside = np.flatnonzero((np.diff(line) == 0) & (np.diff(across[line, at].astype(int)) != 0))
    if len(beside) < MIN_PAIRS:
        return False
    near, far = ((slice(None), line[k], at[k]) for k in (beside, beside + 1))
    length = field.grid.step * (at[beside + 1] - at[beside])
    moved, mean = p[far] - p[near], (p[near] + p[far]) / 2
    strained = length * (abs(p[near]) + abs(p[far]))
    doubt = ALLOWED_SIGMAS * np.hypot(sigma[near], sigma[far])
    beyond = [
        abs(moved[u] - length * mean[k])
        - strained[k]
        - doubt[u]
        - length / 2 * doubt[k]
        - OPENED * field.grid.size
        for u, k in ((0, way), (3, 3 + way))
    ]
    return bool(np.median(beyond, axis=1).max() > 0)
