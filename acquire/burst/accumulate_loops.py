"""The compiled loops behind ``acquire.burst.accumulate``; imported with the first burst: numba costs a second.

``fold`` passes once over the frames: sum, temporal differences and clipped pixels. ``tile_sums`` has gradients and
differences of two frames, tile by tile.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from acquire.compiled_loops import njit

GROUP = 8  # frames folded in one pass; a burst of at most so many never stores its sum
BLOCK = 4096  # pixels that stay in the first-level cache while the frames go by


def scratch(dtype: Any) -> tuple[NDArray[Any], NDArray[Any]]:
    """A block of sums and one of maxima for frames of this type; narrow types fill vectors best."""
    return np.empty(BLOCK, np.uint16 if np.dtype(dtype).itemsize == 1 else np.uint32), np.empty(BLOCK, dtype)


@njit(cache=True, nogil=True, error_model="numpy")
def fold(
    frames: tuple[NDArray[Any], ...],
    k: int,
    previous: NDArray[Any],
    sums: NDArray[Any],
    tops: NDArray[Any],
    total: NDArray[Any],
    mean: NDArray[np.float32],
    clipped: NDArray[np.bool_],
    saturation: int,
    first: bool,
    n: int,
) -> Any:
    """Add k frames to a burst; finish it when n > 0.

    Parameters
    ----------
    frames : GROUP arrays (P,) uint8 | uint16, GL
        The first k count; the rest fill up the tuple.
    previous : (P,) of the same type, GL
        The frame before them (not looked at when ``first``).
    sums, tops : (BLOCK,)
        Room to work in, from ``scratch``.
    total : (P,) uint32, or uint16 where that is enough, GL
        Sum so far; untouched when ``first`` and ``n > 0``.
    mean : (P,) float32, GL
        Written when ``n > 0``, else not looked at: the sum divided by n, correctly rounded.
    clipped : (P,) bool
        Set where a frame reaches ``saturation``.

    Returns
    -------
    int, GL^2
        Sum of the squared differences between successive frames, exact.
    """
    squares = np.uint64(0)
    for start in range(0, previous.size, BLOCK):
        stop = min(start + BLOCK, previous.size)
        part, top = sums[: stop - start], tops[: stop - start]
        fours = k // 4 * 4
        for i in range(0, fours, 4):
            a, b, c, d = frames[i], frames[i + 1], frames[i + 2], frames[i + 3]
            _add_four(a[start:stop], b[start:stop], c[start:stop], d[start:stop], part, top, i == 0)
        for i in range(fours, k):
            _add(frames[i][start:stop], part, top, i == 0)
        for i in range(1 if first else 0, k):
            before = previous if i == 0 else frames[i - 1]
            squares += _squares(frames[i][start:stop], before[start:stop])
        _mark(top, clipped[start:stop], saturation, first)
        if n > 0:
            _divide(part, total[start:stop], mean[start:stop], first, n)
        else:
            _keep(part, total[start:stop], first)
    return squares


# One plain loop for each step: the compiler vectorises these, but not their union.
@njit(cache=True, nogil=True, error_model="numpy")
def _add(image: NDArray[Any], part: NDArray[Any], top: NDArray[Any], begin: bool) -> None:
    if begin:
        for j in range(image.size):
            part[j] = image[j]
        for j in range(image.size):
            top[j] = image[j]
    else:
        for j in range(image.size):
            part[j] += image[j]
        for j in range(image.size):
            top[j] = max(top[j], image[j])


# Four at a time: sums and maxima are read and written a quarter as often.
@njit(cache=True, nogil=True, error_model="numpy")
def _add_four(
    a: NDArray[Any], b: NDArray[Any], c: NDArray[Any], d: NDArray[Any],
    part: NDArray[Any], top: NDArray[Any], begin: bool,
) -> None:  # fmt: skip
    if begin:
        for j in range(part.size):
            part[j] = np.uint32(a[j]) + np.uint32(b[j]) + np.uint32(c[j]) + np.uint32(d[j])
        for j in range(top.size):
            top[j] = max(max(a[j], b[j]), max(c[j], d[j]))
    else:
        for j in range(part.size):
            part[j] += np.uint32(a[j]) + np.uint32(b[j]) + np.uint32(c[j]) + np.uint32(d[j])
        for j in range(top.size):
            top[j] = max(top[j], max(max(a[j], b[j]), max(c[j], d[j])))


@njit(cache=True, nogil=True, error_model="numpy")
def _squares(image: NDArray[Any], before: NDArray[Any]) -> Any:
    if image.itemsize == 1:
        return _squares_8(image, before)
    return _squares_16(image, before)


# BLOCK * 255^2 fits into 32 bits, so 8-bit frames need no wider lanes.
@njit(cache=True, nogil=True, error_model="numpy", locals={"total": types.int32, "d": types.int32})
def _squares_8(image: NDArray[Any], before: NDArray[Any]) -> Any:
    total = np.int32(0)
    for j in range(image.size):
        d = np.int32(image[j]) - np.int32(before[j])
        total += d * d
    return np.uint64(total)


@njit(cache=True, nogil=True, error_model="numpy")
def _squares_16(image: NDArray[Any], before: NDArray[Any]) -> Any:
    total = np.uint64(0)
    for j in range(image.size):
        d = np.int32(image[j]) - np.int32(before[j])
        total += np.uint64(np.uint32(d * d))
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def _mark(top: NDArray[Any], flags: NDArray[np.bool_], saturation: int, first: bool) -> None:
    limit = top.dtype.type(saturation)
    if first:
        for j in range(top.size):
            flags[j] = top[j] >= limit
    else:
        for j in range(top.size):
            flags[j] |= top[j] >= limit


@njit(cache=True, nogil=True, error_model="numpy")
def _divide(part: NDArray[Any], total: NDArray[Any], mean: NDArray[np.float32], first: bool, n: int) -> None:
    if first:  # so small a sum is exact in float32, and so its quotient correctly rounded
        for j in range(part.size):
            mean[j] = np.float32(part[j]) / np.float32(n)
    else:
        for j in range(part.size):
            mean[j] = np.float32(np.float64(total[j] + part[j]) / np.float64(n))


@njit(cache=True, nogil=True, error_model="numpy")
def _keep(part: NDArray[Any], total: NDArray[Any], first: bool) -> None:
    if first:
        for j in range(part.size):
            total[j] = part[j]
    else:
        for j in range(part.size):
            total[j] += part[j]


@njit(cache=True, nogil=True, error_model="numpy")
def mean_of_sum(total: NDArray[Any], n: int, mean: NDArray[np.float32]) -> None:
    """Write the sum (P,) uint16 or uint32 divided by n, correctly rounded, as ``fold`` does."""
    if total.itemsize == 2:  # exact in float32
        for j in range(total.size):
            mean[j] = np.float32(total[j]) / np.float32(n)
    else:
        for j in range(total.size):
            mean[j] = np.float32(np.float64(total[j]) / np.float64(n))


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
