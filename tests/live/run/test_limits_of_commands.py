"""Limits in time, letters and clients: of commands, tares, keys, ports and strain outputs."""

from __future__ import annotations

import math
import socket
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.events import Event, EventKind
from live.config.listen_address import ListenAddress
from live.run import strain_output, tcp_lines
from live.run.control import QUEUED, TareControl, answer
from live.run.strain_output import LineFormat, SerialOut, TcpOut, UdpOut, _number, _rounded
from live.run.tcp_lines import MAX_LINE_BYTES, Client
from tests.live.made_up import make_measurement
from tests.live.run.test_control import FakeCell, FakeLive, TareSetup
from tests.live.run.test_keyboard import Typed
from tests.live.run.test_strain_output import readings
from tests.live.run.test_tcp_lines import Caller, server
from tests.live.run.test_tokens import connected


@pytest.mark.parametrize(("letters", "good"), [(500, True), (501, False)])
def test_a_command_has_up_to_500_letters(letters: int, good: bool) -> None:
    live = FakeLive()
    said = answer("note ".ljust(letters, "x"), live)
    assert (said == "ok") is good and len(live.calls) == good
    assert good or said == "no: a command has up to 500 letters"


@pytest.mark.parametrize(("after_s", "done"), [(0.4, False), (0.5, True), (3.0, True), (3.1, False)])
def test_a_tare_is_confirmed_from_half_a_second_to_three_seconds_later(after_s: float, done: bool) -> None:
    bench = TareSetup()
    assert bench.refused().endswith("repeat the command within 3 s to do it")
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
        assert f"{force:g} N in mid-test" in bench.refused()
    assert bench.cell.calls == ["tare"] * at_once


def test_an_answer_to_a_tare_waits_two_seconds() -> None:
    nothing: Any = None
    assert TareControl(FakeCell(None), nothing, nothing, nothing, nothing)._wait_s == 2.0


def test_before_the_first_sample_a_tare_risks_nothing() -> None:
    cell = FakeCell(None)
    TareControl(cell, lambda: True, lambda: None, lambda *_: None, lambda: 0.0, wait_s=0).tare()
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
    assert [(kind, level, text) for kind, level, text in bench.told] == [
        (EventKind.TARE, "info", "tare, forced"), (EventKind.TARE, "info", "undo the last tare"),
    ]  # fmt: skip
    free = TareSetup(0.0)
    free.controls.tare()
    assert free.told == [(EventKind.TARE, "info", "tare")]


@pytest.mark.parametrize(("after_s", "ends"), [(3.0, True), (3.01, False)])
def test_the_second_q_comes_within_three_seconds(after_s: float, ends: bool) -> None:
    typed = Typed()
    typed.type("q")
    typed.now = after_s
    assert len(typed.type("q")) == ends


def test_each_key_is_its_command() -> None:
    keys = {
        "r": (EventKind.NEW_REFERENCE, ""), "t": (EventKind.TARE, ""), "T": (EventKind.TARE, "force"),
        "u": (EventKind.TARE, "undo"), "p": (EventKind.PAUSE, ""), "s": (EventKind.RECORD, "start"),
        "a": (EventKind.ALARM, ""),
    }  # fmt: skip
    for key, call in keys.items():
        typed = Typed()
        assert typed.type(key) == [call] and typed.stream.getvalue() == ""
    typed = Typed()
    typed.type("?")
    assert typed.stream.getvalue().startswith("ok: start, stop, reference")


def test_a_line_that_is_typed_is_shown_and_has_no_letters_that_cannot_be() -> None:
    typed, shown = Typed(), list[str | None]()
    typed.keys._screen.prompt = shown.append  # type: ignore[method-assign]
    typed.type("n", "ab", "\x7f", "\x07", "\x1b")
    assert shown == [": note _", ": note a_", ": note ab_", ": note a_", None]
    typed.type("\x1b")
    assert typed.live.calls == []


def test_at_most_so_many_clients_are_served(monkeypatch: pytest.MonkeyPatch) -> None:
    assert (tcp_lines.MAX_CLIENTS, MAX_LINE_BYTES) == (32, 4096)
    monkeypatch.setattr(tcp_lines, "MAX_CLIENTS", 2)
    with server(greeting="hello") as one:
        callers = [Caller(one.port) for _ in range(2)]
        assert [caller.lines.readline() for caller in callers] == ["hello\n"] * 2
        third = Caller(one.port)
        assert third.lines.readline() == ""
        callers[0].close()
        third.close()
        # Its place is free once the server has seen that it is gone.
        while len(one._clients) == 2:
            pass
        fourth = Caller(one.port)
        assert fourth.lines.readline() == "hello\n"
        fourth.close()
        callers[1].close()
    assert one.served == 3


@pytest.mark.parametrize(("length", "good"), [(MAX_LINE_BYTES, True), (MAX_LINE_BYTES + 1, False)])
@pytest.mark.parametrize("end", [b"", b"\n"])
def test_a_line_of_a_client_has_at_most_so_many_bytes(length: int, good: bool, end: bytes) -> None:
    here, there = connected()
    with there:
        client = Client(here, "a client", "")
        there.sendall(b"x" * length + end)
        there.shutdown(socket.SHUT_WR)
        got: list[str] = []
        words = "closed by the client" if good else "a line without an end"
        with pytest.raises(ConnectionError, match=words):
            while True:
                got += client.receive()
        assert got == (["x" * length] if good and end else [])
        client.close()


