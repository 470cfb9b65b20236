"""The keyboard during a run: single keys where it is a terminal, whole lines where it only looks like one.

What single keys mean: orders at once, and lines that are typed first.
"""

from __future__ import annotations

import codecs
import contextlib
import math
import os
import select
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, TextIO

from live.pipeline.screen import Screen
from live.run.control import ENDED, Controls, answer

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
    orders : Controls
    screen : Screen
        Shows a line while it is typed, and answers that say more than ok.
    clock : callable giving seconds
    """

    def __init__(self, orders: Controls, screen: Screen, clock: Callable[[], float] = time.monotonic) -> None:
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


LINES = (
    "keys (with Enter): r new reference, t tare (t! whatever the load does, u undo it), p pause/go on,"
    " s start recording, n TEXT note, a alarm off, q quit; or the words: ? lists them"
)
_LOOK_S = 0.5


class Keyboard:
    """Listens in a thread of its own, from ``start`` to ``close``."""

    def __init__(self, orders: Controls, stream: TextIO, screen: Screen) -> None:
        self._orders, self._stream, self._screen = orders, stream, screen
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._work, name="keyboard", daemon=True)
        self._terminal = _Terminal.of(stream)

    def start(self) -> None:
        """Begin; says which keys there are."""
        self._screen.say(HELP if self._terminal else LINES)
        self._thread.start()

    def join(self, seconds: float) -> None:
        """Wait until the stream has ended."""
        self._thread.join(seconds)

    def close(self) -> None:
        """Listen no more; the terminal is again as it was."""
        self._closed.set()
        if self._terminal is not None:
            self._thread.join(2 * _LOOK_S)
            self._terminal.put_back()

    def _work(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            if self._terminal is None:
                self._take_lines()
            else:
                self._take_keys(self._terminal)

    def _take_lines(self) -> None:
        for text in self._stream:
            if text.strip() and (said := answer(text, self._orders)) != "ok":
                self._screen.say(said)

    def _take_keys(self, terminal: _Terminal) -> None:
        keys = Keys(self._orders, self._screen)
        for text in self._typed(terminal):
            keys.type(text)

    def _typed(self, terminal: _Terminal) -> Iterator[str]:
        decoder = codecs.getincrementaldecoder("utf-8")("replace")
        while not self._closed.is_set():
            if not terminal.single():
                self._closed.wait(_LOOK_S)  # what is typed is for somebody else
            elif select.select([terminal.number], [], [], _LOOK_S)[0] and terminal.ours:
                data = os.read(terminal.number, 256)
                if not data:
                    return
                yield decoder.decode(data)


def listen(orders: Controls, stream: TextIO | None, screen: Screen) -> Keyboard | None:
    """Listen to ``stream``, where it is a terminal."""
    if stream is None or stream.closed or not stream.isatty():
        return None
    keyboard = Keyboard(orders, stream, screen)
    keyboard.start()
    return keyboard


class _Terminal:
    """A terminal that gives each key at once, unseen, while it is this program's.

    A shell that stopped the program (Ctrl-Z) has its own way with the terminal, and leaves it so when the
    program goes on: it is set again. In the background it is left alone: touching it would stop the program.
    """

    def __init__(self, number: int, before: Any) -> None:
        self.number, self._before = number, before

    @classmethod
    def of(cls, stream: TextIO) -> _Terminal | None:
        """The terminal that ``stream`` is, set to single keys; None where that cannot be."""
        try:
            import termios
        except ImportError:  # another system
            return None
        try:
            terminal = cls(stream.fileno(), termios.tcgetattr(stream.fileno()))
        except (OSError, ValueError, termios.error):
            return None
        return terminal if terminal.single() else None

    @property
    def ours(self) -> bool:
        """Whether the program is in the foreground."""
        try:
            return os.tcgetpgrp(self.number) == os.getpgrp()
        except OSError:
            return False

    def single(self) -> bool:
        """Have it give single keys, where it does not; whether it does."""
        import termios
        import tty

        if not self.ours:
            return False
        try:
            if termios.tcgetattr(self.number)[tty.LFLAG] & termios.ICANON:
                tty.setcbreak(self.number, termios.TCSADRAIN)
        except (OSError, ValueError, termios.error):
            return False
        return True

    def put_back(self) -> None:
        """As it was."""
        import termios

        if self.ours:
            with contextlib.suppress(OSError, ValueError, termios.error):
                termios.tcsetattr(self.number, termios.TCSADRAIN, self._before)
