"""Bursts in a session: the exact sum of their frames, from which the mean comes back to the last bit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from acquire.frame import Burst, frozen
from acquire.hdf5 import GrowingDataset, PictureStack, RowTable
from acquire.record_mode import RecordMode
from acquire.session import layout


def mean_of(total: NDArray[Any], n: int) -> NDArray[np.float32]:
    """The mean as ``acquire.burst`` makes it: the sum divided by n in float64, rounded once."""
    return (total.astype(np.float64) / n).astype(np.float32)


def sum_of(mean: NDArray[np.float32], n: int) -> NDArray[np.uint32]:
    """The whole-number sum whose mean is ``mean``.

    Raises
    ------
    ValueError
        There is none: the mean was not made of whole grey levels.
    """
    total = np.rint(mean.astype(np.float64) * n).astype(np.uint32)
    if not np.array_equal(mean_of(total, n), mean):
        raise ValueError(f"the mean of a burst of {n} is no mean of whole grey levels")
    return total


class BurstTable:
    """Appends bursts to the group ``bursts``.

    Parameters
    ----------
    group : h5py.Group
    mode : RecordMode
        Says which part of the picture is kept.
    """

    def __init__(self, group: h5py.Group, mode: RecordMode) -> None:
        self._rows = RowTable(group, list(layout.BURST_COLUMNS))
        self._sums, self._clipped = PictureStack(group["sum"]), GrowingDataset(group["clipped"])
        self._mode = mode
        self.row_bytes = self._sums.row_bytes + self._clipped.row_bytes

    def append(self, burst: Burst, start: float) -> int:
        """Add a burst; its number.

        Raises
        ------
        ValueError
            Its sum does not fit, or is not whole.
        """
        total = sum_of(self._mode.cut(burst.mean), burst.n)
        if total.max(initial=0) > np.iinfo(self._sums.dtype).max:
            raise ValueError(f"the sum of {burst.n} frames does not fit into {self._sums.dtype}")
        row = self._rows.row(_row(burst, start))
        self._sums.append(total)
        self._clipped.append(np.packbits(self._mode.cut(burst.clipped))[np.newaxis])
        self._rows.hold(row)
        return self._rows.length - 1

    def write_rows(self) -> None:
        """Write the rows that are held."""
        self._rows.write()


def _row(burst: Burst, start: float) -> Mapping[str, Any]:
    names = ("n", "noise", "duration", "first_index", "last_index", "lost", "blank")
    times = {"time_s": burst.t - start, "monotonic_s": burst.t, "clock": layout.CLOCKS.index(burst.clock)}
    return times | {name: getattr(burst, name) for name in names}


def burst_from(total: NDArray[Any], clipped: NDArray[np.uint8], row: Mapping[str, Any], bits: int) -> Burst:
    """The burst of a sum, its packed clipped pixels and a row of ``layout.BURST_COLUMNS``."""
    flags = np.unpackbits(clipped, count=total.size).reshape(total.shape)
    return Burst(
        mean=frozen(mean_of(total, row["n"])),
        n=row["n"],
        noise=row["noise"],
        clipped=frozen(flags.astype(np.bool_)),
        bits=bits,
        t=row["monotonic_s"],
        duration=row["duration"],
        first_index=row["first_index"],
        last_index=row["last_index"],
        lost=row["lost"],
        blank=row["blank"],
        clock=layout.CLOCKS[row["clock"]],
    )
