"""How the text of an export is read: its lines, its numbers, its headings.

Lines come in blocks, after their encoding is known, and are cut into cells. Numbers and times have a form: decimal
mark, groups of thousands, hours and minutes. A heading means force, time, name of a picture or number of a row. Names
are those of common testing machines, in the languages of their programs; units stand in brackets, after a
slash, comma, blank or underscore, or below the heading.
"""

from __future__ import annotations

import codecs
import csv
import datetime
import io
import re
import unicodedata
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import BinaryIO

import numpy as np

from acquire.errors import ConfigError, DataError
from acquire.protocols.base import is_mass, newtons_per
from acquire.text import Amount, Message

HEAD = 1 << 18
"""Bytes or characters at the beginning of a file in which its form is found."""
_BLOCK, _LONGEST = 1 << 20, 1 << 20  # characters that are read at once, and of a line
_MAGIC = {
    b"PK\x03\x04": Message("a workbook or an archive"), b"\xd0\xcf\x11\xe0": Message("an Excel workbook"),
    b"TDSm": Message("a TDMS file"),
    b"%PDF": Message("a PDF"), b"\x89HDF": Message("an HDF5 file"), b"\x1f\x8b": Message("compressed"),
}  # fmt: skip
_BOMS = {
    codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF32_LE: "utf-32", codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16",
}  # fmt: skip
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x19\x1c-\x1f\x7f]")
_CODE_PAGES = {
    "cp932": re.compile("荷重|試験力|時間|時刻"),
    "gb18030": re.compile("载荷|负荷|试验力|拉力|力值|时间"),
    "cp949": re.compile("하중|시간"),
    "cp1251": re.compile("(?i)сила|усилие|нагрузка|время"),
    "cp1250": re.compile("(?i)siła"),
}
"""Code pages of eight bits, with words of headings that show them; else it is cp1252."""

Rows = list[list[str]]

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

_WORDS = {
    "force": "force load f kraft last charge effort 荷重 試験力 力 fuerza carga forza carico"
    " forca kracht siła сила усилие нагрузка 载荷 负荷 试验力 拉力 力值 하중",
    "time": "time t seconds zeit temps duree 時間 tiempo tempo tijd tid czas время 时间 시간 x_value",
    "clock": "timestamp date datum datetime uhrzeit heure clock 時刻 日時",
    "date": "date datum fecha data 日付",
    "name": "file filename picture image name bild bilddatei datei dateiname fichier photo ファイル 画像",
    "row": "index no nr number point sample frame row nummer #",
    "neutral": "axial axiale standard test tensile traction primary elapsed running measured actual applied cell"
    " channel ch ai value signal d de essai der des gemessen",
    "other": "max maximum maximal maximale peak min minimum break bruch rupture rate speed displacement extension"
    " strain stress spannung contrainte position setpoint command demand target soll sollwert consigne error"
    " temperature stiffness step line limit constant mode type unit drop",
}
"""The words of each kind, folded; of ``name`` and ``row`` they are the whole heading. ``other`` makes it none."""
_ENDINGS = {
    "force": ("kraft", "荷重", "試験力", "载荷", "负荷", "试验力"),
    "time": ("zeit", "時間", "时间"),
}
_SECONDS = {
    1.0: "s sec secs second seconds sek sekunde sekunden seconde secondes 秒 с сек",
    1e-3: "ms msec millisecond milliseconds millisekunden мс",
    1e-6: "us µs usec microsecond microseconds",
    60.0: "min mins minute minutes minuten 分 мин",
    3600.0: "h hr hour hours std stunde stunden heure heures",
}
_ALIASES = {
    "newton": "N", "newtons": "N", "kilonewton": "kN", "kilonewtons": "kN", "kip": "klbf", "kips": "klbf",
    "н": "N", "кн": "kN", "кгс": "kgf",
}  # fmt: skip
_BRACKETS = re.compile(r"(.*?)\s*[\[({<]\s*([^\[\](){}<>]*?)\s*[\])}>]\s*")
_BARE = re.compile(r"(.*?)(?:\s*[/,|]\s*|[\s_]+(?:in\s+)?)([^\s/,|_]+)")
_LONGEST_UNIT = 8


