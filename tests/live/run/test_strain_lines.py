"""Lines of strain output by value: numbers, and what was skipped or refused."""

from __future__ import annotations

import json
import math
import socket
from functools import partial
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.events import Event, EventKind
from acquire.load_sample import LoadSample
from live.commands.consumers import _emit
from live.config.listen_address import ListenAddress
from live.config.sections import SpecimenConfig
from live.pipeline.consumer import ConsumerReport
from live.pipeline.run_state import RunState
from live.pipeline.snapshot import ChannelValues
from live.run import strain_output
from live.run.strain_output import MISSED, LineFormat, SerialOut, TcpOut, UdpOut, _number, _rounded
from live.run.tcp_lines import Client
from live.ui.terminal.summary import trouble_lines
from tests.live.made_up import START, make_measurement
from tests.live.run.test_strain_output import readings


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
    out.send = lambda line: not sent.append(line)  # type: ignore
    out.post("one")
    out.post("two")
    assert sent == []
    for _ in range(2):
        out.event(Event(1.0, EventKind.ALARM, "alarm", "ALARM", "warning"))
    assert sent == ["one", "two"]
    out.end()


def test_who_reads_an_output_is_said() -> None:
    lines = LineFormat(readings(), ("frame",), "json")
    outs = [
        TcpOut(ListenAddress.parse("0").listen("it"), token, lines) for token in ("", "a-word-of-sixteen")
    ]
    outs += [UdpOut("127.0.0.1", 9, lines)]  # type: ignore[list-item]
    assert [out.to_whom for out in outs] == [
        "to every user of this machine", "to programs with the token", "to whoever listens there, unencrypted",
    ]  # fmt: skip
    for out in outs:
        out.end()


def test_a_reader_that_misses_lines_is_an_error_until_all_come_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is an event, once, and a mark in the summary of a test."""
    now, arrives, state = [100.0], [True], RunState.new(1.0)
    monkeypatch.setattr(strain_output, "time", SimpleNamespace(monotonic=lambda: now[0]))
    out = UdpOut("127.0.0.1", 9, LineFormat(readings(), ("frame",), "json"))
    out.tell = partial(_emit, state, out.name)
    out.send = lambda line: arrives[0]  # type: ignore[method-assign]
    for t, good, errors, faults in (
        (100.0, True, 0, 0), (101.0, False, 1, 1), (102.0, True, 1, 1), (104.0, False, 1, 1), (109.0, True, 1, 1),
        (109.5, True, 1, 0), (110.0, True, 1, 0), (120.0, False, 2, 1),
    ):  # fmt: skip
        now[0], arrives[0] = t, good
        out.measurement(make_measurement(1))
        found = state.event_log.events("error")
        assert (len(found), len(state.faults.texts)) == (errors, faults), t
        assert all(event.text == MISSED and event.source == out.name for event in found)
    assert [event.text for event in state.event_log.events("info")] == ["all lines are read again"]
    report = ConsumerReport(out.name, summary=out.end(), lost=out.lost)
    assert any(line.startswith("  strain out") for line in trouble_lines(state, [report]))
    assert not any(
        line.startswith("  strain out") for line in trouble_lines(state, [ConsumerReport(out.name)])
    )


def test_each_output_says_what_did_not_arrive() -> None:
    here, there = socket.socketpair()
    with there:
        out = TcpOut(ListenAddress.parse("0").listen("it"), "", LineFormat(readings(), ("frame",), "json"))
        assert out.send("nobody is there")
        client = Client(here, "a client", "")
        out._server._clients[0] = client
        assert out.send("x" * 100)
        while out.send("x" * 100_000):
            pass
        assert client.skipped == 1 and not out.send("more")
        out._server._clients.clear()
        client.close()
        out.end()


class Clocked:
    """The lines of a live test at its own time, and the times at which an output sends."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = START
        self.state = RunState.new(1.0, specimen=SpecimenConfig(axis="y"))
        self.state.health.state = "REC"
        self.sent: list[tuple[float, dict[str, Any]]] = []
        values = ChannelValues(START, self.state, clock=lambda: self.now)
        channels = ("time_s", "frame", "axial", "age_s", "state", "force_N", "lost_share", "eyy")
        monkeypatch.setattr(strain_output, "time", SimpleNamespace(monotonic=lambda: self.now))
        self.out = UdpOut("127.0.0.1", 9, LineFormat(values, channels, "json"))
        self.out.send = lambda line: not self.sent.append((self.now, json.loads(line)))  # type: ignore

    def measure(self, number: int, strain: float) -> None:
        m = make_measurement(number, strain)
        self.state.history.add(m.time_step)
        self.out.measurement(m)

    def until(self, t: float) -> None:
        """As the consumer's thread does, with wake-ups that are 50 ms late."""
        while (then := self.now + self.out.idle() + 0.05) < t:
            self.now = then
        self.now = t


def test_a_heartbeat_repeats_the_last_measurement_with_its_age(monkeypatch: pytest.MonkeyPatch) -> None:
    test = Clocked(monkeypatch)
    test.state.loads.append(LoadSample(START, 800.0))
    test.until(START + 1.0)
    assert {line["axial"] for _, line in test.sent} == {None} and len(test.sent) >= 3
    test.sent.clear()
    test.measure(10, 1e-3)
    test.until(START + 1.3)
    test.state.loads.append(LoadSample(START + 1.3, 900.0))
    test.until(START + 2.5)
    first = test.sent[0][1]
    for at, line in test.sent:
        repeated = {name: line[name] for name in ("time_s", "frame", "axial", "lost_share", "eyy")}
        assert repeated == {name: first[name] for name in repeated} and line["axial"] == 1e-3
        assert line["age_s"] == pytest.approx(at - START - first["time_s"])
        assert line["force_N"] == (800.0 if at <= START + 1.3 else 900.0)
    test.sent.clear()
    test.until(START + 5.0)
    assert test.sent[-1][1]["axial"] is None and test.sent[-1][1]["frame"] is None
    assert test.sent[-1][1]["state"] == "old" and test.sent[-1][1]["age_s"] > 2
    test.out.end()


def test_a_line_comes_at_least_every_half_second(monkeypatch: pytest.MonkeyPatch) -> None:
    test = Clocked(monkeypatch)
    for k in range(1, 8):
        test.measure(4 * k, 1e-3)
        test.until(START + 0.4 + 0.7 * k)
    times = [at for at, _ in test.sent]
    assert max(later - earlier for earlier, later in pairwise(times)) <= 0.5
    test.out.end()


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
