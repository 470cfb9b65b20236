"""Bursts and load samples of a session.

A burst is stored as the exact sum of its frames, from which the mean comes back to the last bit. Load samples are read
by the piece: a day of them is larger than memory.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from acquire.frame import Burst, frozen
from acquire.hdf5 import GrowingDataset, PictureStack, RowTable, open_datasets, stored_rows
from acquire.load_sample import LoadFlag, LoadSample
from acquire.record_mode import RecordMode
from acquire.session import layout
from acquire.session.stored import Oddities, Rows, read_column, same_length, usable

PIECE = 1 << 16
"""Samples that are read at once."""
_STABLE = {code: word for word, code in layout.STABLE.items()}
_SAMPLE = ("monotonic_s", "force", "unit", "stable", "flags", "device_ms")
_TIME = "monotonic_s"


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


@dataclass(frozen=True, slots=True, eq=False)
class LoadPiece:
    """Samples in a row: their columns (``layout.LOAD_COLUMNS``), and the line of each; None where it is not there."""

    rows: Rows
    lines: Sequence[bytes | None]

    def samples(self) -> Iterator[LoadSample]:
        """Each whose line is there."""
        columns = [self.rows.columns[name].tolist() for name in _SAMPLE]
        for t, force, unit, stable, flags, device_ms, line in zip(*columns, self.lines, strict=True):
            if line is not None:
                ms = None if math.isnan(device_ms) else device_ms
                yield LoadSample(
                    t, force, unit.decode("ascii", "replace"), _STABLE[stable], LoadFlag(flags), line, ms
                )


class LoadTable:
    """The group ``load`` of a file, with its raw ``lines``; ``whole`` and ``closed`` as of ``stored.read_rows``."""

    def __init__(self, group: h5py.Group, lines: h5py.Dataset, *, whole: bool, closed: bool) -> None:
        self._group, self._lines, self._whole, self._closed = group, lines, whole, closed

    def pieces(self, low: float = -math.inf, high: float = math.inf) -> Iterator[LoadPiece]:
        """The samples from ``low`` to ``high`` (monotonic s); of other times nothing but these is read.

        Raises
        ------
        DataError, or what ``stored.DAMAGE`` names
            They cannot be read.
        """
        for table, good, first in self._tables(sorted(layout.LOAD_COLUMNS, key=_TIME.__ne__), low, high):
            places = np.flatnonzero(good)
            rows = Rows({name: column[places] for name, column in table.items()}, places + first)
            yield LoadPiece(rows, self._raw_lines(rows))

    def curve(self) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Times (monotonic s) and forces (N) of all samples, by the piece; raises as ``pieces``."""
        for table, good, _ in self._tables([_TIME, "force"]):
            yield table[_TIME][good], table["force"][good]

    def troubles(self) -> tuple[str, ...]:
        """What is left out or odd, for a person; of a whole file by the times alone. Raises as ``pieces``."""
        odd = Oddities("load", closed=self._closed)
        for table, good, _ in self._tables([_TIME] if self._whole else list(layout.LOAD_COLUMNS)):
            odd.add(good, table[_TIME][good])
        return odd.words()

    def _tables(
        self, names: Sequence[str], low: float = -math.inf, high: float = math.inf
    ) -> Iterator[tuple[dict[str, NDArray[Any]], NDArray[np.bool_], int]]:
        """Columns, which rows are good, and the number of the first; for ``low`` and ``high`` the time comes first."""
        held = open_datasets(self._group, layout.LOAD_COLUMNS)
        n = same_length(self._group, [*held.values()], whole=self._whole)
        for first in range(0, n, PIECE):
            table: dict[str, NDArray[Any]] = {}
            beside = np.zeros(1, np.bool_)
            for name in names:
                missing, last = layout.LOAD_COLUMNS[name].missing, min(first + PIECE, n)
                table[name] = read_column(held[name], last, missing, first=first, whole=self._whole)
                beside = (table[_TIME] < low) | (table[_TIME] > high) if _TIME in table else beside
                if beside.all():
                    break
            else:
                good = usable(self._group, table, layout.LOAD_COLUMNS, first, whole=self._whole)
                yield table, good & ~beside, first

    def _raw_lines(self, rows: Rows) -> list[bytes | None]:
        """The line of each sample; None where it is not in the file yet."""
        if not len(rows):
            return []
        first, last = int(rows.places[0]), int(rows.places[-1]) + 1
        before = read_column(
            self._group["line_end"], last, first=max(first - 1, 0), whole=self._whole
        ).astype(np.int64)
        every = before if first else np.concatenate([[0], before])
        starts, ends = every[rows.places - first], every[rows.places - first + 1]
        there = stored_rows(self._lines)
        if self._whole and (np.any(ends <= starts) or ends.max(initial=0) > there):
            raise ValueError("the lines of the samples do not follow one another")
        ends = np.where((starts >= 0) & (ends > starts) & (ends <= there), ends, -1)
        if not (ends >= 0).any():
            return [None] * len(rows)
        begin = int(starts[ends >= 0].min())
        content = read_column(self._lines, int(ends.max()), first=begin, whole=self._whole).tobytes()
        return [
            content[start - begin : end - begin - 1] if end >= 0 else None
            for start, end in zip(starts.tolist(), ends.tolist(), strict=True)
        ]
