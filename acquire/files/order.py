"""The pictures that a folder, a glob or the name of a file stands for, and their order in time.

The names decide, or the times where names do not say it. Numbers count by their value, dates by the calendar. What a
name may mean is put in ``_Reading``: where two readings give two orders, times of the pictures decide if they follow
one of them and not merely the alphabet, as copied files do; else it is asked.
"""

from __future__ import annotations

import glob
import itertools
import re
import unicodedata
from collections import defaultdict
from collections.abc import Callable, Sequence
from decimal import Decimal
from pathlib import Path, PurePath
from typing import NamedTuple

from acquire.addresses import expanded
from acquire.errors import ConfigError, DataError
from acquire.files.picture import FOREIGN
from acquire.text import Message

_MONTHS = re.compile(
    r"(?<![^\W\d_])(?:(jan)|(feb|f[ée]v)|(mar|m[äa]?rz)|(apr|avr)|(may|mai)|(jun|juin)|(jul|juil)"
    r"|(aug|ao[uû])|(sep)|(o[ck]t)|(nov)|(de[cz]|déc))[^\W\d_]*"
)
_DATE = re.compile(r"(?<!\d)(\d{1,2})[-_./ ]+(\d{1,2})[-_./ ]+((?:19|20)\d\d)(?!\d)")
_HALF_DAY = re.compile(r"(?<!\d)(\d{1,2})((?:[-_.:]\d\d)*)[ _]?([ap])\.?m\b")


SUFFIXES = (".tif", ".tiff", ".png", ".bmp", ".jpg", ".jpeg", ".pgm")
_SYSTEM = ("thumbs.db", "ehthumbs.db", "desktop.ini")
AUTO, BY = "auto", ("auto", "name", "time")
WAY_OUT = Message("give --reference NAME, --order time or --order name (in an address: ?order=time)")
_REFERENCE = {
    "ref", "reference", "undeformed", "unloaded", "initial", "before",
    "referenz", "unverformt", "unbelastet", "référence", "initiale",
}  # fmt: skip
_MASK = {"mask", "maske", "masque"}
_VERSION = re.compile(r"(?:^|[^a-z])(?:v|ver|version|rev)[\s._-]*$")
_NUMBER = re.compile(
    r"((?<![^\s_=(-])[-+])?((?<![^\s_=(+-])\d*[.,]?\d+e[-+]\d\d+(?![\d.,])|(?<![^\s_=(+-])[.,]\d+|\d+(?:[.,]\d+)*)"
)
"""A sign after a blank, ``_``, ``=``, ``(``, a hyphen or at the beginning; 5e-05, .05, 0.05, 7, or 2025.11.25."""
_LEAST_WRAP, _NEAR = 3, 20
"""Digits of a counter that begins again, at least; how near to its ends pictures lie that show it."""
Key = list[str | Decimal]


def dated(stems: Sequence[str]) -> list[list[str]]:
    """Names with their dates as year, month, day and 24 hours; several lists where day and month may be either.

    Parameters
    ----------
    stems : sequence of str
        In small letters. What not all of them have is let be: it may be another word or number.
    """
    found = [*stems]
    if len({month[0] for stem in stems if (month := _MONTHS.search(stem))}) > 1 and all(
        map(_MONTHS.search, stems)
    ):
        found = [_MONTHS.sub(lambda m: f".{m.lastindex:02}.", stem, count=1) for stem in found]
    if all(map(_HALF_DAY.search, found)):
        found = [_HALF_DAY.sub(_of_24_hours, stem) for stem in found]
    dates = [_DATE.search(stem) for stem in found]
    if not all(dates):
        return [found]
    ways = [way for way in (r"\1.\2", r"\2.\1") if all(_is_day(m.expand(way)) for m in dates if m)]
    return [[_DATE.sub(_year_first(way), stem, count=1) for stem in found] for way in ways] or [found]


