"""What a value of the configuration may be: checked as it comes from a file, and read from a word.

A check that refuses says what is allowed; whoever asks adds the key and the value.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any


class Refused(ValueError):
    """Says what is allowed."""


@dataclass(frozen=True, slots=True)
class Check:
    """A kind of value.

    Attributes
    ----------
    accept : callable
        The value as it is used; raises ``Refused``.
    read : callable
        From a word of the command line to what ``accept`` takes; raises ValueError.
    """

    accept: Callable[[Any], Any]
    read: Callable[[str], Any] = str


@dataclass(frozen=True, slots=True)
class Option:
    """How a key is said on the command line.

    Attributes
    ----------
    name : str
        Without its dashes.
    metavar : str
    choices : tuple of str
    off, on : bool
        A switch that turns the key off, or on.
    """

    name: str
    metavar: str = ""
    choices: tuple[str, ...] = ()
    off: bool = False
    on: bool = False


def key(
    check: Check, default: Any, help_text: str, option: Option | None = None, *, optional: bool = False
) -> Any:
    """A field of a section: its check, its default, its meaning; None is allowed where ``optional``."""
    metadata = {"check": check, "help": help_text, "optional": optional, "option": option}
    return field(default=default, metadata=metadata)


def number(low: float = -math.inf, high: float = math.inf) -> Check:
    """A number within bounds."""
    bounds = "" if low == -math.inf else f" from {low:g}" + (f" to {high:g}" * (high < math.inf))

    def accept(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise Refused(f"a number{bounds}")
        try:
            return float(value)
        except OverflowError:
            raise Refused(f"a number{bounds} of fewer digits") from None

    return Check(accept, float)


def integer(low: int, high: int) -> Check:
    """A whole number within bounds."""

    def accept(value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise Refused(f"a whole number from {low} to {high}")
        return value

    return Check(accept, int)


def choice(*allowed: str) -> Check:
    """One of a few words."""

    def accept(value: Any) -> str:
        if value not in allowed:
            raise Refused("one of " + ", ".join(repr(word) for word in allowed))
        return str(value)

    return Check(accept)


def _text(value: Any) -> str:
    if not isinstance(value, str) or "\0" in value:
        raise Refused("a text in quotes, without a zero byte")
    return value


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise Refused("true or false")
    return value


def _box(value: Any) -> tuple[int, int, int, int]:
    if not isinstance(value, list | tuple) or len(value) != 4 or not all(type(v) is int for v in value):
        raise Refused("four whole numbers: x, y, width, height in px")
    x, y, width, height = value
    if x < 0 or y < 0 or width < 1 or height < 1:
        raise Refused("x and y from 0, width and height from 1 (px)")
    return x, y, width, height


def _read_box(word: str) -> list[int]:
    values = [int(part) for part in word.split(",")]
    if len(values) != 4:
        raise ValueError("give four whole numbers x,y,width,height")
    return values


_EVERY = re.compile("[1-9][0-9]{0,8}")


def _region(value: Any) -> tuple[int, int, int, int] | str:
    if value in REGIONS:
        return str(value)
    try:
        return _box(value)
    except Refused as allowed:
        raise Refused(f"{allowed}; or {' or '.join(map(repr, REGIONS))}") from None


def _read_region(word: str) -> list[int] | str:
    return word if word in REGIONS else _read_box(word)


def _record_mode(value: Any) -> str:
    text = _text(value)
    every = text.removeprefix("every=")
    if text in ("all", "bursts") or (every != text and _EVERY.fullmatch(every)):
        return text
    raise Refused("'all', 'bursts' or 'every=K' with K from 1")


def _point(value: Any) -> tuple[float, float]:
    if not isinstance(value, list | tuple) or len(value) != 2 or not all(_finite(v) for v in value):
        raise Refused("two numbers: x, y in px")
    return float(value[0]), float(value[1])


def _finite(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) < 1e6


def _corners(value: Any) -> tuple[tuple[float, float], ...]:
    if not isinstance(value, list | tuple) or not 3 <= len(value) <= 100:
        raise Refused("3 to 100 corners [x, y], px")
    return tuple(_point(corner) for corner in value)


def _strains(value: Any) -> tuple[float, float]:
    if (
        not isinstance(value, list | tuple)
        or len(value) != 2
        or any(type(v) not in (int, float) for v in value)
    ):
        raise Refused("two strains, from and to, as [0.0005, 0.0025]")
    low, high = float(value[0]), float(value[1])
    if not 0 <= low < high <= 1:
        raise Refused("two strains with 0 <= from < to <= 1")
    return low, high


TEXT = Check(_text)
FLAG = Check(_flag)
BOX = Check(_box, _read_box)
"""x, y, width, height in px."""
STRAINS = Check(_strains)
"""An interval of strains."""
POINT = Check(_point)
CORNERS = Check(_corners)
"""x, y in px; of the corners of a polygon."""
AUTO, ALL = REGIONS = ("auto", "all")
"""Regions in words: the specimen that is found, or the picture but for a rim."""
REGION = Check(_region, _read_region)
"""A box, or one of the words."""
RECORD_MODE = Check(_record_mode)
