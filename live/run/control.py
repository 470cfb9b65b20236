"""The commands of the operator: one line, one command, one answer.

The same commands from the keyboard, the port or socket for commands, and the page::

    start, stop             begin and end recording (a run begins recording unless it is armed)
    reference               take a new reference from the next frames
    tare, tare force, tare undo
                            zero of the load; under load in mid-test it must be given twice
    pause, resume           measuring; recording goes on
    note TEXT               note of the operator, stored with the test
    alarm off               silence the alarms that are on
    quit                    end the run and close the files

The answer is ``ok``, ``ok: TEXT`` or ``no: REASON``; a command that is carried out is an event of the test. A tare is
answered when the load cell has done or refused it, and with ``ok: queued`` where that takes longer than 2 s.
"""

from __future__ import annotations

import math
import queue
import socket
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple, Protocol

from acquire.clock import Clock
from acquire.errors import Spoken
from acquire.events import Event, EventKind, Level
from acquire.load_cell import LoadCell
from acquire.load_sample import LoadSample
from acquire.text import Message
from acquire.text.message import printable
from live.config.listen_address import SOCKET, ListenAddress, private_socket, read_token
from live.pipeline.consumer import Screen
from live.run.tcp_lines import LineServer

START, STOP = "start", "stop"
"""Notes of a command of ``EventKind.RECORD``."""
FORCED, UNDO, ONCE = "force", "undo", "once"
"""Notes of a command of ``EventKind.TARE``, which may also have none. ONCE is never the repetition of another."""
BOUNCE_S, CONFIRM_S = 0.5, 3.0
"""A command is repeated, as a confirmation, after this time and before that: a key that is held repeats too soon."""
TARED_S = 2.0  # the answer to a tare waits so long for what the load cell did
QUEUED = Message("queued; the load cell has not done it yet, and an event will report it")
NO_LOAD = 1e-3  # share of the capacity
ENDED = Message("ended by the operator")
MAX_LENGTH = 500  # of a line
COMMANDS = Message(
    "start, stop, reference, tare, tare force, tare undo, pause, resume, note TEXT, alarm off, quit; "
    "short: s, r, t, t!, u, p, n TEXT, a, q"
)
WHAT = "the port for commands"
SOCKET_NAME = "orders.sock"
_SHORT = {"s": "start", "r": "reference", "t": "tare", "t!": "tare force", "u": "tare undo", "a": "alarm off",
          "n": "note", "q": "quit"}  # fmt: skip
_COMMANDS = {
    "start": (EventKind.RECORD, START),
    "stop": (EventKind.RECORD, STOP),
    "reference": (EventKind.NEW_REFERENCE, ""),
    "tare": (EventKind.TARE, ""),
    "tare force": (EventKind.TARE, FORCED),
    "tare once": (EventKind.TARE, ONCE),
    "tare undo": (EventKind.TARE, UNDO),
    "pause": (EventKind.PAUSE, ""),
    "resume": (EventKind.RESUME, ""),
    "alarm off": (EventKind.ALARM, ""),
}


class ControlRefused(Spoken):
    """Its text is why a command is not carried out, and what to do; ``risk``: of a tare that may be confirmed."""

    risk = ""


class Answer(NamedTuple):
    """What became of a command.

    Attributes
    ----------
    text : str
        What was done, mostly empty; why it was refused.
    refused : bool
    risk : str
        Of a tare under load: what it would do; the page asks, and forces it.
    """

    text: str = ""
    refused: bool = False
    risk: str = ""

    @property
    def line(self) -> str:
        """``ok``, ``ok: TEXT`` or ``no: REASON``, in one line."""
        word = "no" if self.refused else "ok"
        return f"{word}: {_in_one_line(self.text)}" if self.text else word


def refusal(text: str, *values: object) -> Answer:
    """A command that is not carried out, and why."""
    return Answer(Message(text, *values) if values else text, refused=True)


class TareableTest(Protocol):
    """The test in whose middle a cell may be tared."""

    @property
    def has_measured(self) -> bool:
        """Whether anything has been measured yet; before that a tare falsifies nothing."""
        ...

    @property
    def latest_load(self) -> LoadSample | None:
        """The newest sample."""
        ...

    def emit(self, kind: EventKind, source: str, text: str, level: Level) -> None:
        """Put an event into the log."""


