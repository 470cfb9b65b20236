"""A line of a check: one figure, whether it is good enough, and what to change."""

from __future__ import annotations

from dataclasses import dataclass

from acquire.text import Message
from acquire.text.message import joined, word
from live.setup.check.check_list import CheckFigures
from live.setup.check.sample import MIN_FRAMES


@dataclass(frozen=True, slots=True)
class CheckLine:
    """One figure of the check, whether it is good enough, and what to do if it is not.

    A figure that the pictures do not give (not ``measured``) is neither good nor bad. ``what`` and ``advice`` are words
    of the program, ``value`` a message or what was read.
    """

    what: str
    value: str
    good: bool = True
    advice: str = ""
    measured: bool = True

    def text(self) -> str:
        """The line as printed."""
        mark = ("ok  " if self.measured else "?   ") if self.good else "LOOK"
        line = Message("{mark}  {what:<22} {value}", mark, word(self.what), self.value)
        return line if self.good else joined("\n      -> ", (line, word(self.advice)))


def not_measured(f: CheckFigures, what: str) -> CheckLine:
    return CheckLine(
        what,
        Message(
            "not measured from {count_text}: it takes {MIN_FRAMES} of the still specimen",
            f.stack.count_text,
            MIN_FRAMES,
        ),
        measured=False,
    )
