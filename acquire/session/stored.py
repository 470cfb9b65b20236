"""What stands in a session file, read as ``layout`` declares it: nothing else is believed, and what is odd is said."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from acquire import hdf5
from acquire.errors import DataError
from acquire.events import Event, EventKind
from acquire.frame import CameraInfo
from acquire.load_sample import LoadCellInfo
from acquire.session import layout
from acquire.text import Message, about, word
from acquire.text.message import taken

_NAMES_A_BURST = {EventKind.REFERENCE, EventKind.MEASURED}


class Oddities:
    """What is odd about the rows of ``what``, which may come by the piece.

    Where the file was not ``closed``, the last rows may not be written yet: they are not missed.
    """

    def __init__(self, what: str, *, closed: bool) -> None:
        self._what, self._closed = what, closed
        self._rows = self._kept = self._unwritten = self._gone = self._backwards = 0
        self._first_back, self._last = -1, -np.inf

    @property
    def left_out(self) -> int:
        """Rows before the last good one, or before the end, that are left out."""
        return self._gone + self._unwritten * self._closed

    def add(self, good: NDArray[np.bool_], times: NDArray[np.float64]) -> None:
        """Rows, (N,), of which those that are ``good`` have these times."""
        if len(times):
            end = len(good) - int(np.argmax(good[::-1]))
            self._gone += self._unwritten + end - len(times)
            self._unwritten = 0
            wrong = np.flatnonzero(np.diff(times, prepend=self._last) < 0)
            if wrong.size and not self._backwards:
                self._first_back = self._kept + int(wrong[0]) - 1
            self._backwards, self._last = self._backwards + wrong.size, times[-1]
        else:
            end = 0
        self._unwritten += len(good) - end
        self._rows, self._kept = self._rows + len(good), self._kept + len(times)

    def words(self) -> tuple[str, ...]:
        """A sentence each, for a person."""
        words, what = [], word(self._what)
        if not self._closed and self._rows and not self._kept:
            words.append(Message("none of {rows} {what} has a time, so all are left out", self._rows, what))
        if self.left_out:
            there = self._rows - self._unwritten * (not self._closed)
            words.append(
                Message(
                    "{left_out} of {there} {what} have no time, or values beyond sense, and are left out",
                    self.left_out,
                    there,
                    what,
                )
            )
        if self._backwards:
            words.append(
                Message(
                    "the times of {what} run backwards at {backwards} places, first after row {first_back}",
                    what,
                    self._backwards,
                    self._first_back,
                )
            )
        return tuple(words)


def camera_from(text: Any, where: str) -> CameraInfo:
    """The camera whose description stands in ``text``; raises DataError where it is none."""
    values = _described(text, layout.CAMERA_FIELDS, where)
    if values["width"] * values["height"] > layout.MAX_PIXELS:
        raise DataError(
            "{where}: pictures of {values} x {values2} px are beyond sense",
            where,
            values["width"],
            values["height"],
        )
    return CameraInfo(**values)


def load_from(text: Any, where: str) -> LoadCellInfo | None:
    """The load cell, or None for "null"; raises DataError where it is neither."""
    if bytes(text).strip() == b"null":
        return None
    return LoadCellInfo(**_described(text, layout.LOAD_FIELDS, where))


def _described(text: Any, form: Mapping[str, hdf5.JsonField], where: str) -> dict[str, Any]:
    values = hdf5.read_object(text, where)
    hdf5.check_object(values, form, where)
    return {name: values[name] for name in form if name in values} | {
        "warnings": tuple(map(str, values["warnings"]))
    }


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """The rows of a table that can be used.

    Attributes
    ----------
    columns : mapping of name to (N,) array
    places : (N,) int
        Which row of the file each of them is.
    troubles : tuple of str
        What was left out or is odd, for a person.
    """

    columns: Mapping[str, NDArray[Any]]
    places: NDArray[np.intp]
    troubles: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.places)


def read_column(
    item: h5py.Dataset, n: int | None = None, missing: Any = 0, *, first: int = 0, whole: bool
) -> NDArray[Any]:
    """The rows from ``first`` to ``n``, or to the last that is stored.

    Where not ``whole``, ``missing`` stands in place of damaged chunks, and of chunks of times that are all zero: their
    bytes were never written.
    """
    n = _stored_rows(item, whole) if n is None else n
    step = item.chunks[0] if item.chunks else max(n, 1)
    starts = np.arange(first - first % step, n, step)
    try:
        values = np.asarray(item[first:n])
    except hdf5.DAMAGE:
        if whole:
            raise
        values = np.full(max(n - first, 0), missing, item.dtype)
        for start in starts.tolist():
            low, high = max(start, first), min(start + step, n)
            with contextlib.suppress(*hdf5.DAMAGE):
                values[low - first : high - first] = item[low:high]
    if not whole and len(values) > 1 and item.name.endswith("_s"):
        written = np.logical_or.reduceat(values != 0, np.maximum(starts - first, 0))
        values[~np.repeat(written, step)[first - int(starts[0]) :][: len(values)]] = missing
    return values


def _stored_rows(item: h5py.Dataset, whole: bool) -> int:
    try:
        return hdf5.stored_rows(item)
    except hdf5.DAMAGE:
        if whole:
            raise
        return int(item.shape[0])


def same_length(group: h5py.Group, items: Sequence[h5py.Dataset], *, whole: bool) -> int:
    """The rows that all ``items`` of ``group`` have; raises DataError where ``whole`` and one has more."""
    lengths = [_stored_rows(item, whole) for item in items]
    n, extents = min(lengths), {len(item) for item in items}
    if whole and {*lengths, *extents} != {n}:
        raise DataError(
            "{filename}: {name} has {n} to {most} rows, not one number of them in all its columns; the file is "
            "damaged: 'phasedic recover' saves the rows that are whole",
            group.file.filename,
            group.name,
            n,
            max(extents),
        )
    return n


def usable(
    group: h5py.Group,
    table: Mapping[str, NDArray[Any]],
    columns: Mapping[str, hdf5.Declared],
    first: int = 0,
    *,
    whole: bool,
) -> NDArray[np.bool_]:
    """Which rows have a time and no value beyond its range; ``first`` is the number of the first of them.

    Raises
    ------
    DataError
        Where ``whole``, a value is beyond its range.
    """
    outside = {name: columns[name].outside(values) for name, values in table.items()}
    beyond = np.logical_or.reduce([*outside.values()], axis=0)
    if whole and beyond.any():
        raise DataError(_beyond(about(group.file.filename, group.name), table, outside, columns, first))
    return np.asarray(~(beyond | np.isnan(table["monotonic_s"])), np.bool_)


def read_rows(
    group: h5py.Group,
    columns: Mapping[str, hdf5.Declared],
    pictures: Sequence[h5py.Dataset] = (),
    *,
    whole: bool,
    closed: bool = True,
) -> Rows:
    """The rows of ``group`` that are complete in all columns and in the pictures.

    A row without a time is left out and reported. Times that run backwards are reported.

    Parameters
    ----------
    whole, closed : bool
        Nothing may be missing or beyond its range; else what is so is left out. The writer came to the end.

    Raises
    ------
    DataError
        Columns are missing or of another kind; where ``whole``, also of another length or out of range.
    """
    held = hdf5.open_datasets(group, columns)
    n = same_length(group, [*held.values(), *pictures], whole=whole)
    table = {name: read_column(item, n, columns[name].missing, whole=whole) for name, item in held.items()}
    for name in columns.keys() - held.keys():
        table[name] = np.full(n, columns[name].missing, columns[name].dtype)
    good = usable(group, table, columns, whole=whole)
    odd = Oddities(str(group.name).rpartition("/")[2], closed=closed)
    odd.add(good, table["monotonic_s"][good])
    places = np.flatnonzero(good)
    kept = {name: column[places] for name, column in table.items()}
    if odd.left_out:
        _count_as_lost(kept, table, good)
    return Rows(kept, places, odd.words())


def _beyond(where: str, table: Any, outside: Any, columns: Mapping[str, hdf5.Declared], first: int) -> str:
    name = next(name for name, rows in outside.items() if rows.any())
    row = int(np.argmax(outside[name]))
    low, high = columns[name].low, columns[name].high
    return Message(
        "{where}/{name} is {table} in row {first}, beyond {low:g} to {high:g}; the file is damaged: "
        "'phasedic recover' saves the other rows",
        where,
        name,
        table[name][row],
        first + row,
        low,
        high,
    )


def _count_as_lost(
    columns: dict[str, NDArray[Any]], table: dict[str, NDArray[Any]], good: NDArray[np.bool_]
) -> None:
    """What is left out was lost before the next one that is not."""
    name = next((name for name in ("lost_before", "lost") if name in table), None)
    if name is None:
        return
    frames = table["n"][: len(good)] if "n" in table else np.ones(len(good))
    gone = np.cumsum(np.where(good, 0, frames.astype(np.int64) + table[name][: len(good)]))
    columns[name] = columns[name] + np.diff(gone[good], prepend=0)


def events_from(rows: NDArray[np.bytes_], where: str, *, whole: bool) -> list[Event]:
    """The events that ``layout.event_rows`` wrote.

    Those of a kind that a newer program has added are left out.

    Raises
    ------
    DataError
        One is not as it was written; where not ``whole`` it is left out.
    """
    texts: list[bytearray] = []
    for row in rows.tolist():
        if row.startswith(layout.CONTINUED) and texts:
            texts[-1] += row[len(layout.CONTINUED) :]
        else:
            texts.append(bytearray(row))
    events = []
    for number, text in enumerate(texts):
        try:
            events.append(_event_from(bytes(text), Message("{where}: event {number}", where, number)))
        except DataError:
            if whole:
                raise
    return [event for event in events if event is not None]


def _event_from(text: bytes, where: str) -> Event | None:
    values = hdf5.read_object(text, where)
    hdf5.check_object(values, layout.EVENT_FIELDS, where)
    if values["kind"] not in {*EventKind}:
        return None
    kind = EventKind(values["kind"])
    if kind in _NAMES_A_BURST:
        hdf5.check_object(values["data"], layout.BURST_FIELDS, where)
    return Event(
        values["monotonic_s"], kind, values["source"], taken(values), values["level"], values["data"]
    )


def config_from(text: Any, where: str) -> dict[str, Any]:
    """The configuration: sections of keys."""
    config = hdf5.read_object(text, where)
    hdf5.check_object(config, dict.fromkeys(config, hdf5.JsonField(dict)), where)
    return config


def ledger_from(text: bytes, where: str) -> dict[str, Any] | None:
    """The final counts; None where they were not written."""
    return hdf5.read_object(text, where) if text else None
