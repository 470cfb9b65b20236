"""Each ZOI found from nothing: blocks of the picture first, then its own whole pixel."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.field import Roi
from analysis.follow.climb import climb
from analysis.follow.start import find_blocks


def search(
    reference: NDArray[np.float32],
    deformed: NDArray[np.float32],
    offset: Any,
    region: Roi,
    origins: NDArray[np.int64],
    size: int,
) -> NDArray[np.float64]:
    """Whole-pixel displacements of all ZOIs and the gradients of the blocks around them.

    Parameters
    ----------
    reference, deformed : (H, W) float32, GL
    offset : float32, GL
        Taken off both, so that sums of squares keep their digits.
    region : Roi
        Of the reference, where the ZOIs lie.
    origins : (A, 2) int64
        First row and column of each ZOI.
    size : int, px

    Returns
    -------
    (A, 6) float64 : u, du_dx, du_dy, v, dv_dx, dv_dy, px and px per px.
    """
    blocks = find_blocks(reference, deformed, region)
    centre = origins + (size - 1) / 2
    out = blocks.plane_at(centre[:, 0], centre[:, 1])
    around = blocks.around(centre[:, 0], centre[:, 1])
    candidates = np.rint(np.concatenate([out[:, None, [0, 3]], around], axis=1)).astype(np.int64)
    found = np.zeros((len(centre), 2), np.int64)
    climb(
        reference - offset, deformed - offset, origins, size,
        np.ascontiguousarray(candidates), found, np.zeros(len(centre)),
    )  # fmt: skip
    out[:, [0, 3]] = found
    return out
