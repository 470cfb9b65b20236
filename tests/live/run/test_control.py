"""Commands and their answers: the grammar, the TCP port, and tare, which is never done by one key under load."""

from __future__ import annotations

import io
import math
import stat
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.errors import ConfigError
from acquire.events import Event, EventKind, Level
from acquire.load_sample import LoadCellInfo, LoadSample
from live.config.listen_address import SOCKET
from live.run.control import (
    ENDED,
    FORCED,
    ONCE,
    QUEUED,
    SOCKET_NAME,
    START,
    STOP,
    UNDO,
    ControlPort,
    ControlRefused,
    TareControl,
    answer,
)
from live.ui.terminal.screen import TerminalScreen
from tests.live.run.test_tcp_lines import WORD, Caller


class FakeLive:
    """Notes its commands; refuses with the reason ``refuses``."""

    def __init__(self, refuses: str = "", says: str = "") -> None:
        self.calls: list[Any] = []
        self.paused, self.recording = False, True
        self._refuses, self._says = refuses, says

    def stop(self, reason: str) -> None:
        self.calls.append(("stop", reason))

    def command(self, kind: EventKind, note: str = "") -> str:
        if self._refuses:
            raise ControlRefused(self._refuses)
        self.paused = kind is EventKind.PAUSE
        self.calls.append((kind, note))
        return self._says


@pytest.mark.parametrize(
    ("lines", "call"),
    [
        (("start", "s"), (EventKind.RECORD, START)),
        (("stop",), (EventKind.RECORD, STOP)),
        (("reference", "r\n", " r "), (EventKind.NEW_REFERENCE, "")),
        (("tare", "t"), (EventKind.TARE, "")),
        (("tare  force", "t!", "t force"), (EventKind.TARE, FORCED)),
        (("tare undo", "u"), (EventKind.TARE, UNDO)),
        (("pause", "p"), (EventKind.PAUSE, "")),
        (("resume",), (EventKind.RESUME, "")),
        (("note slipped in the grip", "n slipped in the grip\r\n"), (EventKind.NOTE, "slipped in the grip")),
        (("alarm off", "a"), (EventKind.ALARM, "")),
        (("quit", "q"), ("stop", ENDED)),
    ],
)
def test_words_and_their_letters(lines: tuple[str, ...], call: tuple[Any, str]) -> None:
    for line in lines:
        live = FakeLive()
        assert answer(line, live) == "ok"
        assert live.calls == [call]


def test_a_second_p_goes_on() -> None:
    live = FakeLive()
    for _ in range(3):
        answer("p", live)
    assert [call[0] for call in live.calls] == [EventKind.PAUSE, EventKind.RESUME, EventKind.PAUSE]


@pytest.mark.parametrize("line", ["", "\n", "x", "n", "note", "stop it", "quit now", "alarm", "tare twice"])
def test_what_is_no_order_is_refused_with_a_reason(line: str) -> None:
    live = FakeLive()
    assert answer(line, live).startswith("no: ")
    assert live.calls == []


def test_whoever_carries_it_out_may_refuse_or_say_more() -> None:
    assert answer("tare", FakeLive(refuses="800 N in\nmid-test")) == "no: 800 N in mid-test"
    assert answer("stop", FakeLive(says="120 frames")) == "ok: 120 frames"


def test_help_lists_the_orders() -> None:
    said = answer("?", FakeLive())
    assert said.startswith("ok: ") and "alarm off" in said and said == answer("help", FakeLive())


@given(st.text())
def test_whatever_comes_is_answered_in_one_printable_line(line: str) -> None:
    said = answer(line, FakeLive())
    assert said.startswith(("ok", "no: ")) and said.splitlines() == [said]


def test_a_note_cannot_command_a_terminal() -> None:
    live = FakeLive()
    answer("note \x1b[2Jgone", live)
    assert live.calls == [(EventKind.NOTE, "\\x1b[2Jgone")]


def test_orders_are_carried_out_and_answered_on_a_socket_of_this_user_alone(tmp_path: Path) -> None:
    live, said = FakeLive(), io.StringIO()
    port = ControlPort(SOCKET, None, TerminalScreen(said))
    assert port.open(live, tmp_path) == 0
    where = tmp_path / SOCKET_NAME
    assert stat.filemode(where.stat().st_mode) == "srw-------"
    caller = Caller(where)
    asked = [caller.ask(line) for line in ("pause", "note slipped", "nonsense", "quit")]
    assert asked[:2] == ["ok", "ok"] and asked[2].startswith("no: ") and asked[3] == "ok"
    assert live.calls == [(EventKind.PAUSE, ""), (EventKind.NOTE, "slipped"), ("stop", ENDED)]
    assert f"commands are taken at {where} (of this user alone)" in said.getvalue()
    caller.close()
    port.close()
    port.close()
    assert not where.exists()


