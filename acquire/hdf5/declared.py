"""What a file holds, as data: a writer makes it of that, a reader checks shape, type and range of all it reads.

A file from elsewhere may hold anything. Nothing outside of it is ever opened: links must be hard, and
values must stand in the file itself. A dataset is read only once its size is that of what is stored.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from acquire.hdf5.tables import as_text, set_attributes
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
    """What a dataset or attribute is: how it is made, and what it must be where it is read.

    Attributes
    ----------
    dtype : str
        As numpy names it, or several; "S": text of any fixed length, "text": text of any kind, "int": any whole
        number, "number": any number.
    shape : tuple of int or None
        None: of any length; one that is None first is made empty, and grows.
    low, high : float
        Range of its values, ends included; not a number is within.
    unit : str or None
        Its attribute ``units``; None: it has none.
    long_name, words : str
        Its attribute ``long_name``; its definition, where that is another or the file does not have it.
    missing : object
        The value of what is not written.
    later : bool
        Files of the first versions do not have it.
    rows : int
        Of a chunk, where it grows; 0: the library chooses the chunks.
    packed : mapping
        How it is compressed, as ``create_dataset`` takes it.
    more : mapping
        Its further attributes.
    """

    dtype: str
    shape: tuple[int | None, ...] = ()
    low: float = -math.inf
    high: float = math.inf
    unit: str | None = None
    long_name: str = ""
    words: str = ""
    missing: Any = None
    later: bool = False
    rows: int = 512
    packed: Mapping[str, Any] = field(default_factory=dict)
    more: Mapping[str, Any] = field(default_factory=dict)

    @property
    def meaning(self) -> str:
        """Its definition, for documents."""
        return self.words or self.long_name

    def takes_type(self, dtype: np.dtype[Any]) -> bool:
        """Whether values of this type may stand there."""
        if self.dtype == "S":
            return dtype.kind == "S"
        if self.dtype == "text":
            return dtype.kind == "S" or h5py.check_string_dtype(dtype) is not None
        if self.dtype in ("int", "number"):
            return dtype.kind in ("iu" if self.dtype == "int" else "iuf") and dtype.isnative
        return dtype in map(np.dtype, self.dtype.split()) and dtype.names is None

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

    def demand(self) -> str:
        """What it must be, for a person."""
        kind = _TEXTS.get(self.dtype, self.dtype)
        sizes = ", ".join("N" if size is None else str(size) for size in self.shape)
        return (
            Message("{kind} of shape ({sizes})", kind, sizes)
            if self.shape
            else Message("one {kind}", kind)
            if kind == self.dtype
            else kind
        )


@dataclass(frozen=True, slots=True)
class Group:
    """A group: its NeXus class, its datasets by name, its attributes, and its title for viewers."""

    nexus: str
    items: Mapping[str, Declared] = field(default_factory=dict)
    attributes: Mapping[str, Any] = field(default_factory=dict)
    title: str = ""


def new_datasets(
    group: h5py.Group,
    items: Mapping[str, Declared],
    values: Mapping[str, Any] = MappingProxyType({}),
    *,
    checksum: bool = True,
    fixed: bool = True,
) -> None:
    """Make the datasets ``items``, with their attributes: holding one of ``values``, or without values yet.

    Parameters
    ----------
    checksum : bool
        Fletcher-32 on what is in chunks.
    fixed : bool
        See ``set_attributes``.
    """
    for name, one in items.items():
        if name in values:
            dataset = group.create_dataset(name, data=values[name])
        else:
            grows = one.shape[:1] == (None,)
            rest = one.shape[grows:]
            chunks = (one.rows, *rest) if grows and one.rows else None if one.rows else True
            dataset = group.create_dataset(
                name, (0,) * grows + rest, one.dtype, maxshape=(None,) * grows + rest if chunks else None,
                chunks=chunks, fillvalue=one.missing, fletcher32=bool(chunks and checksum), **one.packed,
            )  # fmt: skip
        said = {"units": one.unit, "long_name": one.long_name or None, **one.more}
        set_attributes(dataset, fixed=fixed, **{key: text for key, text in said.items() if text is not None})


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
    _check_kind(group, name, dtype, dataset.shape, declared)
    if declared.shape[1:] == () and dataset.nbytes > _MAX_BYTES:
        raise _wrong(group, name, Message("is {nbytes} MB large; no test is so long", dataset.nbytes >> 20))
    return dataset


def open_datasets(group: h5py.Group, declared: Mapping[str, Declared]) -> dict[str, h5py.Dataset]:
    """All of them by name, but those of later versions that are not there; raises as ``open_dataset``."""
    there = (name for name, what in declared.items() if not what.later or name in group)
    return {name: open_dataset(group, name, declared[name]) for name in there}


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
    return _in_range(dataset.parent, dataset.name, dataset[()], declared)


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
    _check_kind(item, f"@{name}", held.dtype, shape, declared)
    return _in_range(item, f"@{name}", item.attrs[name], declared)


def read_attributes(item: h5py.Group | h5py.Dataset, declared: Mapping[str, Declared]) -> dict[str, Any]:
    """All of them by name; raises as ``read_attribute``."""
    return {name: read_attribute(item, name, what) for name, what in declared.items()}


def check_format(path: Path, file: h5py.File, root: Mapping[str, Declared], wanted: str, newest: int) -> None:
    """Refuse a file whose attributes ``format`` and ``format_version`` are others; raises DataError."""
    there = h5py.h5a.exists(file.id, b"format")
    found = as_text(read_attribute(file, "format", root["format"])) if there else None
    if found != wanted:
        shown = Message("something else") if found is None else repr(found[:40])
        kind = wanted.removeprefix("phasedic-")
        raise DataError("{path}: holds {found}: not a {kind} file of phasedic", path, shown, kind)
    version = int(read_attribute(file, "format_version", root["format_version"]))
    if version > newest:
        raise DataError(
            "{path}: format version {version}, this program reads up to {newest}; update phasedic",
            path,
            version,
            newest,
        )


def _check_kind(
    item: h5py.Group | h5py.Dataset, name: str, dtype: np.dtype[Any], shape: Any, declared: Declared
) -> None:
    if not (declared.takes_type(dtype) and declared.takes_shape(shape)):
        what = Message("is {dtype} of shape {shape}; it must be {words}", dtype, shape, declared.demand())
        raise _wrong(item, name, what)


def _in_range(item: h5py.Group | h5py.Dataset, name: str, value: Any, declared: Declared) -> Any:
    if not declared.takes_value(value):
        low, high = declared.low, declared.high
        raise _wrong(item, name, Message("is {value}; it must be {low:g} to {high:g}", value, low, high))
    return value


def _wrong(group: h5py.Group | h5py.Dataset, name: str, what: str) -> DataError:
    place = name if name.startswith("/") else f"{str(group.name).rstrip('/')}/{name}"
    words = "".join(c if c.isprintable() else "?" for c in Message("{place} {what}", place, what))
    return DataError(
        "{filename}: {words}; this is not a file as phasedic writes it", group.file.filename, words
    )
