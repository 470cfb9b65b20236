"""The keyboard during a run: one letter and Enter.

r new reference, t tare, p pause or go on, q quit, n TEXT a note, ? help.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, TextIO

from acquire.events import EventKind

if TYPE_CHECKING:
    from live.run import LiveRun
    from live.tell import Screen

HELP = "keys (with Enter): r new reference, t tare, p pause/go on, n TEXT note, q quit"


class Operator:
    """Carries out what is typed."""

    def __init__(self, live: LiveRun, screen: Screen) -> None:
        self._live, self._screen = live, screen
        self._paused = False

    def line(self, text: str) -> None:
        """One line as typed; an unknown one gets the help."""
        word, _, rest = text.strip().partition(" ")
        if word == "q":
            self._live.stop("ended by the operator")
        elif word == "r":
            self._live.command(EventKind.NEW_REFERENCE)
        elif word == "t":
            self._live.command(EventKind.TARE)
        elif word == "p":
            self._paused = not self._paused
            self._live.command(EventKind.PAUSE if self._paused else EventKind.RESUME)
        elif word == "n" and rest:
            self._live.command(EventKind.NOTE, rest)
        elif word:
            self._screen.say(HELP)


def listen(live: LiveRun, stream: TextIO | None, screen: Screen) -> threading.Thread | None:
    """Listen to ``stream`` from a thread of its own, where it is a terminal."""
    if stream is None or stream.closed or not stream.isatty():
        return None
    operator = Operator(live, screen)

    def work() -> None:
        try:
            for text in stream:
                operator.line(text)
        except (OSError, ValueError):
            return

    thread = threading.Thread(target=work, name="keyboard", daemon=True)
    thread.start()
    screen.say(HELP)
    return thread
