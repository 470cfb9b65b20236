"""The form of the numbers and times in an exported file: decimal mark, groups of thousands, hours and minutes."""

from __future__ import annotations

import datetime
import re
from array import array
from collections.abc import Iterable, Sequence

import numpy as np

from acquire.errors import DataError
from live.replay.export_text import Rows

_BETWEEN_THOUSANDS = " \u00a0\u2009\u202f'\u2019"
_GROUPED = re.compile(
    rf"(?>[-+]?(?:\d{{1,3}}(?:[,{_BETWEEN_THOUSANDS}]\d{{3}})+|\d+)(?:\.\d*)?(?:[eE][-+]?\d+)?\n)*+"
)
_PLAIN = str.maketrans("", "", "0123456789+-.eE\n")
_TO_POINT = {".": str.maketrans("\u2212", "-"), ",": str.maketrans(".,\u2212", ",.-")}
_NO_GROUPS = str.maketrans("", "", "," + _BETWEEN_THOUSANDS)
NUMBERISH = re.compile(r"[-+\u2212]?[.,]?\d[\d.,'\u2019 \u00a0\u2009\u202f]*(?:[eE][-+]?\d+)?")
"""A number in any form, not yet read."""
CLOCK = re.compile(
    r"(?:(\d{1,4}[-./]\d{1,2}[-./]\d{1,4})[T ]+)?(?:(\d{1,3}):)?(\d{1,2}):(\d{1,2})(?:([.,:])(\d+))?"
    r"\s*(?:([AaPp])\.?[Mm]\.?|Z|UTC|[-+]\d\d:?\d\d)?"
)
"""Date, hours, minutes, seconds, mark, fraction, A or P of a time of the day or an elapsed one."""
DATE = re.compile(r"\d{1,4}[-./]\d{1,2}[-./]\d{1,4}")
EMPTY = ("", "nan", "-", "--", "---", "n/a", "#n/a", "#nv", "null", "1.#qnan", "-1.#ind")
"""Cells without a force, in lower case."""


def is_value(cell: str) -> bool:
    """Whether a cell is a number or a time in any form."""
    return bool(NUMBERISH.fullmatch(cell) or CLOCK.fullmatch(cell))


def vote(cell: str) -> str:
    """The decimal mark that a number proves; "?" where three digits may be thousands; "" without a mark."""
    body = re.sub(f"[-+\u2212{_BETWEEN_THOUSANDS}]|[eE].*", "", cell)
    marks = set(body) & {".", ","}
    if len(marks) == 2:
        return max(marks, key=body.rfind)
    mark = next(iter(marks), "")
    head, *tails = body.split(mark) if mark else [body]
    if len(tails) > 1:  # 1.149.200, but not 25.11.2026
        return (set(".,") - {mark}).pop() if all(len(tail) == 3 for tail in tails) else ""
    if tails and len(tails[0]) == 3 and 1 <= len(head) <= 3 and head[0] != "0" and "e" not in cell.lower():
        return "?"
    return mark


def decimal_mark(parts: Iterable[Rows], names: int | None, where: str) -> str:
    """The decimal mark of a file, from the first of its ``parts`` that proves one; a point where there is no mark.

    Parameters
    ----------
    names : int or None
        The column of names, which proves nothing.

    Raises
    ------
    DataError
        No cell proves a mark, and one has two readings.
    """
    doubtful = ""
    for rows in parts:
        for cell in (c for row in rows for k, c in enumerate(row) if ("." in c or "," in c) and k != names):
            mark = vote(cell) if NUMBERISH.fullmatch(cell.strip()) else ""
            if mark in (".", ","):
                return mark
            doubtful = doubtful or cell * (mark == "?")
    if doubtful:
        raise two_readings(where, doubtful)
    return "."


def two_readings(where: str, cell: str) -> DataError:
    """The error for a number that may have thousands."""
    return DataError(
        "{where}: {given} has two readings, {one} and {other}; give --load-decimal point or comma",
        where,
        repr(cell),
        re.sub("[.,]", ".", cell),
        re.sub("[.,]", "", cell),
    )


def numbers_in(cells: Sequence[str], mark: str) -> Sequence[float] | None:
    """The cells as numbers with this decimal mark, with or without groups of thousands; None where one is none."""
    text = "\n".join(cells).translate(_TO_POINT[mark])
    if text.translate(_PLAIN):
        groups = set(text) & set("," + _BETWEEN_THOUSANDS)
        if len(groups) > 1 or not _GROUPED.fullmatch(text + "\n"):
            return None
        text = text.translate(_NO_GROUPS)
    try:
        numbers = array("d", map(float, text.split("\n")))
    except ValueError:
        return None
    return numbers if np.isfinite(numbers).all() else None


def days_of(dates: Sequence[str]) -> list[int] | None:
    """Days from the first of the dates, each another than the one before; None where they have no or two readings.

    Of two readings that are both dates and rise, one without a pause is meant.
    """
    ordinals = []
    for order in ("dmy", "mdy", "ymd"):
        try:
            ordinals.append([_ordinal(date, order) for date in dates])
        except ValueError:
            continue
    rising = {tuple(day - days[0] for day in days) for days in ordinals if min(np.diff(days), default=1) > 0}
    daily = {days for days in rising if max(np.diff(days), default=1) == 1}
    found = daily or rising
    return list(found.pop()) if len(found) == 1 else None


def _ordinal(date: str, order: str) -> int:
    """The day of a date, from any one; raises ValueError where this is none in that order."""
    parts = dict(zip(order, re.split("[-./]", date), strict=True))
    if ("." in date and order == "mdy") or (len(parts["y"]) != 4 and order == "ymd"):
        raise ValueError(date)
    year = int(parts["y"]) + 2000 * (len(parts["y"]) == 2)
    return datetime.date(year, int(parts["m"]), int(parts["d"])).toordinal()


def time_of_day(cell: str) -> tuple[str, float] | None:
    """The date, "" without one, and s since midnight; None where it is no time, or one with several readings."""
    if cell[2:3] == cell[5:6] == ":" and cell[8:9] in ".,":  # most are 12:01:02.345
        hour, minute, second = cell[:2], cell[3:5], cell[6:].replace(",", ".")
        if (hour + minute + second.replace(".", "", 1)).isdecimal():
            return "", 3600.0 * int(hour) + 60.0 * int(minute) + float(second)
    clock = CLOCK.fullmatch(cell)
    if clock is None:
        return None
    date, h, m, s, point, fraction, half = clock.groups()
    if (h is None and fraction is None) or (point == ":" and len(fraction) != 3):
        return None  # 12:30 and 12:30:15:04
    hours = int(h or 0) % (12 if half else 1000) + 12 * (half in ("p", "P"))
    return date or "", 3600.0 * hours + 60.0 * int(m) + float(f"{s}.{fraction or 0}")
