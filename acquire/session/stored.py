"""What stands in a session file, read as ``layout`` declares it: nothing else is believed."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

import h5py
import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from acquire.events import Event, EventKind, Level
from acquire.frame import CameraInfo
from acquire.hdf5 import (
    Declared,
    JsonField,
    check_object,
    open_dataset,
    open_datasets,
    read_object,
    stored_rows,
)
from acquire.load_sample import LoadCellInfo
from acquire.session import layout
from acquire.session.oddities import Oddities
from acquire.text import Message
from acquire.text.message import about, taken

ROOT = {
    "format_version": Declared("int", (), 1),
    "set_id": Declared("S"),
    "part": Declared("int", (), 0, 999_999),
}
ENTRY = {"record": Declared("S"), "crop": Declared("i8", (4,), 0, 65_535)}
START = {
    "start_time": Declared("S"),
    "start_monotonic_s": Declared("f8", (), -layout.MAX_TIME_S, layout.MAX_TIME_S),
}
TEXTS = dict.fromkeys(("config", "metadata", "versions"), Declared("S"))
EVENTS = Declared(f"S{layout.EVENT_BYTES}", (None,))
LEDGER = Declared(f"S{layout.LEDGER_BYTES}", (1,))
LINES = Declared("u1", (None,))

# What HDF5, JSON and our own decoding raise on bytes that are not what they were.
DAMAGE = (
    OSError,
    RuntimeError,
    LookupError,
    ValueError,
    TypeError,
    AttributeError,
    MemoryError,
    OverflowError,
)
_CLOCK = JsonField(str, words=layout.CLOCKS)
CAMERA_FIELDS = {
    "address": JsonField(str),
    "name": JsonField(str),
    "width": JsonField(int, 1, 65_535),
    "height": JsonField(int, 1, 65_535),
    "bits": JsonField(int, 1, 16),
    "live": JsonField(bool),
    "clock": _CLOCK,
    "fps": JsonField(float, 0, 1e9, missing=True),
    "exposure_s": JsonField(float, 0, 1e9, missing=True),
    "pixel_format": JsonField(str),
    "controls": JsonField(dict),
    "warnings": JsonField(list),
    "white_level": JsonField(int, 1, 65_535, missing=True),
}
LOAD_FIELDS = {
    "address": JsonField(str),
    "name": JsonField(str),
    "protocol": JsonField(str),
    "clock": _CLOCK,
    "sign": JsonField(int, -1, 1),
    "capacity_N": JsonField(float, 0, layout.MAX_FORCE_N, missing=True),
    "settings": JsonField(dict),
    "warnings": JsonField(list),
}
EVENT_FIELDS = {
    "monotonic_s": JsonField(float, -layout.MAX_TIME_S, layout.MAX_TIME_S),
    "kind": JsonField(str),
    "source": JsonField(str),
    "text": JsonField(str),
    "level": JsonField(str, words=get_args(Level)),
    "data": JsonField(dict),
}
_FRAME = JsonField(int, 0, 2**63 - 1)
BURST_FIELDS = {"first": _FRAME, "last": _FRAME, "n": JsonField(int, 1, 65_536)}
_NAMES_A_BURST = {EventKind.REFERENCE, EventKind.MEASURED}


def camera_from(text: Any, where: str) -> CameraInfo:
    """The camera whose description stands in ``text``; raises DataError where it is none."""
    values = _described(text, CAMERA_FIELDS, where)
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
    return LoadCellInfo(**_described(text, LOAD_FIELDS, where))


def _described(text: Any, form: Mapping[str, JsonField], where: str) -> dict[str, Any]:
    values = read_object(text, where)
    check_object(values, form, where)
    return {name: values[name] for name in form if name in values} | {
        "warnings": tuple(map(str, values["warnings"]))
    }


def pictures_of(camera: CameraInfo) -> dict[str, dict[str, Declared]]:
    """The pictures that frames and bursts of ``camera`` have, by group and name; for sums see ``open_sums``."""
    size = (None, camera.height, camera.width)
    packed = (camera.height * camera.width + 7) // 8
    return {
        "frames": {"image": Declared(layout.image_dtype(camera.bits).str, size)},
        "bursts": {"clipped": Declared("u1", (None, packed))},
    }


def open_sums(group: h5py.Group, camera: CameraInfo) -> h5py.Dataset:
    """The sums of bursts: of 16 or of 32 bits."""
    size = (None, camera.height, camera.width)
    try:
        return open_dataset(group, "sum", Declared("u2", size))
    except DataError:
        return open_dataset(group, "sum", Declared("u4", size))


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
    except DAMAGE:
        if whole:
            raise
        values = np.full(max(n - first, 0), missing, item.dtype)
        for start in starts.tolist():
            low, high = max(start, first), min(start + step, n)
            with contextlib.suppress(*DAMAGE):
                values[low - first : high - first] = item[low:high]
    if not whole and len(values) > 1 and item.name.endswith("_s"):
        written = np.logical_or.reduceat(values != 0, np.maximum(starts - first, 0))
        values[~np.repeat(written, step)[first - int(starts[0]) :][: len(values)]] = missing
    return values


def _stored_rows(item: h5py.Dataset, whole: bool) -> int:
    try:
        return stored_rows(item)
    except DAMAGE:
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
    columns: layout.Columns,
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
    declared = {name: columns[name].declared() for name in table}
    outside = {name: what.outside(table[name]) for name, what in declared.items()}
    beyond = np.logical_or.reduce([*outside.values()], axis=0)
    if whole and beyond.any():
        raise DataError(_beyond(about(group.file.filename, group.name), table, outside, declared, first))
    return np.asarray(~(beyond | np.isnan(table["monotonic_s"])), np.bool_)


def read_rows(
    group: h5py.Group,
    columns: layout.Columns,
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
    there = {name: column for name, column in columns.items() if name in group or not column.later}
    held = open_datasets(group, {name: column.declared() for name, column in there.items()})
    n = same_length(group, [*held.values(), *pictures], whole=whole)
    table = {name: read_column(item, n, columns[name].missing, whole=whole) for name, item in held.items()}
    for name in columns.keys() - there.keys():
        table[name] = np.full(n, columns[name].missing, columns[name].dtype)
    good = usable(group, table, columns, whole=whole)
    odd = Oddities(str(group.name).rpartition("/")[2], closed=closed)
    odd.add(good, table["monotonic_s"][good])
    places = np.flatnonzero(good)
    kept = {name: column[places] for name, column in table.items()}
    if odd.left_out:
        _count_as_lost(kept, table, good)
    return Rows(kept, places, odd.words())


def _beyond(where: str, table: Any, outside: Any, declared: Mapping[str, Declared], first: int) -> str:
    name = next(name for name, rows in outside.items() if rows.any())
    row = int(np.argmax(outside[name]))
    low, high = declared[name].low, declared[name].high
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
    values = read_object(text, where)
    check_object(values, EVENT_FIELDS, where)
    if values["kind"] not in {*EventKind}:
        return None
    kind = EventKind(values["kind"])
    if kind in _NAMES_A_BURST:
        check_object(values["data"], BURST_FIELDS, where)
    return Event(
        values["monotonic_s"], kind, values["source"], taken(values), values["level"], values["data"]
    )


def config_from(text: Any, where: str) -> dict[str, Any]:
    """The configuration: sections of keys."""
    config = read_object(text, where)
    check_object(config, dict.fromkeys(config, JsonField(dict)), where)
    return config


def ledger_from(text: bytes, where: str) -> dict[str, Any] | None:
    """The final counts; None where they were not written."""
    return read_object(text, where) if text else None
