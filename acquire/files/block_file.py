"""Blocks of numbers that are put out of memory: what grows by the hour stands in a temporary file."""

from __future__ import annotations

import tempfile
import threading
import weakref
from typing import Any

import numpy as np
from numpy.typing import NDArray


class BlockFile:
    """Blocks of numbers in an unnamed temporary file, which is made with the first one."""

    def __init__(self) -> None:
        self._file: Any = None
        self._lock = threading.Lock()

    def put(self, block: NDArray[Any]) -> NDArray[Any] | int:
        """The place of a block that is written; the block itself where there is no room for it."""
        try:
            with self._lock:
                if self._file is None:
                    self._file = tempfile.TemporaryFile(prefix="phasedic-", buffering=0)  # noqa: SIM115
                    weakref.finalize(self, self._file.close)
                place: int = self._file.seek(0, 2)
                return place if self._file.write(block) == block.nbytes else block
        except OSError:
            return block

    def get(self, place: int, kind: str, count: int) -> NDArray[Any]:
        """``count`` numbers from ``place`` on."""
        numbers = np.empty(count, kind)
        with self._lock:
            self._file.seek(place)
            self._file.readinto(numbers)
        return numbers
