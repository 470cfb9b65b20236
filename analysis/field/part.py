"""What is said of a part of a field, or of all of it.

A rectangular part is a field of its own. Of an area in which blocks of ZOIs have no value, a share is left. A picture
that is less sharp than its reference has a blur: a width in px, from the variance that it has grown by.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquire.text import Message
from analysis.field.grid import Roi, Status, ZoiGrid
from analysis.field.strain_field import StrainField
from analysis.field.uncertainty import Floats, Sums, fixed_sum, variance_of_sum

Bools = NDArray[np.bool_]

MIN_BLOCK = 9
"""ZOIs side by side that make a block, or ..."""
BLOCK_SHARE = 0.1
"""... this share of a smaller area."""


def in_blocks(where: Bools, least: int = MIN_BLOCK) -> Bools:
    """Which of the ZOIs ``where`` (R, C) lie in a group of at least ``least`` side by side, (R, C)."""
    from scipy.ndimage import label

    numbers, _ = label(where)
    counts = np.bincount(numbers.ravel())
    counts[0] = 0
    return np.asarray((counts >= least)[numbers])


def area_share(field: StrainField, where: ArrayLike | None = None) -> float:
    """The share of an area that a mean over its valid ZOIs stands for.

    1 unless a block of ZOIs that have a pattern is without a value: single ones that are missing change no mean.

    Parameters
    ----------
    field : StrainField
    where : (R, C) bool, optional
        The ZOIs of a gauge; None: all.
    """
    able = (field.status != Status.NOT_MEASURED) & (field.status != Status.NO_PATTERN)
    if where is not None:
        able &= np.asarray(where, bool)
    lost = able & ~field.ok
    n_lost, count = int(np.count_nonzero(lost)), int(np.count_nonzero(able))
    least = max(1, min(MIN_BLOCK, round(BLOCK_SHARE * count)))
    if n_lost < least or not in_blocks(lost, least).any():
        return 1.0
    return 1 - n_lost / count


class Blur(NamedTuple):
    """Standard deviation of the blur since the reference along one axis, and its standard uncertainty, px.

    Negative where the picture is sharper: the width by which the reference is blurred against it. NaN where it is not
    known.
    """

    px: float
    sigma: float

    @property
    def text(self) -> str:
        """In words, "less sharp by 0.41 ± 0.02 px"; empty where it is not known."""
        if not math.isfinite(self.px):
            return ""
        return Message(
            "{value} by {size:.2f} ± {sigma:.2f} px",
            Message("less sharp") if self.px >= 0 else Message("sharper"),
            abs(self.px),
            self.sigma,
        )


def mean_blur(field: StrainField) -> Blur:
    """The blur of the whole picture: from the mean variance over the valid ZOIs, whose windows overlap."""
    count = field.n_valid
    if field.blur is None or not count:
        return Blur(math.nan, math.nan)
    variance, sigma = field.blur.astype(np.float64)
    mean = fixed_sum(variance[field.ok]) / count
    # The blur weighs the pixels of a window evenly, as a displacement does: neighbours correlate alike.
    of_sum = variance_of_sum(np.where(field.ok, sigma, 0.0), "u", field.grid, field.window)
    px, uncertainty = widths(np.array([mean]), np.array([math.sqrt(max(of_sum, 0.0)) / count]))
    return Blur(float(px[0]), float(uncertainty[0]))


def blur_maps(field: StrainField) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Blur of each ZOI and its standard uncertainty, (R, C) px, as of ``Blur``."""
    nothing = np.full((2, *field.grid.shape), np.nan)
    px, sigma = widths(*(nothing if field.blur is None else field.blur.astype(np.float64)))
    return px.astype(np.float32), sigma.astype(np.float32)


def widths(variance: Floats, sigma: Floats) -> tuple[Floats, Floats]:
    """Signed roots of variances, px, and half of what their standard uncertainty either way makes of them."""
    px, low, high = (
        np.copysign(np.sqrt(np.abs(v)), v) for v in (variance, variance - sigma, variance + sigma)
    )
    return px, (high - low) / 2


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
