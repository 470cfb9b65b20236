"""The words of NeXus in HDF5: groups with a class, attributes and JSON as texts of fixed length."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np

NO_UNIT = "none"


def say(item: Any, **attributes: Any) -> None:
    """Set attributes, texts in fixed length.

    Texts of variable length would stand in HDF5's global heap, the one structure of this file
    without a checksum: the library loops for ever on a damaged one.
    """
    for name, value in attributes.items():
        if isinstance(value, list):
            value = np.array([text.encode() for text in value], "S")
        item.attrs[name] = np.bytes_(value.encode()) if isinstance(value, str) else value


def word(value: Any) -> str:
    """A text that ``say`` or a text dataset holds."""
    return bytes(value).decode("utf-8") if isinstance(value, bytes) else str(value)


def new_group(parent: h5py.Group, name: str, nexus_class: str, **attributes: Any) -> h5py.Group:
    """A group with its NeXus class."""
    group = parent.create_group(name)
    say(group, NX_class=nexus_class, **attributes)
    return group


def new_json(group: h5py.Group, name: str, value: Any) -> None:
    """A scalar text dataset holding JSON."""
    say(group.create_dataset(name, data=np.bytes_(to_json(value))), units=NO_UNIT)


def to_json(value: Any) -> str:
    """Strict JSON: not-a-number becomes null, what JSON does not know becomes its text."""
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
