"""When pictures in files were taken: times from a CSV, from Exif, or of the files.

A CSV has one time a line, or a file name and its time.
"""

from __future__ import annotations

import csv
import itertools
import math
import re
from collections.abc import Sequence
from pathlib import Path

from acquire.errors import DataError
from acquire.files.picture import read_bytes

_TAKEN = re.compile(rb"\d{4}:\d\d:\d\d \d\d:\d\d:\d\d(?=\0)")
_HEAD = 1 << 16


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
                "{path}: row {number} of the times is {listed}; wanted: [file name,] s",
                path,
                number + 1,
                repr(",".join(row)),
            )
    named = bool(rows) and len(rows[0]) == 2
    times = _by_name(path, rows, images) if named else [float(row[-1]) for row in rows]
    _check(path, times, images)
    return times


def _rows(path: Path) -> list[list[str]]:
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DataError("{path}: the times cannot be read: {error}", path, error) from error
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    try:
        return [[cell.strip() for cell in row] for row in csv.reader(lines)]
    except csv.Error as error:
        raise DataError("{path}: not a CSV: {error}", path, error) from error


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
        raise DataError(
            "{path}: no time for {missing} ({count} of {len2} images lack one)",
            path,
            missing[0],
            len(missing),
            len(images),
        )
    return [by_name[image.name] for image in images]


def _check(path: Path, times: list[float], images: Sequence[Path]) -> None:
    if len(times) < len(images):
        raise DataError(
            "{path}: {count} times for {len2} images; one each is needed", path, len(times), len(images)
        )
    for earlier, later in itertools.pairwise(times):
        if later < earlier:
            raise DataError(
                "{path}: the times run backwards ({later:g} s after {earlier:g} s)", path, later, earlier
            )


def taken_times(paths: Sequence[Path]) -> list[float]:
    """When the pictures were taken: of Exif where each has another time, else the times of the files.

    Exif has whole seconds, the earliest of a picture counts (Exif 2.32, 4.6.5): as a number of 14 digits.
    """
    taken = [min(_TAKEN.findall(_head(path)), default=b"") for path in paths]
    if all(taken) and len(set(taken)) == len(taken):
        return [float(re.sub(rb"\D", b"", text)) for text in taken]
    return [float(path.stat().st_mtime_ns) for path in paths]


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_HEAD)