class TareControl:
    """Carries out tare commands: at once without load or before the test, else only when given again after 0.5 to 3 s.

    A tare in mid-test moves the zero of every force after it: modulus, stress and yield point then have
    two different zeros. So one key pressed by mistake must not do it, and a tare can be undone.

    Parameters
    ----------
    cell : LoadCell
    test : TareableTest
    clock : callable giving monotonic seconds
    wait_s : float, s
        Longest wait for the event with which the cell reports what it did (``take_event``).
    """

    def __init__(
        self,
        cell: LoadCell,
        test: TareableTest,
        clock: Clock,
        wait_s: float = TARED_S,
    ) -> None:
        self._cell, self._test, self._clock, self._wait_s = cell, test, clock, wait_s
        self._confirm_t = -math.inf  # time of the last request for a confirmation
        self._done: queue.SimpleQueue[Event] = queue.SimpleQueue()

    def take_event(self, event: Event) -> None:
        """Note what the cell did about a tare; other events are ignored."""
        is_answer = event.kind is EventKind.TARE or event.data.get("tared") is False
        if is_answer and event.source == self._cell.info.address:
            self._done.put(event)

    def tare(self, how: str = "") -> str:
        """Tare; FORCED: whatever the load does; ONCE: only without a risk; UNDO: restore the zero before the last tare.

        Returns
        -------
        str
            What the cell did, or that it has not done it yet.

        Raises
        ------
        ControlRefused
            There is no load cell, the command must be given again, or the cell refuses it.
        """
        if self._cell.info.protocol == "none":
            raise ControlRefused("there is no load cell")
        confirm_t, self._confirm_t = self._confirm_t, -math.inf
        risk = self._risk() if how in ("", ONCE) else ""
        while not self._done.empty():
            self._done.get()
        if how == UNDO:
            self._test.emit(EventKind.TARE, "operator", Message("undo the last tare"), "info")
            self._cell.undo_tare()
        elif risk and (how == ONCE or not BOUNCE_S <= self._clock() - confirm_t <= CONFIRM_S):
            text = Message(
                "{risk}: forces before and after a tare have different zeros, and so have modulus and stress",
                risk,
            )
            if how == ONCE:
                refused = ControlRefused("{text}; confirm it", text)
                refused.risk = text
                raise refused
            self._confirm_t = self._clock()
            raise ControlRefused(
                "{text}; repeat the command within {CONFIRM_S:g} s to do it", text, CONFIRM_S
            )
        else:
            text = Message("tare, forced") if how == FORCED else Message("tare")
            self._test.emit(EventKind.TARE, "operator", text, "info")
            self._cell.tare(force=how == FORCED)
        return self._outcome()

    def _outcome(self) -> str:
        try:
            event = self._done.get(timeout=self._wait_s)
        except queue.Empty:
            return QUEUED
        if event.kind is not EventKind.TARE:
            raise ControlRefused(event.text)
        return event.text

    def _risk(self) -> str:
        """Why a tare now would falsify what was measured; "" where it would not."""
        sample, capacity = self._test.latest_load, self._cell.info.capacity_N
        if sample is None or not self._test.has_measured or abs(sample.force) <= NO_LOAD * (capacity or 0.0):
            return ""
        load = (
            Message("an unknown load") if math.isnan(sample.force) else Message("{force:.6g} N", sample.force)
        )
        return Message("not tared yet: {load} in mid-test", load)


class Controls(Protocol):
    """The part of a run that carries out commands; every method may be called from any thread."""

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
        """Carry out a command and log it as an event; the text after ``ok``, mostly empty.

        ``note`` is START or STOP for a recording, "", FORCED or UNDO for a tare.

        Raises
        ------
        ControlRefused
            The command is not carried out.
        """
        ...


def answer(line: str, controls: Controls) -> str:
    """Carry out one line; ``ok``, ``ok: TEXT`` or ``no: REASON``, in one line."""
    return carry_out(line, controls).line


def carry_out(line: str, controls: Controls) -> Answer:
    """Carry out one line."""
    try:
        return Answer(_execute(_expanded(line, controls), controls))
    except ControlRefused as refused:
        return Answer(refused.text, True, refused.risk)


def _expanded(line: str, controls: Controls) -> str:
    """The command with its short form expanded, its words separated by one blank."""
    if len(line) > MAX_LENGTH:
        raise ControlRefused("a command has up to {MAX_LENGTH} letters", MAX_LENGTH)
    first, *rest = line.split() or [""]
    if first == "p":
        first = "resume" if controls.paused else "pause"
    return " ".join([_SHORT.get(first, first), *rest])


def _execute(command: str, controls: Controls) -> str:
    word, _, text = command.partition(" ")
    if command in _COMMANDS:
        return controls.command(*_COMMANDS[command])
    if command == "quit":
        controls.stop(ENDED)
        return ""
    if word == "note" and text:
        return controls.command(EventKind.NOTE, printable(text))
    if command in ("help", "?"):
        return COMMANDS
    raise ControlRefused("{command} is no command; there are {COMMANDS}", repr(command), COMMANDS)


def _in_one_line(text: object) -> str:
    return " ".join(printable(text).split())


class ControlPort:
    """Takes commands of other programs, from ``open`` to ``close``: a line in, an answer out.

    Parameters
    ----------
    where : str
        ``SOCKET``: a unix socket of this user alone in the folder of the run; else ``PORT`` or ``HOST:PORT``.
    token_file : str or None
        File with the token that a client of a port must send first; whoever may command may end the run.
    screen : Screen
        Shows the address.

    Raises
    ------
    ConfigError
        The port is taken, or a token is missing.
    """

    def __init__(self, where: str, token_file: str | None, screen: Screen) -> None:
        self._screen, self._token, self._closing = screen, "", ExitStack()
        self._listening: socket.socket | None = None
        if where != SOCKET:
            address = ListenAddress.parse(where)
            self._token, self._host = read_token(address, token_file, WHAT, commands=True), address.host
            self._listening = self._closing.enter_context(address.listen(WHAT))

    def open(self, controls: Controls, folder: Path) -> int:
        """Begin to take commands, on a socket in ``folder`` where there is no port; the port, or 0."""
        listening, where = self._listening, Message("{folder} (of this user alone)", folder / SOCKET_NAME)
        if listening is None:
            listening, remove = private_socket(folder, SOCKET_NAME, WHAT)
            self._closing.callback(remove)
        server = LineServer(listening, self._token, lambda line: answer(line, controls))
        server.start()
        self._closing.callback(server.close)
        if self._token:
            where = Message("{host}:{port} (with a token)", self._host, server.port)
        self._screen.print(Message("commands are taken at {where}", where))
        return server.port

    def close(self) -> None:
        """Take no more commands; idempotent."""
        self._closing.close()
