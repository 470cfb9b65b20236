"""The keyboard during a run: one line, one order (``orders`` has the words and their letters)."""

from __future__ import annotations

import threading
from typing import TextIO

from live.operate.orders import Orders, answer
from live.tell import Screen

HELP = (
    "keys (with Enter): r new reference, t tare (t! whatever the load does, u undo it), p pause/go on,"
    " n TEXT note, a alarm off, q quit; or the words: ? lists them"
)


def listen(orders: Orders, stream: TextIO | None, screen: Screen) -> threading.Thread | None:
    """Listen to ``stream`` from a thread of its own, where it is a terminal."""
    if stream is None or stream.closed or not stream.isatty():
        return None

    def work() -> None:
        try:
            for text in stream:
                if text.strip() and (said := answer(text, orders)) != "ok":
                    screen.say(said)
        except (OSError, ValueError):
            return

    thread = threading.Thread(target=work, name="keyboard", daemon=True)
    screen.say(HELP)
    thread.start()
    return thread