def _is_day(text: str) -> bool:
    """Whether this is a day and a month."""
    day, month = map(int, text.split("."))
    return 1 <= day <= 31 and 1 <= month <= 12


def _year_first(way: str) -> Callable[[re.Match[str]], str]:
    def turn(match: re.Match[str]) -> str:
        day, month = map(int, match.expand(way).split("."))
        return f"{match[3]}-{month:02}-{day:02}"

    return turn


def _of_24_hours(match: re.Match[str]) -> str:
    hour = int(match[1]) % 12 + (12 if match[3] == "p" else 0)
    return f"{hour:02}{match[2]}"


def listed(target: str) -> list[Path]:
    """The images of ``find_images`` in no order; raises DataError where there is none."""
    path = expanded(target)
    if path.is_dir():
        there = [item for item in path.iterdir() if _is_seen(item)]
        found = [item for item in there if item.suffix.lower() in SUFFIXES]
    elif path.exists():
        there = found = [path]
    else:
        names = glob.glob(str(path), recursive=True)  # noqa: PTH207 (absolute patterns too)
        there = found = [item for item in map(Path, names) if not item.is_dir() and _is_seen(item)]
    for item in found or there:
        if what := FOREIGN.get(item.suffix.lower()):
            raise DataError("{value}: {what}", item, what)
    if found:
        return found
    if not path.is_dir():
        raise DataError(
            "files:{target}: no image there; looked in {absolute}", target, path.parent.absolute()
        )
    others = ", ".join(sorted(item.name for item in there)[:3])
    only = (
        Message("only {others}{value}", others, " ..." * (len(there) > 3))
        if there
        else Message("it is empty")
    )
    raise DataError(
        "{path}: no picture in this folder ({only}); wanted: {listed}", path, only, ", ".join(SUFFIXES)
    )


def _is_seen(path: Path) -> bool:
    """Whether it is no file of a file manager or hidden."""
    return not path.name.startswith(".") and path.name.lower() not in _SYSTEM


class _Reading(NamedTuple):
    """How what may be read in two ways is read: 1.10 as a decimal, -10 as negative."""

    decimal: bool
    signed: bool


class _Piece(NamedTuple):
    """A number in a name, and the text before it; ``column`` is what numbers are compared with."""

    before: str
    sign: str
    digits: str
    column: tuple[int, str]


class _Doubts(NamedTuple):
    """Columns of numbers that may be decimals or two counters, and whose minus may be a hyphen."""

    points: set[tuple[int, str]]
    signs: set[tuple[int, str]]


def masks(names: Sequence[str]) -> set[str]:
    """Those that are masks by their names, where others are not."""
    found = {name for name in names if _words(name) & _MASK}
    return found if len(found) < len(set(names)) else set()


def in_order(
    names: Sequence[str], times: Callable[[], Sequence[float]], by: str = AUTO, first: str | None = None
) -> list[int]:
    """Places of ``names`` in the order of the test; a picture that is called reference is the first.

    Parameters
    ----------
    names : sequence of str
        Paths from their common folder.
    times : callable that returns a sequence of float
        When they were taken, in any unit; called where it is needed.
    by : "auto" | "name" | "time"
        auto: by name where names say it, else as the times show.
    first : str or None
        The one that is known to be the reference: decides where names do not.

    Raises
    ------
    ConfigError
        The names can be read in two ways, two are called reference, or two have the same time.
    """
    if by == "time":
        order = _by_time(names, times())
    else:
        orders, timed = _by_name(names, by)
        order = orders[0]
        if len(orders) > 1:
            order = _decided(names, orders, times() if timed and first is None else (), first)
    called = [k for k in order if _words(names[k]) & _REFERENCE]
    if not called or len(called) == len(order):
        return order
    if len(called) > 1:
        if by != AUTO or first:
            return order
        a, b = names[called[0]], names[called[1]]
        raise ConfigError("{a} and {b} are both called reference; {WAY_OUT}", a, b, WAY_OUT)
    return called + [k for k in order if k not in called]


