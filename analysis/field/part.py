"""A rectangular part of a field as a field of its own."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from analysis.field.grid import Roi, ZoiGrid
from analysis.field.status import Status
from analysis.field.strain_field import StrainField
from analysis.field.uncertainty import Floats, Sums

Bools = NDArray[np.bool_]
Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Block:
    """Rows and columns of the ZOIs of a grid."""

    rows: slice
    columns: slice

    @property
    def at(self) -> tuple[slice, slice]:
        """For arrays (R, C)."""
        return self.rows, self.columns

    def of(self, grid: ZoiGrid) -> ZoiGrid:
        """The part of ``grid``."""
        active = grid.active[self.at]
        x, y = grid.first_x[self.columns], grid.first_y[self.rows]
        width, height = (int(first[-1] - first[0]) + grid.size for first in (x, y))
        return ZoiGrid(Roi(x[0], y[0], width, height), grid.size, grid.step, active)


@dataclass(frozen=True, slots=True)
class PartSums:
    """``Sums`` of the whole grid, of ``shape``, for one block of it."""

    whole: Sums
    shape: tuple[int, int]
    block: Block

    def factor(self, name: str, where: Bools) -> float:
        """See ``Sums``."""
        everywhere = np.zeros(self.shape, np.bool_)
        everywhere[self.block.at] = where
        return self.whole.factor(name, everywhere)

    def information(self, at: NDArray[np.intp]) -> Floats:
        """See ``Sums``."""
        return self.whole.information(self._flat(at))

    def variance(self, at: NDArray[np.intp], weights: Floats) -> float:
        """See ``Sums``."""
        return self.whole.variance(self._flat(at), weights)

    def unit_variances(self, at: NDArray[np.intp]) -> Floats:
        """See ``Sums``."""
        return self.whole.unit_variances(self._flat(at))

    def kept(self, key: Hashable, make: Callable[[], Item]) -> Item:
        """See ``Sums``."""
        rows, columns = self.block.rows, self.block.columns
        return self.whole.kept((rows.start, rows.stop, columns.start, columns.stop, key), make)

    def _flat(self, at: NDArray[np.intp]) -> NDArray[np.intp]:
        """Flat places in the block as those on the whole grid."""
        every = np.arange(self.shape[0] * self.shape[1]).reshape(self.shape)
        return np.asarray(every[self.block.at].ravel()[at])


def part_of(field: StrainField, block: Block, grid: ZoiGrid | None = None) -> StrainField:
    """The ZOIs of ``field`` in ``block``, without its motion.

    Parameters
    ----------
    field : StrainField
    block : Block
    grid : ZoiGrid, optional
        Of the block, with fewer active ZOIs; those that are not active have no value.
    """
    own, at = grid or block.of(field.grid), (..., block.rows, block.columns)
    status = np.where(own.active, field.status[at], np.uint8(Status.NOT_MEASURED))
    off = ~own.active
    found = {name: getattr(field, name) for name in _ARRAYS}
    arrays = {name: values[at].copy() for name, values in found.items() if values is not None}
    for name in arrays.keys() & _VALUES:
        arrays[name][..., off] = np.nan
    sums = None if field.sums is None else PartSums(field.sums, field.grid.shape, block)
    common = None if field.common is None else field.common.part(block.rows, block.columns)
    return replace(field, grid=own, status=status, motion=None, sums=sums, common=common, **arrays)


_VALUES = {"parameters", "covariance", "covariance_reference", "residual", "blur"}
_ARRAYS = (*_VALUES, "iterations", "gain", "parts")
