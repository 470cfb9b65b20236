"""Cutting a stream of bytes into lines, in linear time and bounded memory.

CR, LF and both are line ends alike; empty lines vanish. The first line after a (re)start may
have lost its beginning and is dropped. A line that never ends is cut off at ``limit`` and
comes out marked as overlong, once.
"""

from __future__ import annotations

import re
from dataclasses import dataclass


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
