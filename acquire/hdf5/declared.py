"""What a file must hold, as data, and the check of it: shape, type and range of everything that is read.

A file from elsewhere may hold anything. Nothing outside of it is ever opened: links must be hard, and
values must stand in the file itself. A dataset is read only once its size is that of what is stored.
``JsonField`` and ``read_object`` check the JSON in a file in the same way.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from acquire.hdf5.tables import as_text
from acquire.text import Message

_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}
_MAX_BYTES = 1 << 31  # of a chunk, and of a column in memory
_TEXTS = {
    "S": Message("a text of fixed length"),
    "text": "a text",
    "int": Message("a whole number"),
    "number": "a number",
}


@dataclass(frozen=True, slots=True)
class Declared:
    """What a dataset or attribute must be.

    Attributes
    ----------
    dtype : str
        As numpy names it; "S": text of any fixed length, "text": text of any kind, "int": any whole number,
        "number": any number.
    shape : tuple of int or None
        None: of any length.
    low, high : float
        Range of its values, ends included; not a number is within.
    """

    dtype: str
    shape: tuple[int | None, ...] = ()
    low: float = -math.inf
    high: float = math.inf

    def takes_type(self, dtype: np.dtype[Any]) -> bool:
        """Whether values of this type may stand there."""
        if self.dtype == "S":
            return dtype.kind == "S"
        if self.dtype == "text":
            return dtype.kind == "S" or h5py.check_string_dtype(dtype) is not None
        if self.dtype in ("int", "number"):
            return dtype.kind in ("iu" if self.dtype == "int" else "iuf") and dtype.isnative
        return dtype == np.dtype(self.dtype) and dtype.names is None

    def takes_shape(self, shape: tuple[int, ...] | None) -> bool:
        """Whether it may have this shape; None is that of an empty dataspace."""
        return (
            shape is not None
            and len(shape) == len(self.shape)
            and all(want is None or want == have for want, have in zip(self.shape, shape, strict=True))
        )

    def outside(self, values: NDArray[Any]) -> NDArray[np.bool_]:
        """Where values leave the range."""
        if values.dtype.kind not in "iuf" or not self.is_bounded:
            return np.zeros(values.shape, np.bool_)
        return (values < self.low) | (values > self.high)

    def takes_value(self, value: Any) -> bool:
        """Whether one value is within the range; NaN is in no range."""
        one = np.asarray(value)
        if one.dtype.kind not in "iuf" or not self.is_bounded:
            return True
        return bool(np.all((self.low <= one) & (one <= self.high)))

    @property
    def is_bounded(self) -> bool:
        """Whether a range is demanded at all."""
        return (self.low, self.high) != (-math.inf, math.inf)

    def words(self) -> str:
        """For a person."""
        kind = _TEXTS.get(self.dtype, self.dtype)
        sizes = ", ".join("N" if size is None else str(size) for size in self.shape)
        return (
            Message("{kind} of shape ({sizes})", kind, sizes)
            if self.shape
            else Message("one {kind}", kind)
            if kind == self.dtype
            else kind
        )


def open_group(parent: h5py.Group, name: str) -> h5py.Group:
    """The group ``name``, all of whose links are found to be hard.

    Raises
    ------
    DataError
        It is not there or no group, or something in it stands in another place.
    """
    group = _member(parent, name)
    if not isinstance(group, h5py.Group):
        raise _wrong(parent, name, Message("is not a group"))
    check_links(group)
    return group


def check_links(group: h5py.Group) -> None:
    """Refuse a group in which anything stands in another place, without going there; raises DataError."""
    for name in group:
        if group.id.links.get_info(name.encode(errors="surrogateescape")).type != h5py.h5l.TYPE_HARD:
            raise _wrong(group, name, Message("is a link to another place, which is not followed"))


def open_dataset(group: h5py.Group, name: str, declared: Declared) -> h5py.Dataset:
    """The dataset ``name``, whose values stand in this file and have the declared type and shape.

    Raises
    ------
    DataError
        It is not there, or not so.
    """
    dataset = _member(group, name)
    if not isinstance(dataset, h5py.Dataset):
        raise _wrong(group, name, Message("is not a dataset"))
    _check_storage(dataset)
    try:
        dtype = dataset.dtype
    except TypeError as error:
        raise _wrong(group, name, Message("is of a type that is not known here ({error})", error)) from error
    if not (declared.takes_type(dtype) and declared.takes_shape(dataset.shape)):
        raise _wrong(
            group,
            name,
            Message(
                "is {dtype} of shape {shape}; it must be {words}", dtype, dataset.shape, declared.words()
            ),
        )
    if declared.shape[1:] == () and dataset.nbytes > _MAX_BYTES:
        raise _wrong(group, name, Message("is {nbytes} MB large; no test is so long", dataset.nbytes >> 20))
    return dataset


def open_datasets(group: h5py.Group, declared: Mapping[str, Declared]) -> dict[str, h5py.Dataset]:
    """All of them by name; raises as ``open_dataset``."""
    return {name: open_dataset(group, name, what) for name, what in declared.items()}


def _member(group: h5py.Group, name: str) -> Any:
    if not group.id.links.exists(name.encode()):
        raise _wrong(group, name, Message("is missing"))
    if group.id.links.get_info(name.encode()).type != h5py.h5l.TYPE_HARD:
        raise _wrong(group, name, Message("is a link to another place, which is not followed"))
    return group[name]


def _check_storage(dataset: h5py.Dataset) -> None:
    """Looks at how a dataset is stored before anything else is asked of it: asking may open another file."""
    plan = dataset.id.get_create_plist()
    layout = plan.get_layout()
    if layout == h5py.h5d.VIRTUAL or plan.get_external_count():
        raise _wrong(
            dataset.parent, dataset.name, Message("has its values in another file, which is not opened")
        )
    for k in range(plan.get_nfilters()):
        if (number := plan.get_filter(k)[0]) not in _FILTERS:
            raise _wrong(
                dataset.parent,
                dataset.name,
                Message("is stored by filter {number}, which is not known here", number),
            )
    if layout == h5py.h5d.CHUNKED:
        size = math.prod(plan.get_chunk()) * dataset.id.get_type().get_size()
        if size > _MAX_BYTES:
            raise _wrong(
                dataset.parent,
                dataset.name,
                Message("has pieces of {size} MB, more than is read at once", size >> 20),
            )


def stored_rows(dataset: h5py.Dataset) -> int:
    """Rows whose values stand in the file, counted from the first; HDF5 makes up those that do not."""
    rows = int(dataset.shape[0])
    if dataset.chunks is None:
        return rows if dataset.id.get_offset() is not None or dataset.size == 0 else 0
    across = math.prod(
        -(-size // part) for size, part in zip(dataset.shape[1:], dataset.chunks[1:], strict=True)
    )
    needed = -(-rows // dataset.chunks[0]) * across
    return rows if dataset.id.get_num_chunks() >= needed else _rows_before_a_hole(dataset, rows, across)


def _rows_before_a_hole(dataset: h5py.Dataset, rows: int, across: int) -> int:
    pieces: Counter[int] = Counter()
    dataset.id.chunk_iter(lambda info: pieces.update([info.chunk_offset[0]]))
    starts = range(0, rows, dataset.chunks[0])
    return next((start for start in starts if pieces[start] < across), rows)


def read_scalar(dataset: h5py.Dataset, declared: Declared) -> Any:
    """The one value of a dataset that ``open_dataset`` gave; raises DataError where it leaves its range."""
    value = dataset[()]
    if not declared.takes_value(value):
        raise _wrong(
            dataset.parent,
            dataset.name,
            Message("is {value}; it must be {low:g} to {high:g}", value, declared.low, declared.high),
        )
    return value


def read_attribute(item: h5py.Group | h5py.Dataset, name: str, declared: Declared) -> Any:
    """The attribute ``name``.

    Raises
    ------
    DataError
        It is not there, or not as declared.
    """
    if not h5py.h5a.exists(item.id, name.encode()):
        raise _wrong(item, f"@{name}", Message("is missing"))
    held = item.attrs.get_id(name)
    shape = None if held.get_space().get_simple_extent_type() == h5py.h5s.NULL else held.shape
    if not (declared.takes_type(held.dtype) and declared.takes_shape(shape)):
        raise _wrong(
            item,
            f"@{name}",
            Message("is {dtype} of shape {shape}; it must be {words}", held.dtype, shape, declared.words()),
        )
    value = item.attrs[name]
    if not declared.takes_value(value):
        raise _wrong(
            item,
            f"@{name}",
            Message("is {value}; it must be {low:g} to {high:g}", value, declared.low, declared.high),
        )
    return value


def _wrong(group: h5py.Group | h5py.Dataset, name: str, what: str) -> DataError:
    place = name if name.startswith("/") else f"{str(group.name).rstrip('/')}/{name}"
    words = "".join(c if c.isprintable() else "?" for c in Message("{place} {what}", place, what))
    return DataError(
        "{filename}: {words}; this is not a file as phasedic writes it", group.file.filename, words
    )


@dataclass(frozen=True, slots=True)
class JsonField:
    """What a value must be.

    Attributes
    ----------
    kind : type
        str, bool, int, float (which whole numbers are too), dict or list.
    low, high : float
        Range of a number, ends included; not a number is outside.
    missing : bool
        Whether it may be left out or null.
    words : tuple of str
        The texts that are allowed; empty: any.
    """

    kind: type
    low: float = -math.inf
    high: float = math.inf
    missing: bool = False
    words: tuple[str, ...] = ()

    def takes(self, value: Any) -> bool:
        """Whether ``value`` is so."""
        if value is None:
            return self.missing
        if self.kind in (int, float):
            number = isinstance(value, int) if self.kind is int else isinstance(value, int | float)
            return (
                number and not isinstance(value, bool) and self.low <= value <= self.high and _finite(value)
            )
        return isinstance(value, self.kind) and (not self.words or value in self.words)


def _finite(value: float) -> bool:
    return isinstance(value, int) or math.isfinite(value)


def read_object(text: Any, where: str) -> dict[str, Any]:
    """The JSON object that stands in ``text``.

    Raises
    ------
    DataError
        It is none.
    """
    try:
        value = json.loads(as_text(text))
    except (ValueError, RecursionError) as error:
        raise DataError(
            "{where} is not JSON ({error}); the file is damaged, or not of phasedic", where, error
        ) from error
    if not isinstance(value, dict):
        raise DataError("{where} is not a JSON object; this is not a file as phasedic writes it", where)
    return value


def check_object(value: Mapping[str, Any], form: Mapping[str, JsonField], where: str) -> None:
    """Refuse an object whose values are not of ``form``; others than those are let be.

    Raises
    ------
    DataError
    """
    for name, declared in form.items():
        if not declared.takes(value.get(name)):
            shown = repr(value.get(name))[:60]
            raise DataError(
                "{where}: {name} is {shown}; this is not a file as phasedic writes it",
                where,
                repr(name),
                shown,
            )
