"""What all protocols of lines share: a line buffer, and one function from line to reading."""

from __future__ import annotations

import math
import re
from abc import abstractmethod

from acquire.load_sample import LoadFlag
from acquire.protocols.base import Parser, Reading
from acquire.protocols.line_buffer import Line, LineBuffer


class LineParser(Parser):
    """A parser that looks at one whole line at a time.

    Parameters
    ----------
    buffer : LineBuffer or None
        None: lines of up to 256 bytes, the first partial one dropped.
    """

    def __init__(self, buffer: LineBuffer | None = None) -> None:
        self._buffer = buffer or LineBuffer()

    def feed(self, data: bytes) -> list[Reading]:
        """Take bytes; the readings that they complete."""
        readings = (self._read(line) for line in self._buffer.feed(data))
        return [reading for reading in readings if reading is not None]

    def restart(self, lost: int = 0) -> None:
        """Forget the line begun, and count the bytes never fed."""
        self._buffer.restart(lost)

    def _read(self, line: Line) -> Reading | None:
        if not line.whole:
            return bad(line)
        return self.parse(line)

    @abstractmethod
    def parse(self, line: Line) -> Reading | None:
        """The reading of a whole line; None for one that is neither a reading nor damaged."""


def bad(line: Line, flags: LoadFlag = LoadFlag.NONE) -> Reading:
    """A line that gives no value and why: without flags it does not match the grammar."""
    return Reading(math.nan, None, line.data, line.start, flags=flags or LoadFlag.ERROR)


_THOUSANDS = re.compile(r"[-+]?[0-9]{1,3}(?:\.[0-9]{3})+,[0-9]*")


def number(text: str, decimal_comma: bool = False) -> float:
    """A decimal number, spaces after its sign allowed; NaN where it is none.

    Notations that ``float`` accepts and no device sends (nan, inf, 1_000) are refused. With
    ``decimal_comma`` a point is none: it may only stand between thousands (1.234,5).
    """
    plain = text.strip(" ")
    if plain[:1] in "+-":
        plain = plain[:1] + plain[1:].lstrip(" ")
    if decimal_comma:
        plain = plain.replace(".", "") if _THOUSANDS.fullmatch(plain) else plain
        plain = "" if "." in plain else plain.replace(",", ".")
    if not plain or not set(plain) <= set("0123456789+-.eE"):
        return math.nan
    try:
        value = float(plain)
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan
