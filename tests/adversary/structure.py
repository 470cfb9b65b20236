"""Changes of the structure of an HDF5 file, each of which its format allows.

``change`` makes one, chosen by a random number generator, and returns what it did.
"""

from __future__ import annotations

import json
import os
import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

TYPES: dict[str, Any] = {
    **{
        kind: np.dtype(kind)
        for kind in ("u1", "i1", "u2", "i4", "i8", "u8", "f2", "f4", "f8", ">f8", ">i8", ">u2")
    },
    **{kind: np.dtype(kind) for kind in ("c16", "S3", "S512", "V7", "?")},
    "compound": np.dtype([("r", "u1"), ("g", "f8")]),
    "text": h5py.string_dtype(),
    "reference": h5py.ref_dtype,
    "lists": h5py.vlen_dtype(np.dtype("i4")),
    "enumeration": h5py.enum_dtype({"a": 0, "b": 1}, basetype="u1"),
}
VALUES = (
    0, 1, -1, 2, 255, 256, 65_535, 2**31, -(2**31), 2**62, -(2**63), 1e300, -1e300, 1e12, np.inf, -np.inf,
    np.nan,
)  # fmt: skip
ODD_JSON = (
    None, True, -1, 0, 1, 3, 17, 2**70, 1.5, 1e999, "", "x", "\x1b[2J", [], [1, "a"], {}, {"a": {"b": []}},
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Place:
    """Where changes are made.

    Attributes
    ----------
    file : h5py.File
        Open for writing.
    name : str
        Of a dataset or group.
    elsewhere, fifo : Path
        Another HDF5 file, and a pipe that nobody writes to.
    rng : random.Random
    """

    file: h5py.File
    name: str
    elsewhere: Path
    fifo: Path
    rng: random.Random

    @property
    def item(self) -> Any:
        return self.file[self.name]

    def put(self, values: Any, **how: Any) -> None:
        """In place of the dataset; its attributes stay."""
        attributes = dict(self.item.attrs)
        del self.file[self.name]
        made = self.file.create_dataset(self.name, data=values, **how)
        made.attrs.update({k: v for k, v in attributes.items() if not isinstance(v, h5py.Empty)})

    def outside(self) -> Path:
        return self.rng.choice([self.elsewhere, self.fifo, self.elsewhere.with_name("missing.h5")])


def retype(p: Place) -> None:
    kind = TYPES[p.rng.choice(list(TYPES))]
    values = p.item[()]
    try:
        with np.errstate(all="ignore"):
            changed = np.asarray(values).astype(kind)
    except (TypeError, ValueError):
        changed = None
    if changed is None or kind.hasobject:
        shape = p.item.shape
        del p.file[p.name]
        p.file.create_dataset(p.name, shape, kind)
        return
    p.put(changed)


def relength(p: Place) -> None:
    values = np.atleast_1d(p.item[()])
    n = p.rng.choice([0, 1, max(len(values) - 1, 0), len(values) + 1, 2 * len(values) + 3])
    p.put(
        np.resize(values, (n, *values.shape[1:]))
        if values.size
        else np.zeros((n, *values.shape[1:]), values.dtype)
    )


def reshape(p: Place) -> None:
    values = np.asarray(p.item[()])
    shapes = [
        (), (1,), (values.size,), (1, values.size), (values.size, 1), (1, 1, 1, values.size), (0,),
        (0, 0, 0),
    ]  # fmt: skip
    shape = p.rng.choice(shapes)
    p.put(np.resize(values, shape) if values.size else np.zeros(shape, values.dtype))


def huge(p: Place) -> None:
    item = p.item
    dtype, shape = item.dtype, (p.rng.choice([10**6, 10**10, 2**40]), *item.shape[1:])
    chunks = tuple(min(size, 64) for size in shape) if p.rng.random() < 0.5 else (1, *shape[1:])
    del p.file[p.name]
    p.file.create_dataset(p.name, shape, dtype, maxshape=(None, *shape[1:]), chunks=chunks)


def with_hole(p: Place) -> None:
    values = np.asarray(p.item[()])
    if not values.size or not values.ndim:
        return
    del p.file[p.name]
    made = p.file.create_dataset(p.name, values.shape, values.dtype, chunks=(1, *values.shape[1:]))
    for row in range(len(values)):
        if p.rng.random() < 0.7:
            made[row] = values[row]


def restored(p: Place) -> None:
    """The same values, stored in another way."""
    ways: list[dict[str, Any]] = [{}, {"compression": "gzip"}, {"shuffle": True}, {"compression": "lzf"}]
    ways += [{"chunks": True, "fletcher32": True}]
    values = np.asarray(p.item[()])
    p.put(values, **(p.rng.choice(ways) if values.ndim and values.size else {}))


def removed(p: Place) -> None:
    del p.file[p.name]


def hollow(p: Place) -> None:
    dtype = p.item.dtype
    del p.file[p.name]
    p.file.create_dataset(p.name, data=h5py.Empty(dtype))


def group_instead(p: Place) -> None:
    del p.file[p.name]
    p.file.create_group(p.name)


def type_instead(p: Place) -> None:
    del p.file[p.name]
    p.file[p.name] = np.dtype("f8")


def soft_link(p: Place) -> None:
    target = p.rng.choice(["/entry/start_time", p.name, "/nowhere", "/entry", "/"])
    del p.file[p.name]
    p.file[p.name] = h5py.SoftLink(target)


def external_link(p: Place) -> None:
    del p.file[p.name]
    p.file[p.name] = h5py.ExternalLink(str(p.outside()), p.name)


def external_storage(p: Place) -> None:
    dtype, shape = p.item.dtype, p.item.shape
    del p.file[p.name]
    size = max(int(np.prod(shape)) * dtype.itemsize, 1)
    p.file.create_dataset(p.name, shape, dtype, external=[(str(p.outside()), 0, size)])


def virtual(p: Place) -> None:
    dtype, shape = p.item.dtype, p.item.shape
    if not shape or 0 in shape:
        return
    most = (None, *shape[1:])
    layout = h5py.VirtualLayout(shape, dtype, maxshape=most)
    source = h5py.VirtualSource(str(p.outside()), p.name, shape, dtype, maxshape=most)
    unlimited = p.rng.random() < 0.5
    if unlimited:
        layout[: h5py.h5s.UNLIMITED] = source[: h5py.h5s.UNLIMITED]
    else:
        layout[...] = source
    del p.file[p.name]
    p.file.create_virtual_dataset(p.name, layout)


def extra_link(p: Place) -> None:
    group = p.item.parent
    links = [h5py.SoftLink("/entry"), h5py.ExternalLink(str(p.outside()), "/"), h5py.SoftLink("/nowhere")]
    group["\x1b[31mextra"] = p.rng.choice(links)


def another_name(p: Place) -> None:
    """A hard link to something else of the file, or to a group around it."""
    names: list[str] = []
    p.file.visit(names.append)
    target = p.file[p.rng.choice([*names, "/"])]
    del p.file[p.name]
    p.file[p.name] = target


def values_beyond(p: Place) -> None:
    item = p.item
    if item.dtype.kind not in "iuf" or not item.size:
        return
    value = p.rng.choice(VALUES)
    with np.errstate(all="ignore"):
        cast = np.array(value).astype(item.dtype)
    if not item.shape or p.rng.random() < 0.2:
        item[...] = cast
    else:
        item[p.rng.randrange(len(item))] = cast


def values_turned(p: Place) -> None:
    item = p.item
    if item.shape:
        values = item[()]
        item[...] = values[::-1] if p.rng.random() < 0.5 else np.roll(values, 1, axis=0)


def other_text(p: Place) -> None:
    """JSON that is odd in one place, or no JSON."""
    item = p.item
    row = () if not item.shape else p.rng.randrange(len(item)) if len(item) else None
    if item.dtype.kind not in "SO" or row is None:
        return
    text = bytes(item[row]) if isinstance(item[row], bytes) else str(item[row]).encode()
    try:
        text = json.dumps(_odd(json.loads(text), p.rng)).encode()
    except ValueError:
        text = b""
    text = p.rng.choice([text, text, text, text, b"", b"{", b"[" * 300, b"\xff\xfe", b"null", b"+", b"7"])
    if item.shape:
        item[row] = text
    else:
        p.put(np.bytes_(text) if item.dtype.kind == "S" else text.decode(errors="replace"))


def _odd(value: Any, rng: random.Random) -> Any:
    if isinstance(value, dict) and value and rng.random() < 0.8:
        key = rng.choice(list(value))
        if rng.random() < 0.2:
            return {k: v for k, v in value.items() if k != key}
        return value | {key: _odd(value[key], rng)}
    return rng.choice(ODD_JSON)


def attribute(p: Place) -> None:
    item = p.item
    name = p.rng.choice([*item.attrs] or ["units"])
    kind = p.rng.choice(["removed", "number", "text", "array", "hollow", "long", "beyond"])
    if kind == "removed":
        if name in item.attrs:
            del item.attrs[name]
        return
    values = {
        "number": 3.5,
        "text": "\x1b[31m odd",
        "array": np.arange(5),
        "hollow": h5py.Empty("f8"),
        "long": np.bytes_(b"x" * 40_000),
        "beyond": p.rng.choice([-1, 0, 2**62]),
    }
    item.attrs[name] = values[kind]


OF_DATASETS: dict[str, Callable[[Place], None]] = {
    f.__name__: f
    for f in (
        *(retype, relength, reshape, huge, with_hole, restored, removed, hollow, group_instead, type_instead),
        *(soft_link, external_link, external_storage, virtual, extra_link, another_name, values_beyond),
        *(values_turned, other_text, attribute),
    )
}
OF_GROUPS = {
    f.__name__: f
    for f in (removed, type_instead, soft_link, external_link, extra_link, another_name, attribute)
}
TOUCH_VALUES = {"values_beyond", "values_turned", "other_text", "another_name", "attribute"}
"""Changes after which the file holds other numbers."""


def change(path: Path, rng: random.Random, elsewhere: Path, fifo: Path) -> tuple[str, bool]:
    """Make one change in the file at ``path``: what it was, and whether other numbers stand there now."""
    with h5py.File(path, "r+") as file:
        names: list[str] = []
        file.visit(names.append)
        if rng.random() < 0.3:  # texts and descriptions are few, and hold much
            names = [n for n in names if isinstance(file[n], h5py.Dataset) and file[n].dtype.kind in "SO"]
        name = rng.choice(["/", *names])
        of_group = isinstance(file[name], h5py.Group)
        if name == "/":
            kind = "attribute"
        else:
            kind = rng.choice(list(OF_GROUPS if of_group else OF_DATASETS))
        (OF_GROUPS if of_group else OF_DATASETS)[kind](Place(file, name, elsewhere, fifo, rng))
    return f"{kind} of {name}", kind in TOUCH_VALUES


def make_fifo(path: Path) -> Path:
    os.mkfifo(path)
    return path
