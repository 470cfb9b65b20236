"""Growing HDF5 datasets row by row, without the cost of h5py's convenience layer.

A session has some twenty columns; the low-level calls take a tenth of the time of ``dataset.resize``
and ``dataset[n] = ...``, and rows that are written together share that.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray


class GrowingDataset:
    """Appends along the first axis of a dataset that has ``maxshape[0] = None``.

    Parameters
    ----------
    dataset : h5py.Dataset
    """

    def __init__(self, dataset: h5py.Dataset) -> None:
        self._id = dataset.id
        self._rest: tuple[int, ...] = dataset.shape[1:]
        self.dtype: np.dtype[Any] = dataset.dtype
        self.length = int(dataset.shape[0])
        self.row_bytes = math.prod(self._rest) * self.dtype.itemsize

    def append(self, rows: NDArray[Any]) -> None:
        """Add (n, ...) rows of the dataset's own type.

        Raises
        ------
        OSError or RuntimeError
            From HDF5, on a full disk among others.
        """
        block = np.ascontiguousarray(rows, self.dtype)
        self._id.set_extent((self.length + len(block), *self._rest))
        space = self._id.get_space()
        space.select_hyperslab((self.length, *(0 for _ in self._rest)), block.shape)
        self._id.write(h5py.h5s.create_simple(block.shape), space, block)
        self.length += len(block)


class Table:
    """The columns of one group. Rows are held until they are written together.

    Parameters
    ----------
    group : h5py.Group
    names : sequence of str
        The columns.

    Attributes
    ----------
    length : int
        Rows, those that are held among them.
    """

    def __init__(self, group: h5py.Group, names: Sequence[str]) -> None:
        self._columns = {name: GrowingDataset(group[name]) for name in names}
        self._row_type = np.dtype([(name, column.dtype) for name, column in self._columns.items()])
        self._held: list[NDArray[Any]] = []
        self.length = 0

    def row(self, values: Mapping[str, Any]) -> NDArray[Any]:
        """A row for ``hold``; ``values`` names every column.

        Raises
        ------
        OverflowError
            A value does not fit its column.
        """
        return np.array(tuple(values[name] for name in self._columns), self._row_type)

    def hold(self, row: NDArray[Any]) -> None:
        """Take a row."""
        self._held.append(row)
        self.length += 1

    def write(self) -> None:
        """Append the rows that are held, column by column."""
        held, self._held = self._held, []
        if held:
            rows = np.stack(held)
            for name, column in self._columns.items():
                column.append(rows[name])
