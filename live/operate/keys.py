"""What single keys mean: orders at once, and lines that are typed first."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from live.measure import Screen
from live.operate.orders import ENDED, Orders, answer

HELP = (
    "keys: r new reference, t tare (T whatever the load does, u undo it), p pause/go on, s start recording,"
    " n note, a alarm off, : any order, qq quit, ? the orders"
)
AT_ONCE = {"r": "r", "t": "t", "T": "t!", "u": "u", "p": "p", "s": "s", "a": "a", "?": "?"}
AGAIN_S = 3.0
"""The second q must come within this time: one key alone ends no test."""
ENTER, BACK, ESCAPE = ("\r", "\n"), ("\x7f", "\b"), "\x1b"


class Keys:
    """Takes what is typed, letter by letter.

    Parameters
    ----------
    orders : Orders
    screen : Screen
        Shows a line while it is typed, and answers that say more than ok.
    clock : callable giving seconds
    """

    def __init__(self, orders: Orders, screen: Screen, clock: Callable[[], float] = time.monotonic) -> None:
        self._orders, self._screen, self._clock = orders, screen, clock
        self._line: str | None = None
        self._quit_asked = -math.inf

    def type(self, text: str) -> None:
        """Take letters as they came; one that begins with an escape is a key without a letter."""
        if text.startswith(ESCAPE) and len(text) > 1:
            return
        for letter in text:
            if self._line is None:
                self._press(letter)
            else:
                self._edit(letter)

    def _press(self, letter: str) -> None:
        if letter in AT_ONCE:
            self._order(AT_ONCE[letter])
        elif letter == "n":
            self._show("note ")
        elif letter == ":":
            self._show("")
        elif letter == "q":
            self._quit()
        elif letter not in ENTER:
            self._screen.say(HELP)

    def _edit(self, letter: str) -> None:
        line = self._line or ""
        if letter in ENTER:
            self._show(None)
            if line.strip() not in ("", "note"):
                self._order(line)
        elif letter == ESCAPE:
            self._show(None)
        elif letter in BACK:
            self._show(line[:-1])
        elif letter.isprintable():
            self._show(line + letter)

    def _show(self, line: str | None) -> None:
        self._line = line
        self._screen.prompt(None if line is None else f": {line}_")

    def _order(self, line: str) -> None:
        if (said := answer(line, self._orders)) != "ok":
            self._screen.say(said)

    def _quit(self) -> None:
        asked, self._quit_asked = self._quit_asked, self._clock()
        if self._quit_asked - asked <= AGAIN_S:
            self._orders.stop(ENDED)
        else:
            self._screen.say(f"q again within {AGAIN_S:g} s ends the test")
