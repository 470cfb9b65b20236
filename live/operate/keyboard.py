"""The keyboard during a run: one letter and Enter (``orders`` has what they mean)."""

from __future__ import annotations

import threading
from typing import TextIO

from live.operate.orders import HELP, Orders, carry_out
from live.tell import Screen


def listen(orders: Orders, stream: TextIO | None, screen: Screen) -> threading.Thread | None:
    """Listen to ``stream`` from a thread of its own, where it is a terminal."""
    if stream is None or stream.closed or not stream.isatty():
        return None

    def work() -> None:
        try:
            for text in stream:
                if not carry_out(text, orders):
                    screen.say(HELP)
        except (OSError, ValueError):
            return

    thread = threading.Thread(target=work, name="keyboard", daemon=True)
    thread.start()
    screen.say(HELP)
    return thread
