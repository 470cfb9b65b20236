"""What is odd about the rows of a table of a recording, in words for a person."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acquire.text import Message, word


class Oddities:
    """What is odd about the rows of ``what``, which may come by the piece.

    Where the file was not ``closed``, the last rows may not be written yet: they are not missed.
    """

    def __init__(self, what: str, *, closed: bool) -> None:
        self._what, self._closed = what, closed
        self._rows = self._kept = self._unwritten = self._gone = self._backwards = 0
        self._first_back, self._last = -1, -np.inf

    @property
    def left_out(self) -> int:
        """Rows before the last good one, or before the end, that are left out."""
        return self._gone + self._unwritten * self._closed

    def add(self, good: NDArray[np.bool_], times: NDArray[np.float64]) -> None:
        """Rows, (N,), of which those that are ``good`` have these times."""
        if len(times):
            end = len(good) - int(np.argmax(good[::-1]))
            self._gone += self._unwritten + end - len(times)
            self._unwritten = 0
            wrong = np.flatnonzero(np.diff(times, prepend=self._last) < 0)
            if wrong.size and not self._backwards:
                self._first_back = self._kept + int(wrong[0]) - 1
            self._backwards, self._last = self._backwards + wrong.size, times[-1]
        else:
            end = 0
        self._unwritten += len(good) - end
        self._rows, self._kept = self._rows + len(good), self._kept + len(times)

    def words(self) -> tuple[str, ...]:
        """A sentence each, for a person."""
        words, what = [], word(self._what)
        if not self._closed and self._rows and not self._kept:
            words.append(Message("none of {rows} {what} has a time, so all are left out", self._rows, what))
        if self.left_out:
            there = self._rows - self._unwritten * (not self._closed)
            words.append(
                Message(
                    "{left_out} of {there} {what} have no time, or values beyond sense, and are left out",
                    self.left_out,
                    there,
                    what,
                )
            )
        if self._backwards:
            words.append(
                Message(
                    "the times of {what} run backwards at {backwards} places, first after row {first_back}",
                    what,
                    self._backwards,
                    self._first_back,
                )
            )
        return tuple(words)
