"""Readings that grow by the day: the newest in memory, those before in a temporary file."""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right

import numpy as np
from numpy.typing import NDArray

from acquire.files.block_file import BlockFile

ROWS = 1 << 13
"""Readings of a block, which is read at once."""
Block = NDArray[np.float64]


class StoredReadings:
    """Times, which do not fall, and forces; one thread at a time may use it."""

    def __init__(self) -> None:
        self._file = BlockFile()
        self._filed: list[Block | int] = []
        self._starts = array("d")  # first time of each block that is filed
        self._times, self._forces = array("d"), array("d")  # of the block that is not full yet
        # Number and content of the block that was used last.
        self._used: tuple[int, Block] = -1, np.empty((2, 0))

    def append(self, t: float, force: float) -> None:
        """Add the newest."""
        self._times.append(t)
        self._forces.append(force)
        if len(self._times) == ROWS:
            block = np.array([self._times, self._forces])
            self._used = len(self._filed), block
            self._starts.append(self._times[0])
            self._filed.append(self._file.put(block))
            self._times, self._forces = array("d"), array("d")

    def __len__(self) -> int:
        return len(self._filed) * ROWS + len(self._times)

    @property
    def last_t(self) -> float:
        """Time of the newest of one or more, s."""
        return self._times[-1] if self._times else float(self._block(len(self._filed) - 1)[0, -1])

    def before(self, t: float) -> int:
        """The number of readings before ``t``."""
        if self._times and self._times[0] < t:
            return len(self._filed) * ROWS + bisect_left(self._times, t)
        k = bisect_left(self._starts, t) - 1
        return 0 if k < 0 else k * ROWS + int(np.searchsorted(self._block(k)[0], t))

    def until(self, t: float) -> int:
        """The number of readings before ``t`` and at it."""
        if self._times and self._times[0] <= t:
            return len(self._filed) * ROWS + bisect_right(self._times, t)
        k = bisect_right(self._starts, t) - 1
        return 0 if k < 0 else k * ROWS + int(np.searchsorted(self._block(k)[0], t, side="right"))

    def at(self, i: int) -> tuple[float, float]:
        """Time (s) and force (N) of one."""
        k, row = divmod(i, ROWS)
        if k == len(self._filed):
            return self._times[row], self._forces[row]
        t, force = self._block(k)[:, row].tolist()
        return t, force

    def part(self, first: int, stop: int) -> Block:
        """Times and forces from ``first`` up to, not including, ``stop``, (2, N)."""
        numbers = range(first // ROWS, -(-stop // ROWS) if stop > first else 0)
        parts = [self._block(k)[:, max(first - k * ROWS, 0) : stop - k * ROWS] for k in numbers]
        return np.concatenate([np.empty((2, 0)), *parts], axis=1)

    def _block(self, k: int) -> Block:
        if k == len(self._filed):
            return np.array([self._times, self._forces])
        if self._used[0] != k:
            stored = self._filed[k]
            numbers = (
                self._file.get(stored, "d", 2 * ROWS).reshape(2, ROWS) if isinstance(stored, int) else stored
            )
            self._used = k, numbers
        return self._used[1]
