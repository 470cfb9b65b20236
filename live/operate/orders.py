"""What an operator can ask of a run: one line, one order, one answer.

The same words from the keyboard, the port for orders and the page::

    start, stop             begin and end recording (a run begins recording unless it is armed)
    reference               take a new reference from the next frames
    tare, tare force, tare undo
                            zero of the load; under load in mid-test it has to be ordered twice
    pause, resume           measuring; recording goes on
    note TEXT               words of the operator, stored with the test
    alarm off               silence the alarms that are on
    quit                    end the run and close the files

The answer is ``ok``, ``ok: TEXT`` or ``no: REASON``; what has been carried out is an event of the test.
"""

from __future__ import annotations

from typing import Protocol

from acquire.events import EventKind
from acquire.printable import printable
from live.operate.refusal import OrderRefused
from live.operate.tare import FORCED, UNDO

START, STOP = "start", "stop"
"""What an order of ``EventKind.RECORD`` says."""
ENDED = "ended by the operator"
MOST_LETTERS = 500  # of a line
WORDS = (
    "start, stop, reference, tare, tare force, tare undo, pause, resume, note TEXT, alarm off, quit;"
    " short: s, r, t, t!, u, p, n TEXT, a, q"
)
_SHORT = {"s": "start", "r": "reference", "t": "tare", "t!": "tare force", "u": "tare undo", "a": "alarm off",
          "n": "note", "q": "quit"}  # fmt: skip
_COMMANDS = {
    "start": (EventKind.RECORD, START),
    "stop": (EventKind.RECORD, STOP),
    "reference": (EventKind.NEW_REFERENCE, ""),
    "tare": (EventKind.TARE, ""),
    "tare force": (EventKind.TARE, FORCED),
    "tare undo": (EventKind.TARE, UNDO),
    "pause": (EventKind.PAUSE, ""),
    "resume": (EventKind.RESUME, ""),
    "alarm off": (EventKind.ALARM, ""),
}


class Orders(Protocol):
    """Who carries orders out; every method may be called from any thread."""

    @property
    def paused(self) -> bool:
        """Whether measuring is paused."""
        ...

    @property
    def recording(self) -> bool:
        """Whether frames are recorded."""
        ...

    def stop(self, reason: str) -> None:
        """End the test cleanly, soon."""
        ...

    def command(self, kind: EventKind, note: str = "") -> str:
        """Carry out a command and write it down as an event; what to add to ``ok``, mostly nothing.

        ``note`` is START or STOP for a recording, one of the words of ``tare`` for a tare.

        Raises
        ------
        OrderRefused
            It is not carried out.
        """
        ...


def answer(line: str, orders: Orders) -> str:
    """Carry out one line; ``ok``, ``ok: TEXT`` or ``no: REASON``, in one line."""
    try:
        text = _carried_out(_in_full(line, orders), orders)
    except OrderRefused as refused:
        return f"no: {_in_one_line(refused)}"
    return f"ok: {_in_one_line(text)}" if text else "ok"


def _in_full(line: str, orders: Orders) -> str:
    """The order with its short form written out, its words one blank apart."""
    if len(line) > MOST_LETTERS:
        raise OrderRefused(f"an order has up to {MOST_LETTERS} letters")
    first, *rest = line.split() or [""]
    if first == "p":
        first = "resume" if orders.paused else "pause"
    return " ".join([_SHORT.get(first, first), *rest])


def _carried_out(order: str, orders: Orders) -> str:
    word, _, text = order.partition(" ")
    if order in _COMMANDS:
        return orders.command(*_COMMANDS[order])
    if order == "quit":
        orders.stop(ENDED)
        return ""
    if word == "note" and text:
        return orders.command(EventKind.NOTE, printable(text))
    if order in ("help", "?"):
        return WORDS
    raise OrderRefused(f"{order!r} is no order; there are {WORDS}")


def _in_one_line(text: object) -> str:
    return " ".join(printable(text).split())
