"""A rectangular part of a field as a field of its own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.field.grid import Roi, ZoiGrid
from analysis.field.status import Status
from analysis.field.strain_field import StrainField
from analysis.field.uncertainty import Floats, Sums, WeightedSum

Bools = NDArray[np.bool_]


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


@dataclass(frozen=True, slots=True, eq=False)
class PartSums:
    """``Sums`` of the whole grid for one block of it."""

    whole: Sums
    shape: tuple[int, int]
    block: Block

    def factor(self, name: str, where: Bools) -> float:
        """See ``Sums``."""
        return self.whole.factor(name, self._spread(where))

    def ratio(self, name: str, area: Bools, made: WeightedSum) -> float:
        """See ``Sums``."""

        def spread(measurable: Bools) -> tuple[Floats, Floats]:
            weights, noise = made(measurable[self.block.at])
            return self._spread(weights), self._spread(noise)

        return self.whole.ratio(name, self._spread(area), spread)

    def _spread(self, values: NDArray[Any]) -> NDArray[Any]:
        out = np.zeros((*values.shape[:-2], *self.shape), values.dtype)
        out[..., self.block.rows, self.block.columns] = values
        return out


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
_ARRAYS = (*_VALUES, "iterations", "gain")
