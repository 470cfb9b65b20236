"""Growing HDF5 datasets row by row, and the texts of NeXus and of JSON in HDF5.

A session has some twenty columns; the low-level calls take a tenth of the time of ``dataset.resize`` and
``dataset[n] = ...``, and rows that are written together share that. Groups carry their NeXus class; attributes and
JSON are texts of fixed length. What a JSON object must hold is declared as data.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError

NO_UNIT = "none"


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


class RowTable:
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


def set_attributes(item: Any, *, fixed: bool = True, **attributes: Any) -> None:
    """Set attributes, texts in ``fixed`` length.

    Texts of variable length stand in HDF5's global heap, the one structure of a session without a checksum: the
    library loops for ever on a damaged one. Bytes of a name that is not UTF-8 are escaped.
    """
    for name, value in attributes.items():
        if not fixed:
            value = storable(value) if isinstance(value, str) else value
        elif isinstance(value, list):
            value = np.array([storable(text).encode() for text in value], "S")
        item.attrs[name] = np.bytes_(storable(value).encode()) if fixed and isinstance(value, str) else value


def storable(text: str) -> str:
    """The text, with bytes of a name that is not UTF-8 escaped."""
    return text.encode("utf-8", "backslashreplace").decode()


def as_text(value: Any) -> str:
    """A text that ``set_attributes`` or a text dataset holds."""
    return bytes(value).decode("utf-8") if isinstance(value, bytes) else str(value)


def new_group(
    parent: h5py.Group, name: str, nexus_class: str, *, fixed: bool = True, **attributes: Any
) -> h5py.Group:
    """A group with its NeXus class; ``fixed`` as of ``set_attributes``."""
    group = parent.create_group(name)
    set_attributes(group, fixed=fixed, NX_class=nexus_class, **attributes)
    return group


def to_json(value: Any) -> str:
    """Strict JSON: not-a-number becomes null, what JSON has no type for becomes its text."""
    return json.dumps(_plain(value), allow_nan=False)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic | np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, str | int | bool) else str(value)


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
