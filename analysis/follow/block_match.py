"""Where small blocks of a picture are in another one, to a whole pixel: compiled.

By zero-mean normalised correlation, as ``cv2.matchTemplate`` has it, which took 25 us a block with its call; the loop
takes 3 (AMD EPYC, November 2026).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from analysis.compiled.loops import helper, shared
from analysis.compiled.shares import in_shares, part_of

f4 = np.float32


@shared
def match(
    reference: Any, padded: Any, margin: int, firsts: Any, size: int, guesses: Any, reach: int, out: Any
) -> None:
    """The best displacement (x, y) of each block within ``reach`` px of its guesses.

    A block without contrast stays at its first guess.

    Parameters
    ----------
    reference : (H, W) float32
    padded : (H + 2 margin, W + 2 margin) float32
        The other picture, continued beyond its edges; places beyond it are moved inside.
    margin : int, px
    firsts : (N, 2) int64
        First row and column of each block of ``size`` px.
    guesses : (N, K, 2) int64, (x, y)
    reach : int, px
    out : (N, 2) float64, written
    """
    in_shares(_match_share, (reference, padded, margin, firsts, size, guesses, reach, out))


@helper
def _match_share(
    reference: Any, padded: Any, margin: int, firsts: Any, size: int, guesses: Any, reach: int, out: Any, share: int
) -> None:  # fmt: skip
    first, end = part_of(len(firsts), share)
    for n in range(first, end):
        _match_block(reference, padded, margin, firsts[n], size, guesses[n], reach, out[n])


@helper
def _match_block(
    reference: Any, padded: Any, margin: int, first: Any, size: int, guesses: Any, reach: int, out: Any
) -> None:
    out[0], out[1] = guesses[0, 0], guesses[0, 1]
    block, square = _without_mean(reference, first, size)
    side, best = size + 2 * reach, f4(-2)
    for k in range(len(guesses)):
        if square <= 0 or _is_repeated(guesses, k):
            continue
        row, column = margin + first[0], margin + first[1]
        top = min(max(row + guesses[k, 1] - reach, 0), padded.shape[0] - side)
        left = min(max(column + guesses[k, 0] - reach, 0), padded.shape[1] - side)
        for y in range(2 * reach + 1):
            for x in range(2 * reach + 1):
                value = _correlation(block, square, padded, top + y, left + x, size)
                if value > best:
                    best = value
                    out[0], out[1] = left + x - column, top + y - row


@helper
def _is_repeated(guesses: Any, k: int) -> bool:
    for i in range(k):  # noqa: SIM110 - compiled
        if guesses[i, 0] == guesses[k, 0] and guesses[i, 1] == guesses[k, 1]:
            return True
    return False


@helper
def _without_mean(image: Any, first: Any, size: int) -> Any:
    """A block less its mean, and the sum of its squares."""
    block = np.empty((size, size), np.float32)
    total = 0.0
    for y in range(size):
        for x in range(size):
            total += image[first[0] + y, first[1] + x]
    mean, square = f4(total / (size * size)), f4(0)
    for y in range(size):
        row, to = image[first[0] + y, first[1] : first[1] + size], block[y]
        for x in range(size):
            to[x] = row[x] - mean
            square += to[x] * to[x]
    return block, square


@helper
def _correlation(block: Any, square: Any, image: Any, top: int, left: int, size: int) -> Any:
    """Of a block without its mean and the sum of its squares with a place of an image; 0 without contrast there."""
    product, total, squares = f4(0), f4(0), f4(0)
    # Sums of squares keep their digits where a grey level from inside is taken off.
    zero = image[top + size // 2, left + size // 2]
    for y in range(size):
        a, b = block[y], image[top + y, left : left + size]
        for x in range(size):
            value = b[x] - zero
            product += a[x] * value
            total += value
            squares += value * value
    spread = squares - total * total / f4(size * size)
    return product / f4(math.sqrt(square * spread)) if spread > 1e-6 * squares else f4(0)
