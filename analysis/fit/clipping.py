"""How much of a ZOI lies on saturated pixels, in a compiled loop over the ZOIs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import prange
from numpy.typing import NDArray

from analysis.compiled.loops import parallel


def clipped_share(
    clipped: NDArray[np.bool_], first: NDArray[np.int64], line: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Share of the window weight of each ZOI on marked pixels, (A,).

    Parameters
    ----------
    clipped : (H, W) bool
    first : (A, 2) int64
        First row and column; ZOIs are moved into the image where they stick out.
    line : (n,) float64
        The window along one side.
    """
    marked = np.ascontiguousarray(clipped).view(np.uint8)
    marked.flags.writeable = False  # numba takes what may be written for another type
    out = np.empty(len(first))
    shares(marked, first, (line / line.sum()).astype(np.float32), out)
    return out


@parallel
def shares(marked: Any, first: Any, weight: Any, out: Any) -> None:
    """See ``clipped_share``; ``marked`` (H, W) uint8, ``out`` (A,) written."""
    size = weight.size
    for z in prange(len(first)):
        top = min(max(first[z, 0], 0), marked.shape[0] - size)
        left = min(max(first[z, 1], 0), marked.shape[1] - size)
        total = 0.0
        for y in range(size):
            row = marked[top + y, left : left + size]
            along = np.float32(0)
            for x in range(size):
                along += weight[x] * np.float32(row[x])
            total += weight[y] * along
        out[z] = total