def encoding_of(file: BinaryIO, where: str) -> str:
    """The encoding by its mark, else the first that fits; raises DataError for what is no text."""
    head = file.read(HEAD)
    for magic, kind in _MAGIC.items():
        if head.startswith(magic):
            raise DataError("{where}: is {kind}, no text; export the forces as CSV or text", where, kind)
    for bom, encoding in _BOMS.items():
        if head.startswith(bom):
            return encoding
    zeros = [head[k::2].count(0) for k in (0, 1)]
    found = "utf-8"
    if max(zeros) > len(head) // 4 and min(zeros) == 0:
        found = "utf-16-le" if zeros[1] else "utf-16-be"
    elif _decoded(head, "utf-8") is None:
        shown = (page for page, words in _CODE_PAGES.items() if words.search(_decoded(head, page) or ""))
        found = next(shown, "cp1252")
    if _CONTROL.search(head.decode(found, "replace")):
        raise DataError("{where}: is binary, no text; export the forces as CSV or text", where)
    return found


def _decoded(head: bytes, encoding: str) -> str | None:
    try:
        return codecs.getincrementaldecoder(encoding)().decode(head)
    except UnicodeDecodeError:
        return None


def lines_of(file: BinaryIO, encoding: str, where: str) -> Iterator[list[str]]:
    """All lines, some at once."""
    file.seek(0)
    text, left, count = io.TextIOWrapper(file, encoding, errors="replace"), "", 0
    try:
        while read := text.read(_BLOCK):
            *lines, left = (left + read).split("\n")
            count += len(lines)
            if len(left) > _LONGEST:
                raise DataError(
                    "{where}: line {line} has more than {most} characters; no table",
                    *(where, count + 1, Amount("count", _LONGEST)),
                )
            yield lines
        if left:
            yield [left]
    finally:
        text.detach()


def split_rows(lines: list[str], separator: str) -> tuple[Rows, int | None]:
    """A row for each line, and the line of a quote that goes on in the next one: its row has the place of the last."""
    if separator[0] == " ":
        parting = re.compile(rf"{separator}(?!\(|\[) *")  # not before a unit in brackets
        lines, separator = [parting.sub("\t", line.strip()) for line in lines], "\t"
    rows = list(csv.reader(lines, delimiter=separator, skipinitialspace=True))
    if len(rows) == len(lines):
        return rows, None
    rows, broken, reader = [], None, csv.reader(lines, delimiter=separator, skipinitialspace=True)
    for row in reader:
        if len(rows) < reader.line_num - 1 and broken is None:
            broken = len(rows)
        rows += [[]] * (reader.line_num - 1 - len(rows))
        rows.append(row)
    return rows, broken


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


def _folded(text: str) -> str:
    """Without case, accents and width: "Prüfzeit " and "prufzeit" are the same."""
    decomposed = unicodedata.normalize("NFKD", text.casefold())
    return "".join(c for c in decomposed if not unicodedata.combining(c)).strip()


_SECONDS_OF = {_folded(word): factor for factor, words in _SECONDS.items() for word in words.split()}
_KINDS = {kind: frozenset(map(_folded, words.split())) for kind, words in _WORDS.items()}


def plain_unit(cell: str) -> str:
    """A unit without its brackets and full stop."""
    return unicodedata.normalize("NFKC", cell).strip("[](){}<> \t.")


def seconds_per(unit: str) -> float | None:
    """Seconds of one unit of time; None where it is none."""
    return _SECONDS_OF.get(_folded(unit))


def newtons_of(unit: str) -> float | None:
    """Newtons of one unit of force; None where it is none."""
    try:
        return newtons_per(_ALIASES.get(unit.lower(), unit))
    except ConfigError:
        return None