def _by_time(names: Sequence[str], times: Sequence[float]) -> list[int]:
    order = sorted(range(len(names)), key=lambda k: times[k])
    for a, b in itertools.pairwise(order):
        if times[a] == times[b]:
            raise ConfigError(
                "{names} and {names2} have the same time, so times give no order; rename them in the order of the "
                "test",
                names[a],
                names[b],
            )
    return order


def _by_name(names: Sequence[str], by: str) -> tuple[list[list[int]], bool]:
    """The orders that the names may mean, one where they leave no choice; and whether times may decide."""
    stems = [unicodedata.normalize("NFKC", _stem(name)).replace("\u2212", "-").casefold() for name in names]
    if _is_hexadecimal(stems):
        return [sorted(range(len(names)), key=lambda k: (len(stems[k]), stems[k], names[k]))], False
    stems, *others = dated(stems)
    found = [_pieces(stem) for stem in stems]
    doubts = _doubts([pieces for pieces, _ in found])

    def order(reading: _Reading) -> list[int]:
        keys = [_key(*one, doubts, reading) for one in found]
        return sorted(range(len(names)), key=lambda k: (keys[k], stems[k], names[k]))

    orders = [order(_Reading(decimal=False, signed=True))]
    if doubts.signs:
        orders.append(order(_Reading(decimal=False, signed=False)))
    orders += [sorted(range(len(names)), key=lambda k: (other[k], names[k])) for other in others]
    orders += _turned(orders[0], [pieces for pieces, _ in found], [rest for _, rest in found])
    decimals = order(_Reading(decimal=True, signed=True)) if doubts.points else orders[0]
    if by == "name" or all(other == orders[0] for other in [*orders, decimals]):
        return orders[:1], False
    return [*orders, decimals], decimals == orders[0]


def _decided(
    names: Sequence[str], orders: list[list[int]], taken: Sequence[float], first: str | None
) -> list[int]:
    """The order that begins with ``first``, or that the times ``taken`` follow, where there are some."""
    if first is not None:
        return next((order for order in orders if names[order[0]] == first), orders[0])
    text = sorted(range(len(names)), key=lambda k: names[k])
    for order in orders if taken else []:
        if order != text and all(taken[a] < taken[b] for a, b in itertools.pairwise(order)):
            return order
    other = next(order for order in orders if order != orders[0])
    a, b = next((names[i], names[j]) for i, j in zip(orders[0], other, strict=True) if i != j)
    raise ConfigError(
        "the names do not say which comes first, {a} or {b}, and the times of the files do not either; "
        "{WAY_OUT}",
        a,
        b,
        WAY_OUT,
    )


def _stem(name: str) -> str:
    return name.removesuffix(PurePath(name).suffix)


def _words(name: str) -> set[str]:
    """The words of a file's name, without numbers: ``Ref_0001.tif`` has ref."""
    return set(re.findall(r"[^\W\d_]+", PurePath(name).stem.casefold()))


# -- numbers in names ---------------------------------------------------------------------------


def _pieces(stem: str) -> tuple[list[_Piece], str]:
    """The numbers of a name with the text before each, and the text after the last."""
    found, end = [], 0
    for k, number in enumerate(_NUMBER.finditer(stem)):
        before = stem[end : number.start()]
        found.append(_Piece(before, number[1] or "", number[2], (k, before)))
        end = number.end()
    return found, stem[end:]


def _doubts(names: Sequence[list[_Piece]]) -> _Doubts:
    columns: dict[tuple[int, str], list[_Piece]] = defaultdict(list)
    for piece in itertools.chain.from_iterable(names):
        columns[piece.column].append(piece)
    return _Doubts(
        {key for key, pieces in columns.items() if _may_be_counters(pieces)},
        {
            key
            for key, pieces in columns.items()
            if any(piece.sign == "-" for piece in pieces) and not any(_is_positive(piece) for piece in pieces)
        },
    )


