"""The compiled sums behind ``acquire.burst.smear``: gradients and differences of two frames, tile by tile."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, nogil=True, error_model="numpy")
def tile_sums(first: NDArray[Any], last: NDArray[Any], rows: int, columns: int, step: int) -> Any:
    """Normal equations of the optical flow of each tile.

    Parameters
    ----------
    first, last : (H, W) uint8 | uint16, GL
    rows, columns : int
        Tiles.
    step : int
        Only every so many rows are looked at.

    Returns
    -------
    (rows, columns, 6) float64
        Sums of gx gx, gx gy, gy gy, gx d, gy d and the number of pixels; d = first - last.
    """
    height, width = first.shape
    sums = np.zeros((rows, columns, 6))
    for r in range(rows):
        for c in range(columns):
            left, right = max(1, c * width // columns), min(width - 1, (c + 1) * width // columns)
            for y in range(max(1, r * height // rows), min(height - 1, (r + 1) * height // rows), step):
                _add_row(first, last, y, left, right, sums[r, c])
    return sums


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _add_row(
    first: NDArray[Any], last: NDArray[Any], y: int, left: int, right: int, out: NDArray[np.float64]
) -> None:
    n = right - left
    a, b = first[y, left:right], last[y, left:right]
    a0, b0 = first[y, left - 1 : right - 1], last[y, left - 1 : right - 1]
    a1, b1 = first[y, left + 1 : right + 1], last[y, left + 1 : right + 1]
    au, bu = first[y - 1, left:right], last[y - 1, left:right]
    ad, bd = first[y + 1, left:right], last[y + 1, left:right]
    xx = xy = yy = xd = yd = np.float32(0)
    for j in range(n):
        # The gradient of their mean, so that neither frame is preferred.
        gx = np.float32(np.int32(a1[j]) + np.int32(b1[j]) - np.int32(a0[j]) - np.int32(b0[j])) * np.float32(
            0.25
        )
        gy = np.float32(np.int32(ad[j]) + np.int32(bd[j]) - np.int32(au[j]) - np.int32(bu[j])) * np.float32(
            0.25
        )
        d = np.float32(np.int32(a[j]) - np.int32(b[j]))
        xx += gx * gx
        xy += gx * gy
        yy += gy * gy
        xd += gx * d
        yd += gy * d
    out[0] += xx
    out[1] += xy
    out[2] += yy
    out[3] += xd
    out[4] += yd
    out[5] += n
