"""A measured field without ZOIs that stand out, and with the parts that it has come apart into.

What a specimen does is coherent: a ZOI that was found elsewhere is not. Parts that are coherent in themselves and jump
against each other, by more than strain as on both sides of the gap may make, have come apart: they share no strain.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from analysis.field import PAIR_INDEX, Status, StrainField
from analysis.field.grid import overlap

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


def coherent(field: StrainField) -> StrainField:
    """The field without ZOIs that stand out, which are LOST, and with its parts where it has come apart."""
    from analysis.compiled.loops import read_only
    from analysis.follow.coherence import ALONE, label, stand_out

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
    from analysis.follow.coherence import ALLOWED_SIGMAS

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
