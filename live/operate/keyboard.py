"""The keyboard during a run: single keys where it is a terminal, whole lines where it only looks like one."""

from __future__ import annotations

import codecs
import contextlib
import os
import select
import threading
from collections.abc import Callable, Iterator
from typing import Any, TextIO

from live.operate.keys import HELP, Keys
from live.operate.orders import Orders, answer
from live.tell import Screen

LINES = (
    "keys (with Enter): r new reference, t tare (t! whatever the load does, u undo it), p pause/go on,"
    " s start recording, n TEXT note, a alarm off, q quit; or the words: ? lists them"
)
_LOOK_S = 0.5


class Keyboard:
    """Listens in a thread of its own, from ``start`` to ``close``."""

    def __init__(self, orders: Orders, stream: TextIO, screen: Screen) -> None:
        self._orders, self._stream, self._screen = orders, stream, screen
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._work, name="keyboard", daemon=True)
        self._mode = _single_keys(stream)

    def start(self) -> None:
        """Begin; says which keys there are."""
        self._screen.say(HELP if self._mode else LINES)
        self._thread.start()

    def join(self, seconds: float) -> None:
        """Wait until the stream has ended."""
        self._thread.join(seconds)

    def close(self) -> None:
        """Listen no more; the terminal is again as it was."""
        self._closed.set()
        if self._mode is not None:
            self._thread.join(2 * _LOOK_S)
            self._mode()

    def _work(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            if self._mode is None:
                self._take_lines()
            else:
                self._take_keys()

    def _take_lines(self) -> None:
        for text in self._stream:
            if text.strip() and (said := answer(text, self._orders)) != "ok":
                self._screen.say(said)

    def _take_keys(self) -> None:
        keys = Keys(self._orders, self._screen)
        for text in self._typed(self._stream.fileno()):
            keys.type(text)

    def _typed(self, number: int) -> Iterator[str]:
        decoder = codecs.getincrementaldecoder("utf-8")("replace")
        while not self._closed.is_set():
            if select.select([number], [], [], _LOOK_S)[0]:
                data = os.read(number, 256)
                if not data:
                    return
                yield decoder.decode(data)


def listen(orders: Orders, stream: TextIO | None, screen: Screen) -> Keyboard | None:
    """Listen to ``stream``, where it is a terminal."""
    if stream is None or stream.closed or not stream.isatty():
        return None
    keyboard = Keyboard(orders, stream, screen)
    keyboard.start()
    return keyboard


def _single_keys(stream: TextIO) -> Callable[[], None] | None:
    """Have a terminal give each key at once, unseen; what puts it back. None where it cannot.

    In the background a terminal is left alone: changing it would stop the program.
    """
    try:
        import termios
        import tty
    except ImportError:  # another system
        return None
    try:
        number = stream.fileno()
        if os.tcgetpgrp(number) != os.getpgrp():
            return None
        before: Any = termios.tcgetattr(number)
        tty.setcbreak(number, termios.TCSADRAIN)
    except (OSError, ValueError, termios.error):
        return None

    def put_back() -> None:
        with contextlib.suppress(OSError, ValueError, termios.error):
            termios.tcsetattr(number, termios.TCSADRAIN, before)

    return put_back
