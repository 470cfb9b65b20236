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

Why an order is not carried out.

Tare as an order: at once without load or before the test, by two orders within 3 s under load in mid-test.

A tare in mid-test moves the zero of every force after it: modulus, stress and yield point are then
those of two different zeros. So one key pressed by mistake must not do it, and what was done can be undone.

The port for orders: a line in, an answer out (``orders`` has the words).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

from acquire.events import EventKind, Level
from acquire.load_sample import LoadCellInfo, LoadSample
from acquire.printable import printable
from live.config.listen_address import ListenAddress, read_token
from live.pipeline.screen import Screen
from live.run.tcp_lines import LineServer


class ControlRefused(Exception):
    """Says in a sentence why an order is not carried out, and what to do."""


FORCED, UNDO = "force", "undo"
"""What an order of ``EventKind.TARE`` may say besides nothing."""
CONFIRM_S = 3.0
LITTLE = 1e-3  # of the capacity: no load

Tell = Callable[[EventKind, str, str, Level], None]  # kind, source, sentence, level


class Tared(Protocol):
    """What is used of a load cell."""

    @property
    def info(self) -> LoadCellInfo: ...

    def tare(self, *, force: bool = False) -> None: ...

    def undo_tare(self) -> None: ...


class TareControls:
    """Carries out orders to tare.

    Parameters
    ----------
    cell : LoadCell
    measured : callable
        Whether anything has been measured yet; before that a tare falsifies nothing.
    latest : callable giving LoadSample or None
        The newest sample.
    tell : callable taking kind, source, text and level
    clock : callable giving monotonic seconds
    """

    def __init__(
        self,
        cell: Tared,
        measured: Callable[[], bool],
        latest: Callable[[], LoadSample | None],
        tell: Tell,
        clock: Callable[[], float],
    ) -> None:
        self._cell, self._measured, self._latest = cell, measured, latest
        self._tell, self._clock = tell, clock
        self._asked = -math.inf  # when a confirmation was asked for

    def order(self, how: str = "") -> None:
        """Tare; FORCED: whatever the load does; UNDO: let zero be where it was before the last tare.

        Raises
        ------
        OrderRefused
            There is nothing to tare, or it has to be ordered again.
        """
        if self._cell.info.protocol == "none":
            raise ControlRefused("there is no load cell")
        asked, self._asked = self._asked, -math.inf
        risk = "" if how else self._risk()
        if how == UNDO:
            self._tell(EventKind.TARE, "operator", "undo the last tare", "info")
            self._cell.undo_tare()
        elif risk and self._clock() - asked > CONFIRM_S:
            self._asked = self._clock()
            text = (
                f"{risk}: forces before and after a tare have different zeros, and so have modulus and stress"
            )
            raise ControlRefused(f"{text}; order it again within {CONFIRM_S:g} s to do it")
        else:
            self._tell(EventKind.TARE, "operator", "tare" + (", forced" if how else ""), "info")
            self._cell.tare(force=how == FORCED)

    def _risk(self) -> str:
        """Why a tare now would falsify what was measured; "" where it would not."""
        sample, capacity = self._latest(), self._cell.info.capacity_N
        if sample is None or not self._measured() or abs(sample.force) <= LITTLE * (capacity or 0.0):
            return ""
        load = "an unknown load" if math.isnan(sample.force) else f"{sample.force:.6g} N"
        return f"not tared yet: {load} in mid-test"


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


class Controls(Protocol):
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


def answer(line: str, orders: Controls) -> str:
    """Carry out one line; ``ok``, ``ok: TEXT`` or ``no: REASON``, in one line."""
    try:
        text = _carried_out(_in_full(line, orders), orders)
    except ControlRefused as refused:
        return f"no: {_in_one_line(refused)}"
    return f"ok: {_in_one_line(text)}" if text else "ok"


def _in_full(line: str, orders: Controls) -> str:
    """The order with its short form written out, its words one blank apart."""
    if len(line) > MOST_LETTERS:
        raise ControlRefused(f"an order has up to {MOST_LETTERS} letters")
    first, *rest = line.split() or [""]
    if first == "p":
        first = "resume" if orders.paused else "pause"
    return " ".join([_SHORT.get(first, first), *rest])


def _carried_out(order: str, orders: Controls) -> str:
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
    raise ControlRefused(f"{order!r} is no order; there are {WORDS}")


def _in_one_line(text: object) -> str:
    return " ".join(printable(text).split())


WHAT = "the port for orders"


class ControlPort:
    """Takes orders over TCP, from ``open`` to ``close``.

    Parameters
    ----------
    where : str
        ``PORT`` or ``HOST:PORT``.
    token_file : str or None
        Holds what a client must say first; needed beyond this machine.
    screen : Screen
        Told where it listens.

    Raises
    ------
    ConfigError
        The port is taken, or a token is missing.
    """

    def __init__(self, where: str, token_file: str | None, screen: Screen) -> None:
        place = ListenAddress.parse(where)
        self._token, self._screen = read_token(place, token_file, WHAT), screen
        self._host, self._listening = place.host, place.listen(WHAT)
        self._server: LineServer | None = None

    def open(self, orders: Controls) -> int:
        """Begin to take orders; the port."""
        self._server = LineServer(self._listening, self._token, lambda line: answer(line, orders))
        self._server.start()
        token = " (with a token)" if self._token else ""
        self._screen.say(f"orders are taken at {self._host}:{self._server.port}{token}")
        return self._server.port

    def close(self) -> None:
        """Take no more orders; again without effect."""
        if self._server is not None:
            self._server.close()
            self._server = None
        self._listening.close()
