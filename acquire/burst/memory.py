"""Memory of pictures, used again: fresh memory of a burst of 5 megapixels took 42 ms of the system's time.

That is more than half of the time for which a camera with eight buffers waits (AMD EPYC, virtual machine, 2 cores,
November 2026); averaging the same two frames takes 2 ms.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray


def _references(arrays: list[NDArray[Any]], i: int) -> int:
    """References to an array, those of its views included: they refer to the array that has the memory."""
    return sys.getrefcount(arrays[i])


_FREE = _references([np.empty(0)], 0)  # that of the list, and what this Python adds by asking


class PictureMemory:
    """Arrays of pictures that are used again once nobody has them; for one thread at a time."""

    def __init__(self) -> None:
        self._arrays: list[NDArray[Any]] = []

    def prepare(self, count: int, shape: tuple[int, ...], dtype: DTypeLike) -> None:
        """Have ``count`` arrays ready, and their memory really there."""
        arrays = [self.take(shape, dtype) for _ in range(count)]
        for array in arrays:
            array.fill(0)

    def take(self, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
        """An array with any content, to be written; it is kept for as long as anything refers to it or its views."""
        kind = np.dtype(dtype)
        for i in range(len(self._arrays)):
            if _references(self._arrays, i) == _FREE:
                array = self._arrays[i]
                if (array.shape, array.dtype) == (shape, kind):
                    array.flags.writeable = True
                    return array
        self._arrays.append(np.empty(shape, kind))
        return self._arrays[-1]
