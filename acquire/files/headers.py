"""What picture files say of themselves; no pixel is decoded.

The pages of a TIFF by its directories (TIFF 6.0, section 2; BigTIFF), the quantisation of a JPEG by its own tables
(ITU-T T.81, B.2.4.1).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from acquire.errors import DataError
from acquire.text import Message

_TABLES, _SCAN, _START = 0xDB, 0xDA, b"\xff\xd8\xff"
_FRAMES = {0xC0, 0xC1, 0xC2}
_ZIGZAG = sorted(
    ((row, column) for row in range(8) for column in range(8)),
    key=lambda at: (sum(at), at[0] if sum(at) % 2 else at[1]),
)


SUFFIXES = (".tif", ".tiff")
_WIDTH, _HEIGHT, _COMPRESSION = 256, 257, 259
_SIZES = {1: "B", 3: "H", 4: "I", 16: "Q"}  # types of whole numbers
UNREADABLE = {
    34925: "LZMA", 50000: "ZSTD", 50001: "WebP", 50002: Message("JPEG XL"), 34887: "LERC", 34712: "JPEG 2000",
    33003: "JPEG 2000", 33005: "JPEG 2000",
}  # fmt: skip
"""Compressions that OpenCV cannot read."""


def quantisation(content: bytes) -> tuple[int, ...] | None:
    """Steps of the coefficients of the first component, luminance, of the first JPEG in ``content``.

    Returns
    -------
    64 ints, GL
        Row by row, of blocks of 8 x 8 px, the vertical frequency rising from row to row; None where there is no table.
    """
    at, tables, chosen = content.find(_START) + 2, dict[int, tuple[int, ...]](), 0
    while at >= 2 and at + 4 <= len(content) and content[at] == 0xFF and content[at + 1] != _SCAN:
        end = at + 2 + int.from_bytes(content[at + 2 : at + 4])
        part = content[at + 4 : end]
        if content[at + 1] == _TABLES:
            tables |= _read_tables(part)
        elif content[at + 1] in _FRAMES and len(part) > 8:
            chosen = part[8]
        at = end
    return tables.get(chosen)


def _read_tables(part: bytes) -> dict[int, tuple[int, ...]]:
    found = {}
    while part:
        bytes_each, number = 1 + (part[0] >> 4), part[0] & 15
        size = 1 + 64 * bytes_each
        if len(part) < size:
            break
        steps = [int.from_bytes(part[k : k + bytes_each]) for k in range(1, size, bytes_each)]
        placed = dict(zip(_ZIGZAG, steps, strict=True))
        found[number] = tuple(placed[row, column] for row in range(8) for column in range(8))
        part = part[size:]
    return found


class Page(NamedTuple):
    """A page: its size in px, and the number of its compression."""

    width: int
    height: int
    compression: int


def full_pages(path: Path) -> list[int]:
    """Numbers of the pages of a file, without those that are smaller than its largest (thumbnails); [0] for no TIFF.

    Raises
    ------
    DataError
        The file cannot be opened, or its directories are broken.
    """
    pages = tiff_pages(path)
    most = max((page.width * page.height for page in pages), default=0)
    return [k for k, page in enumerate(pages) if page.width * page.height == most] or [0]


def tiff_pages(path: Path) -> list[Page]:
    """The pages of a TIFF; empty for anything else; raises as ``full_pages``."""
    if path.suffix.lower() not in SUFFIXES:
        return []
    try:
        with path.open("rb") as file:
            return list(_pages(file, path))
    except OSError as error:
        raise DataError("{path}: cannot be read: {strerror}", path, error) from error
    except struct.error as error:
        raise DataError(
            "{path}: a TIFF that is cut off; copy it again or take it out of the list", path
        ) from error


def _pages(file: BinaryIO, path: Path) -> Iterator[Page]:
    head = file.read(16)
    order = {b"II": "<", b"MM": ">"}.get(head[:2])
    if order is None or len(head) < 8:
        return  # whatever it is, the decoder decides
    big = struct.unpack_from(order + "H", head, 2)[0] == 43
    offset = (
        struct.unpack_from(order + "Q", head, 8)[0] if big else struct.unpack_from(order + "I", head, 4)[0]
    )
    seen: set[int] = set()
    while offset:
        if offset in seen:
            raise DataError("{path}: the directories of this TIFF run in a circle; save it anew", path)
        seen.add(offset)
        page, offset = _directory(file, order, offset, big)
        yield page


def _directory(file: BinaryIO, order: str, offset: int, big: bool) -> tuple[Page, int]:
    """A page, and where the next directory is; 0 after the last."""
    count_format, entry, offset_format = ("Q", "HHQ8s", "Q") if big else ("H", "HHI4s", "I")
    count = _unpack(file, order + count_format, offset)[0]
    found = {_WIDTH: 0, _HEIGHT: 0, _COMPRESSION: 1}
    for _ in range(count):
        tag, kind, _, value = _unpack(file, order + entry)
        if tag in found and kind in _SIZES:
            found[tag] = struct.unpack_from(order + _SIZES[kind], value)[0]
    return Page(*found.values()), _unpack(file, order + offset_format)[0]


def _unpack(file: BinaryIO, layout: str, offset: int | None = None) -> tuple[Any, ...]:
    if offset is not None:
        if offset > 2**62:
            raise struct.error(Message("an offset beyond any file"))
        file.seek(offset)
    return struct.unpack(layout, file.read(struct.calcsize(layout)))
