"""HDF5's Fletcher-32 of a picture, compiled: a thirtieth of the time that the library itself takes.

Imported when the first file is written, since numba costs half a second.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.compiled_loops import njit

LANES = 256  # words that are summed side by side, so that they fill vectors
ROWS = 360  # sums of the sums of so many words still fit into 32 bits
_MODULUS = np.uint64(65535)


def scratch() -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Room for ``fletcher32`` to work in."""
    return np.empty(LANES, np.uint32), np.empty(LANES, np.uint32)


@njit(cache=True, nogil=True, error_model="numpy")
def fletcher32(content: NDArray[np.uint8], sums: NDArray[np.uint32], weighted: NDArray[np.uint32]) -> Any:
    """The checksum that HDF5's filter gives for ``content``.

    Parameters
    ----------
    content : (n,) uint8
    sums, weighted : (LANES,) uint32
        From ``scratch``.

    Returns
    -------
    int
        32 bits. Source: ``H5_checksum_fletcher32`` of HDF5, the sum of 16-bit words and the sum of those sums.
    """
    words = content[: content.size // 2 * 2].view(np.uint16)
    first = second = np.uint64(0)
    start = 0
    while words.size - start >= LANES:
        stop = start + min(ROWS, (words.size - start) // LANES) * LANES
        _sum(words[start:stop], sums, weighted)
        second += np.uint64(stop - start) * first
        for lane in range(LANES):
            first += np.uint64(sums[lane])
            second += np.uint64(LANES) * np.uint64(weighted[lane]) - np.uint64(lane) * np.uint64(sums[lane])
        first, second, start = first % _MODULUS, second % _MODULUS, stop
    for word in words[start:]:
        first += np.uint64(word)
        second += first
    if content.size % 2:
        first += np.uint64(content[-1])
        second += first
    any_set = content.any()
    return _folded(second, any_set) << np.uint64(16) | _folded(first, any_set)


@njit(cache=True, nogil=True, error_model="numpy")
def _sum(words: NDArray[np.uint16], sums: NDArray[np.uint32], weighted: NDArray[np.uint32]) -> None:
    """The sum of each lane, and the sum of what that was after each row."""
    sums[:] = 0
    weighted[:] = 0
    for start in range(0, words.size, LANES):
        row = words[start : start + LANES]
        for lane in range(LANES):
            sums[lane] += np.uint32(row[lane])
            weighted[lane] += sums[lane]


@njit(cache=True, nogil=True, error_model="numpy")
def _folded(total: Any, any_set: bool) -> Any:
    # HDF5 sums words whose high byte comes first: modulo 65535 that is 256 times the sum of ours. It
    # folds carries in place of dividing, so that it has 65535 where a remainder is 0.
    rest = total % _MODULUS * np.uint64(256) % _MODULUS
    return _MODULUS if rest == 0 and any_set else rest