def _may_be_counters(pieces: Sequence[_Piece]) -> bool:
    """Whether 1.10 may be the tenth of 1: a version, or a zero at the end where others have less digits."""
    points = [piece.digits for piece in pieces if len(re.findall(r"\d+", piece.digits)) == 2]
    parts = [re.split("[.,]", digits)[1] for digits in points if "e" not in digits]
    uneven = len({len(part) for part in parts}) > 1
    comma = any("," in digits for digits in points) and not any(part.startswith("0") for part in parts)
    tens = any(len(part) > 1 and part.endswith("0") for part in parts)
    return bool(_VERSION.search(pieces[0].before)) or (uneven and (tens or comma))


def _is_positive(piece: _Piece) -> bool:
    return piece.sign != "-" and piece.digits.strip("0.,") != ""


def _key(pieces: Sequence[_Piece], rest: str, doubts: _Doubts, reading: _Reading) -> Key:
    """Texts and numbers by turns."""
    key: Key = []
    for piece in pieces:
        digits, parts = piece.digits.replace(",", "."), re.split("[.,]", piece.digits)
        as_one = len(parts) == 1 or (
            len(parts) == 2 and (reading.decimal or piece.column not in doubts.points)
        )
        minus = piece.sign == "-" and (reading.signed or piece.column not in doubts.signs)
        numbers = [Decimal(digits)] if as_one else [Decimal(part or 0) for part in parts]
        numbers[0] = -numbers[0] if minus else numbers[0]
        key += [piece.before, numbers[0]]
        for number in numbers[1:]:
            key += [".", number]
    return [*key, rest]


def _turned(order: list[int], names: Sequence[list[_Piece]], rests: Sequence[str]) -> list[list[int]]:
    """The order with the end first where a counter began again between: 9998, 9999, 0001."""
    texts = {(*(piece.before for piece in pieces), rest) for pieces, rest in zip(names, rests, strict=True)}
    if len(texts) > 1:
        return []
    columns = [set(column) for column in zip(*([p.digits for p in pieces] for pieces in names), strict=True)]
    changing = [k for k, column in enumerate(columns) if len(column) > 1]
    if len(changing) != 1:
        return []
    counts = [names[k][changing[0]].digits for k in order]
    start = _shared(counts)
    counts = [count[start:] for count in counts]
    width = len(counts[0])
    if width < _LEAST_WRAP or any(len(count) != width or not count.isdecimal() for count in counts):
        return []
    values = [int(count) for count in counts]
    steps = [b - a for a, b in itertools.pairwise(values)]
    hole = max(range(len(steps)), key=steps.__getitem__)
    others = max(steps[:hole] + steps[hole + 1 :], default=0)
    at_ends = values[0] <= _NEAR and values[-1] >= 10**width - 1 - _NEAR
    if not at_ends or steps[hole] <= 10 * max(others, 1):
        return []
    return [order[hole + 1 :] + order[: hole + 1]]


def _shared(texts: Sequence[str]) -> int:
    """How many characters at the beginning all have in common."""
    pairs = zip(min(texts), max(texts), strict=False)
    return sum(1 for _ in itertools.takewhile(lambda pair: pair[0] == pair[1], pairs))


def _is_hexadecimal(stems: Sequence[str]) -> bool:
    """Whether names differ in hexadecimal digits: of equal length, or each number once."""
    start, end = (_shared([stem[::step] for stem in stems]) for step in (1, -1))
    parts = [stem[start : len(stem) - end] for stem in stems]
    if not all(re.fullmatch("[0-9a-f]+", part) for part in parts):
        return False
    if len({len(part) for part in parts}) == 1:
        places = list(zip(*parts, strict=True))
        return any({c.isdigit() for c in place} == {True, False} for place in places)
    values = {int(part, 16) for part in parts}
    return any(not part.isdecimal() for part in parts) and max(values) - min(values) + 1 == len(stems)
