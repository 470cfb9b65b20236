"""What an operator can ask of a run: one line, one order, one answer."""

from __future__ import annotations

from typing import Protocol

from acquire.events import EventKind
from live.operate.tare import FORCED, UNDO

HELP = (
    "keys (with Enter): r new reference, t tare (t! whatever the load does, u undo it), p pause/go on,"
    " n TEXT note, q quit"
)

TARES = {"t": "", "t!": FORCED, "u": UNDO}


class Orders(Protocol):
    """Who carries orders out; every method may be called from any thread."""

    @property
    def paused(self) -> bool:
        """Whether measuring is paused."""
        ...

    def stop(self, reason: str) -> None:
        """End the test cleanly, soon."""
        ...

    def command(self, kind: EventKind, note: str = "") -> None:
        """Carry out a command and write it down as an event.

        A tare may need the same command again within 3 s (``tare``), or one of its words as ``note``.
        """
        ...


def carry_out(line: str, orders: Orders) -> bool:
    """Carry out one line as typed; False where nobody knows what it means."""
    word, _, rest = line.strip().partition(" ")
    if word == "q":
        orders.stop("ended by the operator")
    elif word == "r":
        orders.command(EventKind.NEW_REFERENCE)
    elif word in TARES:
        orders.command(EventKind.TARE, TARES[word])
    elif word == "p":
        orders.command(EventKind.RESUME if orders.paused else EventKind.PAUSE)
    elif word == "n" and rest:
        orders.command(EventKind.NOTE, rest)
    else:
        return not word
    return True
