"""Bytes on their way to messages: kept up to a bound, cut into lines, read line by line.

``HeldBytes`` keeps a message that only silence, or its length, ends. ``LineBuffer`` cuts a stream into lines, in
linear time and bounded memory: CR, LF and both end a line; empty lines vanish. The first line after a (re)start may
have lost its beginning and is dropped. A line that never ends is cut off at ``limit`` and comes out marked as
overlong, once. ``LineParser`` is the base of all protocols of lines.
"""

from __future__ import annotations

import math
import re
from abc import abstractmethod
from dataclasses import dataclass

from acquire.load_sample import LoadFlag
from acquire.protocols.base import Parser, Reading

_THOUSANDS = re.compile(r"[-+]?[0-9]{1,3}(?:\.[0-9]{3})+,[0-9]*")


class HeldBytes:
    """What has come since the last message.

    Parameters
    ----------
    limit : int, bytes
        More than this without a message is counted and not kept.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._received = self._start = 0
        self.data = bytearray()

    def add(self, data: bytes) -> None:
        """Bytes have come."""
        if not self.data:
            self._start = self._received
        self.data += data[: self._limit - len(self.data)]
        self._received += len(data)

    def take(self, size: int) -> tuple[bytes, int]:
        """The first ``size`` bytes, and the number of the first of them; they are held no longer."""
        taken, start = bytes(self.data[:size]), self._start
        del self.data[:size]
        self._start += size
        return taken, start

    def clear(self, lost: int = 0) -> None:
        """Forget all of it, and count ``lost`` bytes never added."""
        self.data.clear()
        self._received += lost


@dataclass(frozen=True, slots=True)
class Line:
    """A line without its end.

    Attributes
    ----------
    data : bytes
    start : int
        Number of its first byte, counted from the first byte ever fed.
    whole : bool
        False: cut off at the limit.
    """

    data: bytes
    start: int
    whole: bool = True


class LineBuffer:
    """Collects bytes and gives lines.

    Parameters
    ----------
    limit : int, bytes
        Longest line.
    ends : bytes
        The bytes that end a line.
    drop_first : bool
        Drop what comes before the first line end after a start.
    """

    def __init__(self, limit: int = 256, ends: bytes = b"\r\n", *, drop_first: bool = True) -> None:
        self._limit = limit
        self._end = re.compile(b"[" + re.escape(ends) + b"]")
        self._drop_first = drop_first
        self._position = 0  # of the first byte of _part
        self._part = bytearray()
        self._skipping = drop_first

    def feed(self, data: bytes) -> list[Line]:
        """Take bytes; the lines that they complete."""
        lines: list[Line] = []
        begin = 0
        for end in self._end.finditer(data):
            self._take(data[begin : end.start()], lines)
            self._finish(lines)
            begin = end.end()
        self._take(data[begin:], lines)
        return lines

    def _take(self, piece: bytes, lines: list[Line]) -> None:
        if self._skipping:
            self._position += len(piece)
            return
        before = len(self._part)
        self._part += piece[: self._limit + 1 - before]
        if len(self._part) > self._limit:
            lines.append(Line(bytes(self._part[: self._limit]), self._position, whole=False))
            self._position += before + len(piece)
            self._part.clear()
            self._skipping = True

    def _finish(self, lines: list[Line]) -> None:
        if self._part:
            lines.append(Line(bytes(self._part), self._position))
        self._position += len(self._part) + 1
        self._part.clear()
        self._skipping = False

    def restart(self, lost: int = 0) -> None:
        """Forget the line begun, and count ``lost`` bytes never fed; the next line may be partial."""
        self._position += len(self._part) + lost
        self._part.clear()
        self._skipping = self._drop_first


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