def is_unit(word: str) -> bool:
    """Whether a word is a unit of force, mass or time."""
    return seconds_per(word) is not None or newtons_of(word) is not None or is_mass(word) or word == "MN"


def name_and_unit(cell: str) -> tuple[str, str]:
    """The name of a column and its unit, "" without one: ``Load (kN)``, ``Kraft [N]``, ``F/N``, ``force_N``."""
    text = unicodedata.normalize("NFKC", cell).strip()
    found = _BRACKETS.fullmatch(text)
    if (
        found
        and found[1]
        and (is_unit(found[2]) or (0 < len(found[2]) <= _LONGEST_UNIT and " " not in found[2]))
    ):
        return found[1], plain_unit(found[2])
    found = _BARE.fullmatch(text)
    return (found[1], found[2]) if found and found[1] and is_unit(found[2]) else (text, "")


def _rank(name: str, kind: str) -> int | None:
    """How surely a name is of ``kind``: 0 by its words, 1 by a letter, 2 where it has other words; None: it is not."""
    folded = _folded(name)
    if kind in ("name", "row", "date") or folded in _KINDS[kind]:
        words = re.sub(r"[\s_.]+", "", folded)
        return int(len(folded) == 1 and kind != "row") if {words, folded} & _KINDS[kind] else None
    parts = re.findall(r"[^\W\d_]+", folded)
    own = [part in _KINDS[kind] or part.endswith(_ENDINGS.get(kind, "\0")) for part in parts]
    if not any(own) or any(part in _KINDS["other"] for part in parts):
        return None
    rest = [
        part for part, is_own in zip(parts, own, strict=True) if not is_own and part not in _KINDS["neutral"]
    ]
    return 2 if rest else int(all(len(part) == 1 for part, is_own in zip(parts, own, strict=True) if is_own))


def find_columns(heads: Sequence[str], kind: str) -> list[int]:
    """The columns that may be of ``kind``: force, time, clock, duration (by its unit alone), name or row.

    Those with a unit of it come before those without, and these before those of another unit. Of times that whose name
    says so most surely is taken, of forces none: two may be two load cells.
    """
    per = {"force": newtons_of, "time": seconds_per}.get(kind)
    if kind == "duration":  # in a language that is not known here
        return [k for k, head in enumerate(heads) if _is_by_unit(*name_and_unit(head), seconds_per)]
    ranked: dict[tuple[int, int], list[int]] = {}
    for k, (name, unit) in enumerate(map(name_and_unit, heads)):
        if (rank := _rank(name, kind)) is not None:
            fit = 0 if per is None else 1 if not unit else 0 if per(unit) is not None else 2
            ranked.setdefault((fit, 0 if kind == "force" else rank), []).append(k)
    if kind == "force" and not ranked:
        return [k for k, head in enumerate(heads) if _is_by_unit(*name_and_unit(head), newtons_of)]
    return ranked[min(ranked)] if ranked else []


def _is_by_unit(name: str, unit: str, per: Callable[[str], float | None]) -> bool:
    words = set(re.findall(r"[^\W\d_]+", _folded(name)))
    return bool(unit) and per(unit) is not None and not words & _KINDS["other"]


def given_columns(heads: Sequence[str], given: str) -> tuple[int, int | None] | None:
    """The columns that ``FORCE`` or ``FORCE,TIME`` names, by heading or number from 1; None where one is not there."""
    if (alone := _column_called(heads, given)) is not None:
        return alone, None
    for comma in re.finditer(",", given):
        force = _column_called(heads, given[: comma.start()])
        key = _column_called(heads, given[comma.end() :])
        if force is not None and key is not None:
            return force, key
    return None


def _column_called(heads: Sequence[str], word: str) -> int | None:
    word = word.strip()
    if word.isdecimal():
        return int(word) - 1 if 1 <= int(word) <= len(heads) else None
    full = [k for k, head in enumerate(heads) if _folded(head) == _folded(word)]
    named = full or [k for k, head in enumerate(heads) if _folded(name_and_unit(head)[0]) == _folded(word)]
    return named[0] if len(named) == 1 else None
