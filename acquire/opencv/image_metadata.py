"""What belongs to image files beside their pixels: their times from a CSV, and the number of pages of a TIFF.

A CSV has one time a line, or a file name and its time. Pages are counted from the directories of the file
(TIFF 6.0, section 2; BigTIFF); no pixel is read.
"""

from __future__ import annotations

import csv
import itertools
import math
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

from acquire.errors import DataError
from acquire.files.picture import read_bytes


def read_stamps(path: Path, images: Sequence[Path]) -> list[float]:
    """Times in seconds, one a picture, in the order of the pictures.

    Parameters
    ----------
    path : Path
        A CSV. One column: times in s, in order. Two columns: file name, time in s, in any order
        (then each image has one page). A first line without a number in its last column is a
        heading. A line that begins with ``#`` is a remark.
    images : sequence of Path

    Raises
    ------
    DataError
        Unreadable, not a number, an image without a time, or times that run backwards.
    """
    rows = _rows(path)
    if rows and math.isnan(_number(rows[0][-1])):
        rows = rows[1:]
    for number, row in enumerate(rows):
        if math.isnan(_number(row[-1])) or len(row) > 2:
            raise DataError(
                f"{path}: row {number + 1} of the times is {','.join(row)!r}; wanted: [file name,] s"
            )
    named = bool(rows) and len(rows[0]) == 2
    times = _by_name(path, rows, images) if named else [float(row[-1]) for row in rows]
    _check(path, times, images)
    return times


def _rows(path: Path) -> list[list[str]]:
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: the times cannot be read: {error}") from error
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    try:
        return [[cell.strip() for cell in row] for row in csv.reader(lines)]
    except csv.Error as error:
        raise DataError(f"{path}: not a CSV: {error}") from error


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def _by_name(path: Path, rows: list[list[str]], images: Sequence[Path]) -> list[float]:
    by_name = {Path(row[0]).name: float(row[-1]) for row in rows}
    missing = [image.name for image in images if image.name not in by_name]
    if missing:
        raise DataError(f"{path}: no time for {missing[0]} ({len(missing)} of {len(images)} images lack one)")
    return [by_name[image.name] for image in images]


def _check(path: Path, times: list[float], images: Sequence[Path]) -> None:
    if len(times) < len(images):
        raise DataError(f"{path}: {len(times)} times for {len(images)} images; one each is needed")
    for earlier, later in itertools.pairwise(times):
        if later < earlier:
            raise DataError(f"{path}: the times run backwards ({later:g} s after {earlier:g} s)")


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
        return 1  # whatever it is, the decoder decides
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
