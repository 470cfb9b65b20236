"""Dates and times of day in the names of pictures, in the order in which they follow one another."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

_MONTHS = re.compile(
    r"(?<![^\W\d_])(?:(jan)|(feb|f[ée]v)|(mar|m[äa]?rz)|(apr|avr)|(may|mai)|(jun|juin)|(jul|juil)"
    r"|(aug|ao[uû])|(sep)|(o[ck]t)|(nov)|(de[cz]|déc))[^\W\d_]*"
)
_DATE = re.compile(r"(?<!\d)(\d{1,2})[-_./ ]+(\d{1,2})[-_./ ]+((?:19|20)\d\d)(?!\d)")
_HALF_DAY = re.compile(r"(?<!\d)(\d{1,2})((?:[-_.:]\d\d)*)[ _]?([ap])\.?m\b")


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
    return [[_DATE.sub(_turned(way), stem, count=1) for stem in found] for way in ways] or [found]


def _is_day(text: str) -> bool:
    """Whether this is a day and a month."""
    day, month = map(int, text.split("."))
    return 1 <= day <= 31 and 1 <= month <= 12


def _turned(way: str) -> Callable[[re.Match[str]], str]:
    def turn(match: re.Match[str]) -> str:
        day, month = map(int, match.expand(way).split("."))
        return f"{match[3]}-{month:02}-{day:02}"

    return turn


def _of_24_hours(match: re.Match[str]) -> str:
    hour = int(match[1]) % 12 + (12 if match[3] == "p" else 0)
    return f"{hour:02}{match[2]}"
