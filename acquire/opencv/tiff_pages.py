"""How many pictures a TIFF file holds, from its directories alone (TIFF 6.0, section 2; BigTIFF)."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

from acquire.errors import DataError


def count_pages(path: Path) -> int:
    """Number of pictures in the file; 1 for anything that is not a TIFF.

    Raises
    ------
    DataError
        The file cannot be opened, or its directories are broken.
    """
    if path.suffix.lower() not in (".tif", ".tiff"):
        return 1
    try:
        with path.open("rb") as file:
            return _count(file, path)
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
    except struct.error as error:
        raise DataError(
            f"{path}: a TIFF that is cut off; copy it again or take it out of the list"
        ) from error


def _count(file: BinaryIO, path: Path) -> int:
    head = file.read(16)
    order = {b"II": "<", b"MM": ">"}.get(head[:2])
    if order is None or len(head) < 8:
        return 1  # whatever it is, the decoder will say
    big = struct.unpack_from(order + "H", head, 2)[0] == 43
    offset = (
        struct.unpack_from(order + "Q", head, 8)[0] if big else struct.unpack_from(order + "I", head, 4)[0]
    )
    seen: set[int] = set()
    while offset:
        if offset in seen:
            raise DataError(f"{path}: the directories of this TIFF run in a circle; save it anew")
        seen.add(offset)
        offset = _next(file, order, offset, big)
    return max(len(seen), 1)


def _next(file: BinaryIO, order: str, offset: int, big: bool) -> int:
    count_format, entry_size, offset_format = ("Q", 20, "Q") if big else ("H", 12, "I")
    count = _unpack(file, order + count_format, offset)
    return _unpack(file, order + offset_format, offset + struct.calcsize(count_format) + count * entry_size)


def _unpack(file: BinaryIO, layout: str, offset: int) -> int:
    if offset > 2**62:
        raise struct.error("an offset beyond any file")
    file.seek(offset)
    value: int = struct.unpack(layout, file.read(struct.calcsize(layout)))[0]
    return value
