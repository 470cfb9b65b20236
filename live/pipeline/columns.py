"""Columns of numbers and texts that grow by the hour: the newest blocks in memory, the others in a temporary file."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.files.block_file import BlockFile

_ROWS = 1024  # of a block


class NumberColumn:
    """Numbers in blocks of ``_ROWS``: the newest two in memory, the others in a file.

    A block of equal numbers takes the memory of one.
    """

    def __init__(self, kind: str, file: BlockFile) -> None:
        self._kind, self._file, self._count = kind, file, 0
        self._blocks: list[NDArray[Any] | int] = []

    def append(self, value: float) -> None:
        at = self._count % _ROWS
        if at == 0:
            self._file_last_but_one()
            self._blocks.append(np.zeros(_ROWS, self._kind))
        block = self._blocks[-1]
        assert not isinstance(block, int)
        block[at] = value
        if at == _ROWS - 1 and block.tobytes() == block[:1].tobytes() * _ROWS:
            self._blocks[-1] = np.broadcast_to(block[0], _ROWS)
        self._count += 1

    def _file_last_but_one(self) -> None:
        """The last one stays, for those that look at the newest time steps."""
        if len(self._blocks) > 1:
            block = self._blocks[-2]
            if not isinstance(block, int) and block.strides != (0,):
                self._blocks[-2] = self._file.put(block)

    def __getitem__(self, i: int) -> Any:  # float or int
        block, at = self._blocks[i // _ROWS], i % _ROWS
        if isinstance(block, int):
            return self._file.get(block + at * np.dtype(self._kind).itemsize, self._kind, 1).item()
        return block.item(at)

    def copied(self, count: int) -> NDArray[np.float64]:
        """The first ``count``, (count,) float64."""
        blocks = (
            self._file.get(one, self._kind, _ROWS) if isinstance(one, int) else one
            for one in list(self._blocks)
        )  # fmt: skip
        return np.concatenate([np.empty(0), *blocks])[:count]


class TextColumn:
    """Texts, each stored once: few of them differ."""

    def __init__(self, file: BlockFile) -> None:
        self._numbers: dict[str, int] = {}
        self._texts: list[str] = []
        self._column = NumberColumn("i", file)

    def append(self, text: str) -> None:
        if text not in self._numbers:
            self._texts.append(text)
            self._numbers[text] = len(self._numbers)
        self._column.append(self._numbers[text])

    def __getitem__(self, i: int) -> str:
        return self._texts[int(self._column[i])]