class Stalling:
    """A connection that takes so many bytes at each send, then none."""

    def __init__(self, *takes: int) -> None:
        self.takes, self.sent = list(takes), b""

    def send(self, data: bytes) -> int:
        take = self.takes.pop(0) if self.takes else 0
        if not take:
            raise BlockingIOError
        self.sent += data[:take]
        return min(take, len(data))

    def setblocking(self, on: bool) -> None: ...

    def setsockopt(self, *given: int) -> None: ...


def test_the_rest_of_a_line_goes_before_the_next_one_and_whole_lines_are_skipped() -> None:
    connection: Any = Stalling(3, 2, 99, 99, 0, 99)
    client = Client(connection, "a client", "")
    assert client.send(b"abcdef\n"), "begun, so it is taken"
    assert not client.send(b"second\n") and connection.sent == b"abcde"
    assert client.send(b"third\n") and connection.sent == b"abcdef\nthird\n"
    assert not client.send(b"fourth\n")
    assert client.send(b"fifth\n") and connection.sent == b"abcdef\nthird\nfifth\n"
    assert (client.taken, client.skipped) == (3, 2)


def test_a_number_of_a_line() -> None:
    assert [_number(value) for value in (7, 1.23456789012, math.nan, -math.inf)] == [
        "7",
        "1.2345679",
        "nan",
        "-inf",
    ]
    assert [_rounded(value) for value in (7, 1.23456789012, math.nan, math.inf)] == [7, 1.2345679, None, None]
    form = LineFormat(readings(), ("frame", "none", "force_N"), "csv")
    assert form.of(make_measurement(1)) == "8,nan,800"
    assert (
        LineFormat(readings(), ("frame", "none"), "json").of(make_measurement(1)) == '{"frame":8,"none":null}'
    )
    assert LineFormat(readings(), ("frame",), "json").heading == ""


class Port:
    """A serial port that may take nothing."""

    def __init__(self) -> None:
        self.lines: list[bytes] = []
        self.works, self.closed = True, 0

    def write(self, data: bytes) -> None:
        if not self.works:
            raise OSError("gone")
        self.lines.append(data)

    def close(self) -> None:
        self.closed += 1


def test_a_serial_port_is_opened_again_after_a_second_and_what_it_missed_is_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now, port, opened = [100.0], Port(), list[float]()

    def open_port(settings: Any) -> Port:
        opened.append(now[0])
        return port

    monkeypatch.setattr(strain_output, "open_port", open_port)
    monkeypatch.setattr(strain_output, "time", SimpleNamespace(monotonic=lambda: now[0]))
    settings: Any = SimpleNamespace(url="/dev/x")
    out = SerialOut(settings, LineFormat(readings(), ("frame",), "csv"))
    out.send("1")
    out.send("2")
    assert port.lines == [b"frame\n1\n", b"2\n"]
    port.works = False
    out.send("3")
    port.works, now[0] = True, 101.0
    out.send("4")
    now[0] = 101.01
    out.send("5")
    assert port.lines[2:] == [b"5\n"] and opened == [100.0, 101.01]
    assert out.end() == "3 lines, 2 skipped, the port took nothing" and port.closed == 2


def test_a_datagram_that_the_system_refuses_is_counted() -> None:
    out = UdpOut("127.0.0.1", 9, LineFormat(readings(), ("frame",), "json"))
    out._socket.close()
    sent = list[tuple[bytes, Any]]()

    class Refusing:
        def sendto(self, data: bytes, to: Any) -> None:
            if len(sent) == 2:
                raise OSError("no route")
            sent.append((data, to))

        def close(self) -> None: ...

    out._socket = Refusing()  # type: ignore[assignment]
    for number in range(4):
        out.send(f"{number}")
    assert sent == [(b"0\n", ("127.0.0.1", 9)), (b"1\n", ("127.0.0.1", 9))]
    assert out.end() == "2 lines, 2 refused"
    assert out.name == "strain out (udp 127.0.0.1:9)"


def test_what_clients_did_not_read_is_said_at_the_end() -> None:
    out = TcpOut(ListenAddress.parse("0").listen("it"), "", LineFormat(readings(), ("frame",), "json"))
    out._server.skipped, out._server.taken, out._server.served = 3, 5, 2
    assert out.end() == "2 clients, 5 lines, 3 skipped by clients that did not read"


def test_lines_that_are_posted_go_out_in_order_with_the_next_event() -> None:
    sent: list[str] = []
    out = TcpOut(ListenAddress.parse("0").listen("it"), "", LineFormat(readings(), ("frame",), "json"))
    out.send = sent.append  # type: ignore[method-assign]
    out.post("one")
    out.post("two")
    assert sent == []
    for _ in range(2):
        out.event(Event(1.0, EventKind.ALARM, "alarm", "ALARM", "warning"))
    assert sent == ["one", "two"]
    out.end()


@pytest.mark.parametrize(
    ("text", "host", "port"),
    [
        ("0", "127.0.0.1", 0), ("1024", "127.0.0.1", 1024), ("localhost:65535", "127.0.0.1", 65535),
        ("0.0.0.0:5000", "0.0.0.0", 5000),
    ],
)  # fmt: skip
def test_addresses_that_can_be_listened_at(text: str, host: str, port: int) -> None:
    found = ListenAddress.parse(text)
    assert (found.host, found.port) == (host, port)
