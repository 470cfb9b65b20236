"""``tiff``: one map at all instants as a stack of 32-bit floats, with the units that ImageJ reads.

Classic TIFF 6.0, one page an instant, not compressed. The description in the first page is ImageJ's
(``ImageJ=``, ``unit``, ``finterval``), its private tags 50838 and 50839 hold a label for each slice: time and
force. Any other reader sees plain pages; a ZOI without a value is NaN.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError
from live.export.job import Job
from live.export.target import new_file

_ASCII, _SHORT, _LONG, _RATIONAL, _BYTE = 2, 3, 4, 5, 1
_SIZES = {_BYTE: 1, _ASCII: 1, _SHORT: 2, _LONG: 4, _RATIONAL: 8}
_FORMS = {_SHORT: "H", _LONG: "I"}
_MOST = 2**32 - 2**20
_LABELS = 0x6C61626C  # "labl"


@dataclass(frozen=True, slots=True)
class _Tag:
    number: int
    kind: int
    data: bytes

    @classmethod
    def of(cls, number: int, kind: int, *values: int) -> _Tag:
        return cls(number, kind, struct.pack(f"<{len(values)}{_FORMS[kind]}", *values))


def write_tiff(job: Job, path: Path) -> None:
    """The stack of ``job.fields[0]``.

    Raises
    ------
    ConfigError
        More than the 4 GB that the format can address.
    """
    (name,) = job.fields
    height, width = job.strain.grid.shape
    if len(job.rows) * (4 * height * width + 256) > _MOST:
        raise ConfigError(
            f"--to tiff: {len(job.rows)} maps of {width} x {height} are more than 4 GB; give --from and --until"
        )
    with new_file(path) as part, part.open("xb") as file:
        file.write(struct.pack("<2sHI", b"II", 42, 8))
        at = 8
        for k, row in job.steps():
            data = np.ascontiguousarray(job.map(name, row), "<f4")
            tags = _first_tags(job, name) if k == 0 else []
            page = _page(at, data, [*tags, *_scale(job)], last=k == len(job.rows) - 1)
            file.write(page)
            at += len(page)


def _page(at: int, data: NDArray[Any], tags: list[_Tag], *, last: bool) -> bytes:
    """A directory that stands at ``at``, what its tags point to, and the pixels."""
    height, width = data.shape
    shape = [
        _Tag.of(256, _LONG, width), _Tag.of(257, _LONG, height), _Tag.of(258, _SHORT, 32),
        _Tag.of(259, _SHORT, 1), _Tag.of(262, _SHORT, 1), _Tag.of(277, _SHORT, 1),
        _Tag.of(278, _LONG, height), _Tag.of(279, _LONG, data.nbytes), _Tag.of(339, _SHORT, 3),
    ]  # fmt: skip
    tags = [*shape, *tags, _Tag.of(273, _LONG, 0)]
    beside = at + 2 + 12 * len(tags) + 4
    pixels = beside + sum(_padded(tag) for tag in tags)
    tags[-1] = _Tag.of(273, _LONG, pixels)
    entries, values = b"", b""
    for tag in sorted(tags, key=lambda tag: tag.number):
        count = len(tag.data) // _SIZES[tag.kind]
        if len(tag.data) <= 4:
            place = tag.data.ljust(4, b"\0")
        else:
            place = struct.pack("<I", beside + len(values))
            values += tag.data.ljust(_padded(tag), b"\0")
        entries += struct.pack("<HHI", tag.number, tag.kind, count) + place
    following = 0 if last else pixels + data.nbytes
    return struct.pack("<H", len(tags)) + entries + struct.pack("<I", following) + values + data.tobytes()


def _padded(tag: _Tag) -> int:
    """Bytes of what does not fit into the entry, on whole words."""
    return 0 if len(tag.data) <= 4 else -(-len(tag.data) // 4) * 4


def _scale(job: Job) -> list[_Tag]:
    """Pixels of the map (ZOIs) per unit of length."""
    ratio = struct.pack("<II", 1_000_000, round(1e6 * job.display.step(job.strain.grid)))
    return [_Tag(282, _RATIONAL, ratio), _Tag(283, _RATIONAL, ratio), _Tag.of(296, _SHORT, 1)]


def _first_tags(job: Job, name: str) -> list[_Tag]:
    text = description(job, name).encode("ascii", "replace") + b"\0"
    labels = [label.encode("utf-16-le") for label in _labels(job)]
    head = struct.pack("<4sII", b"JIJI", _LABELS, len(labels))
    counts = _Tag.of(50838, _LONG, len(head), *(len(label) for label in labels))
    return [_Tag(270, _ASCII, text), counts, _Tag(50839, _BYTE, head + b"".join(labels))]


def description(job: Job, name: str) -> str:
    """What ImageJ reads of the first page, then our notes."""
    n, unit = len(job.rows), job.display.unit("x").replace("px", "pixel")
    times = job.strain.time_s[list(job.rows)]
    interval = float(np.median(np.diff(times))) if n > 1 else 0.0
    step = job.display.step(job.strain.grid)
    found = {
        "ImageJ": "1.54f", "images": n, "frames": n, "hyperstack": "true", "mode": "grayscale", "unit": unit,
        "finterval": f"{interval:.9g}", "xorigin": f"{-job.display.x(job.strain.grid)[0] / step:.9g}",
        "yorigin": f"{-job.display.y(job.strain.grid)[0] / step:.9g}", "loop": "false",
        "vunit": job.display.unit(name) or "1",
    }  # fmt: skip
    lines = [f"{key}={value}" for key, value in found.items()]
    notes = [*job.notes(), job.display.definition(name)]
    return "\n".join([*lines, *(f"note{k}={' '.join(note.split())}" for k, note in enumerate(notes))]) + "\n"


def _labels(job: Job) -> list[str]:
    forces = job.strain.values["force_N"]
    return [
        f"{job.strain.time_s[row]:.4f} s" + (f", {forces[row]:.2f} N" if np.isfinite(forces[row]) else "")
        for row in job.rows
    ]