def test_the_socket_goes_with_its_folder_and_is_removed_there(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    port = ControlPort(SOCKET, None, TerminalScreen(quiet=True))
    port.open(FakeLive(), tmp_path / "run")
    (tmp_path / "run").rename(tmp_path / "elsewhere")
    caller = Caller(tmp_path / "elsewhere" / SOCKET_NAME)
    assert caller.ask("pause") == "ok"
    caller.close()
    port.close()
    assert not list(tmp_path.glob("*/*"))


def test_a_folder_that_takes_no_socket_is_named(tmp_path: Path) -> None:
    folder = tmp_path / ("long" * 40)
    folder.mkdir()
    for place in (folder, tmp_path):
        (place / SOCKET_NAME).touch()
        port = ControlPort(SOCKET, None, TerminalScreen(quiet=True))
        with pytest.raises(
            ConfigError, match=r"the port for commands: .* cannot be made .*choose another --out"
        ):
            port.open(FakeLive(), place)
        port.close()


def test_a_port_takes_commands_with_a_token_only() -> None:
    with pytest.raises(ConfigError, match=r"every user can reach .*token_file"):
        ControlPort("0", None, TerminalScreen(quiet=True))


def test_beyond_this_machine_only_with_a_token(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="token_file"):
        ControlPort("0.0.0.0:0", None, TerminalScreen(io.StringIO()))
    path = tmp_path / "token"
    path.touch(0o600)
    path.write_text(WORD)
    live = FakeLive()
    port = ControlPort("0.0.0.0:0", str(path), TerminalScreen(io.StringIO()))
    number = port.open(live, tmp_path)
    wrong = Caller(number)
    assert wrong.ask("quit").startswith("no: ")
    wrong.close()
    caller = Caller(number)
    assert [caller.ask(f"token {WORD}"), caller.ask("quit")] == ["ok", "ok"]
    assert live.calls == [("stop", ENDED)]
    caller.close()
    port.close()


def tared(text: str, source: str = "/dev/x", kind: EventKind = EventKind.TARE, **data: Any) -> Event:
    return Event(10.0, kind, source, text, "info", data)


class FakeCell:
    """Notes what it is asked, and answers with the events ``says``."""

    def __init__(self, capacity_N: float | None, protocol: str = "ascii") -> None:
        self.info = LoadCellInfo("/dev/x", "a cell", protocol, capacity_N=capacity_N)
        self.calls: list[str] = []
        self.says: list[Event] = []
        self.listeners: list[Callable[[Event], None]] = []

    def tare(self, *, force: bool = False) -> None:
        self._called("forced" if force else "tare")

    def undo_tare(self) -> None:
        self._called("undo")

    def _called(self, what: str) -> None:
        self.calls.append(what)
        for event in self.says:
            for listener in self.listeners:
                listener(event)


class TareSetup:
    """Tare commands on a cell with a force; ``measured``: whether the test has begun."""

    def __init__(
        self, force: float = 800.0, *, measured: bool = True, capacity_N: float | None = None
    ) -> None:
        self.now, self.cell, self.told = 10.0, FakeCell(capacity_N), list[tuple[EventKind, Level, str]]()
        self.has_measured, self.latest_load = measured, LoadSample(10.0, force)
        self.controls = TareControl(self.cell, self, lambda: self.now, wait_s=0)
        self.cell.listeners.append(self.controls.take_event)

    def emit(self, kind: EventKind, source: str, text: str, level: Level) -> None:
        self.told.append((kind, level, text))

    def refused(self) -> str:
        """The reason why a tare command is refused."""
        with pytest.raises(ControlRefused) as refused:
            self.controls.tare()
        return str(refused.value)


def test_a_third_order_asks_again() -> None:
    bench = TareSetup()
    bench.refused()
    bench.now += 1.0
    bench.controls.tare()
    bench.refused()
    assert bench.cell.calls == ["tare"]


def test_a_key_that_is_held_or_bounces_is_no_confirmation() -> None:
    bench = TareSetup()
    for _ in range(40):
        bench.refused()
        bench.now += 0.1
    assert bench.cell.calls == []
    bench.now += 0.5
    bench.controls.tare()
    assert bench.cell.calls == ["tare"]


def test_a_tare_once_is_never_the_confirmation_of_another() -> None:
    bench = TareSetup()
    for _ in range(3):
        with pytest.raises(ControlRefused, match=r"800 N in mid-test: .*; confirm it$"):
            bench.controls.tare(ONCE)
        bench.now += 1.0
    assert bench.cell.calls == []
    free = TareSetup(0.0)
    free.controls.tare(ONCE)
    assert free.cell.calls == ["tare"]


def test_before_the_test_one_order_is_enough() -> None:
    bench = TareSetup(measured=False)
    bench.controls.tare()
    assert bench.cell.calls == ["tare"]


def test_a_load_that_is_not_known_is_not_none() -> None:
    bench = TareSetup(math.nan)
    assert "an unknown load" in bench.refused() and bench.cell.calls == []


def test_without_a_load_cell_there_is_nothing_to_tare() -> None:
    bench = TareSetup()
    bench.cell = FakeCell(None, "none")
    bench.controls = TareControl(bench.cell, bench, lambda: bench.now)
    assert "no load cell" in bench.refused()


def test_the_answer_is_what_the_cell_did() -> None:
    bench = TareSetup(measured=False)
    bench.cell.says = [
        tared("device: no sample for 1 s", kind=EventKind.DEVICE),
        tared("tared: 8 N is zero now"),
    ]
    assert bench.controls.tare() == "tared: 8 N is zero now"
    bench.cell.says = [tared("not tared: the load moves", kind=EventKind.DEVICE, tared=False)]
    assert bench.refused() == "not tared: the load moves"


def test_a_tare_that_is_not_done_yet_is_queued() -> None:
    bench = TareSetup(measured=False)
    bench.controls.take_event(tared("an earlier one"))
    bench.cell.says = [tared("tare", source="operator")]
    assert bench.controls.tare().startswith("queued; ")


def test_an_undoing_is_no_confirmation() -> None:
    bench = TareSetup()
    bench.refused()
    bench.controls.tare(UNDO)
    bench.refused()
    assert bench.cell.calls == ["undo"]


@pytest.mark.parametrize(("letters", "good"), [(500, True), (501, False)])
def test_a_command_has_up_to_500_letters(letters: int, good: bool) -> None:
    live = FakeLive()
    said = answer("note ".ljust(letters, "x"), live)
    assert (said == "ok") is good and len(live.calls) == good
    assert good or said == "no: a command has up to 500 letters"


@pytest.mark.parametrize(("after_s", "done"), [(0.4, False), (0.5, True), (3.0, True), (3.1, False)])
def test_a_tare_is_confirmed_from_half_a_second_to_three_seconds_later(after_s: float, done: bool) -> None:
    bench = TareSetup()
    assert bench.refused().endswith("repeat the command within 3 s to do it") and not bench.told
    bench.now = 10.0 + after_s
    if done:
        assert bench.controls.tare() == QUEUED
    else:
        bench.refused()
    assert bench.cell.calls == ["tare"] * done


@pytest.mark.parametrize(("force", "at_once"), [(1.0, True), (-1.0, True), (1.01, False), (-1.01, False)])
def test_a_thousandth_of_the_capacity_is_no_load(force: float, at_once: bool) -> None:
    bench = TareSetup(force, capacity_N=1000.0)
    if at_once:
        bench.controls.tare()
    else:
        assert f"{force:g}".replace("-", "−") + " N in mid-test" in bench.refused()
    assert bench.cell.calls == ["tare"] * at_once


def test_an_answer_to_a_tare_waits_two_seconds() -> None:
    nothing: Any = None
    assert TareControl(FakeCell(None), nothing, nothing)._wait_s == 2.0


def test_before_the_first_sample_a_tare_risks_nothing() -> None:
    cell = FakeCell(None)
    test: Any = SimpleNamespace(has_measured=True, latest_load=None, emit=lambda *_: None)
    TareControl(cell, test, lambda: 0.0, wait_s=0).tare()
    assert cell.calls == ["tare"]


def test_an_answer_of_another_cell_is_none_of_this_one() -> None:
    bench = TareSetup(measured=False)
    bench.cell.says = [Event(10.0, EventKind.TARE, "/dev/y", "tared: 8 N", "info", {})]
    assert bench.controls.tare() == QUEUED
    bench.cell.says = [Event(10.0, EventKind.DEVICE, "/dev/x", "it did", "info", {"tared": True})]
    assert bench.controls.tare() == QUEUED


def test_a_forced_tare_is_told_as_one() -> None:
    bench = TareSetup()
    bench.controls.tare("force")
    bench.controls.tare("undo")
    assert bench.cell.calls == ["forced", "undo"]
    assert [(kind, level, text) for kind, level, text in bench.told] == [
        (EventKind.TARE, "info", "tare, forced"), (EventKind.TARE, "info", "undo the last tare"),
    ]  # fmt: skip
    free = TareSetup(0.0)
    free.controls.tare()
    assert free.told == [(EventKind.TARE, "info", "tare")]
