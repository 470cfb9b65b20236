"""Blocks of ZOIs without a value, and the share of an area that is left."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.field.status import Status
from analysis.field.strain_field import StrainField

Bools = NDArray[np.bool_]

MIN_BLOCK = 9
"""ZOIs side by side that make a block, or ..."""
BLOCK_SHARE = 0.1
"""... this share of a smaller area."""


def in_blocks(where: Bools, least: int = MIN_BLOCK) -> Bools:
    """Which of the ZOIs ``where`` (R, C) lie in a group of at least ``least`` side by side, (R, C)."""
    from scipy.ndimage import label

    numbers, _ = label(where)
    counts = np.bincount(numbers.ravel())
    counts[0] = 0
    return np.asarray((counts >= least)[numbers])


def area_share(field: StrainField, where: ArrayLike | None = None) -> float:
    """The share of an area that a mean over its valid ZOIs stands for.

    1 unless a block of ZOIs that have a pattern is without a value: single ones that are missing change no mean.

    Parameters
    ----------
    field : StrainField
    where : (R, C) bool, optional
        The ZOIs of a gauge; None: all.
    """
    able = (field.status != Status.NOT_MEASURED) & (field.status != Status.NO_PATTERN)
    if where is not None:
        able &= np.asarray(where, bool)
    lost = able & ~field.ok
    n_lost, count = int(np.count_nonzero(lost)), int(np.count_nonzero(able))
    least = max(1, min(MIN_BLOCK, round(BLOCK_SHARE * count)))
    if n_lost < least or not in_blocks(lost, least).any():
        return 1.0
    return 1 - n_lost / count
