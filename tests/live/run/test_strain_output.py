"""Strain output to real clients (TCP, UDP, serial), also when one stalls; and the controller of the examples."""

from __future__ import annotations

import csv
import json
import math
import socket
import threading
import time
from functools import partial
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.errors import ConfigError
from acquire.events import Event, EventKind
from acquire.load_sample import LoadSample
from acquire.serial_line.ports import LineSettings
from examples.strain_rate import main
from hw_mocks.indicator_server import PtyPort
from hw_mocks.machine import ELASTIC_SHARE, Machine
from live.commands.consumers import _emit
from live.config.figures import DEFAULT_CHANNELS
from live.config.listen_address import ListenAddress
from live.config.loading import load_config
from live.config.sections import SpecimenConfig
from live.pipeline.consumer import ConsumerReport
from live.pipeline.run_state import RunState
from live.pipeline.snapshot import ChannelValues
from live.run import strain_output
from live.run.alarms import check_alarms
from live.run.strain_output import MISSED, LineFormat, SerialOut, TcpOut, UdpOut, _number, _rounded
from live.run.tcp_lines import Client
from live.ui.terminal.summary import trouble_lines
from tests.live.made_up import START, make_measurement
from tests.live.run.test_tcp_lines import Caller
from tests.live.test_end_to_end import SIM, live_run
from tests.live.ui.waiting import LONG_S

CHANNELS = ("time_s", "frame", "axial", "force_N", "stress_MPa", "lost_share", "latency_s")


def readings(force: float = 800.0) -> ChannelValues:
    run_state = RunState.new(1.0, specimen=SpecimenConfig(axis="y", area_mm2=40.0))
    run_state.health.state = "REC"
    run_state.loads.append(LoadSample(START, force))
    return ChannelValues(START, run_state, clock=lambda: START + 0.5)


def test_a_measurement_as_json_and_as_csv() -> None:
    m = make_measurement(2, 1.5e-3)
    said = json.loads(LineFormat(readings(), CHANNELS, "json").of(m))
    assert list(said) == list(CHANNELS)
    assert said["axial"] == pytest.approx(1.5e-3) and said["force_N"] == 800.0
    assert said["stress_MPa"] == pytest.approx(20.0) and said["time_s"] == pytest.approx(0.2)
    assert said["frame"] == 16 and said["latency_s"] is None
    assert 0 < said["lost_share"] < 0.1
    lines = LineFormat(readings(), CHANNELS, "csv")
    assert lines.heading == ",".join(CHANNELS)
    row = dict(zip(CHANNELS, lines.of(m).split(","), strict=True))
    assert row["axial"] == "0.0015" and row["frame"] == "16" and row["latency_s"] == "nan"


def test_front_and_back_need_two_cameras() -> None:
    config = load_config(
        None, {"strain_out.channels": ["axial", "mean_gauge_left"], "gauges.left": {"at": [9, 9]}}
    )
    check_alarms(config, both_sides=True)
    with pytest.raises(ConfigError, match=r"mean_gauge_left needs a camera on each side: give --back"):
        check_alarms(config)


def test_the_channels_without_a_choice_are_those_of_the_page() -> None:
    page = (Path(__file__).parents[3] / "docs" / "control.md").read_text(encoding="utf-8")
    listed = ", ".join(f"`{name}`" for name in DEFAULT_CHANNELS)
    assert "strain_rate" in DEFAULT_CHANNELS
    assert f"{listed} and all gauges" in " ".join(page.split())


def test_to_any_number_of_clients() -> None:
    out = TcpOut(ListenAddress.parse("0").listen("it"), "", LineFormat(readings(), ("frame", "axial"), "csv"))
    out.begin()
    clients = [Caller(out.port) for _ in range(3)]
    assert {client.lines.readline() for client in clients} == {"frame,axial\n"}
    for k in range(4):
        out.measurement(make_measurement(k, 1e-3 * k))
    out.post("HALT")
    out.event(Event(1.0, EventKind.ALARM, "alarm", "ALARM", "warning"))
    for client in clients:
        lines = [client.lines.readline() for _ in range(5)]
        assert lines == ["0,0\n", "8,0.001\n", "16,0.002\n", "24,0.003\n", "HALT\n"]
        client.close()
    assert out.end() == "3 clients, 18 lines"


def test_by_udp() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(LONG_S)
        out = UdpOut("127.0.0.1", listener.getsockname()[1], LineFormat(readings(), ("frame",), "json"))
        out.measurement(make_measurement(1))
        assert listener.recv(100) == b'{"frame":8}\n'
    for _ in range(3):
        out.measurement(make_measurement(1))  # nobody listens any more: counted, never raised
    assert out.end().startswith(("1 lines", "2 lines", "3 lines", "4 lines"))


def test_to_a_serial_port_that_is_pulled_out_and_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("live.run.strain_output.REOPEN_S", 0.0)
    port = PtyPort()
    out = SerialOut(LineSettings(port.path, 115200), LineFormat(readings(), ("frame", "axial"), "csv"))
    out.measurement(make_measurement(1))
    out.measurement(make_measurement(2))
    assert read(port, 3) == ["frame,axial", "8,0.001", "16,0.001"]
    port.unplug()
    for _ in range(3):
        out.measurement(make_measurement(3))
    port.plug()
    out.measurement(make_measurement(4))
    assert read(port, 1)[-1] == "32,0.001"
    assert "skipped" in out.end()
    port.close()


def read(port: PtyPort, lines: int) -> list[str]:
    got, until = b"", time.monotonic() + LONG_S
    while got.count(b"\n") < lines and time.monotonic() < until:
        got += port.read(0.1)
    return got.decode().splitlines()


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"strain_out.channels": ["axial", "load"]}, "unknown channel 'load'"),
        ({"strain_out.channels": ["disk_min"]}, "unknown channel"),
        ({"strain_out.tcp": "80"}, "1024"),
        ({"strain_out.format": "xml"}, "'json'"),
    ],
)
def test_what_cannot_be_told(settings: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        load_config(None, settings)


class Listener(threading.Thread):
    """A client that notes when each line came."""

    def __init__(self, port: int) -> None:
        super().__init__(daemon=True)
        self.caller, self.got = Caller(port), list[tuple[float, dict[str, Any]]]()
        self.start()

    def run(self) -> None:
        for line in self.caller.lines:
            self.got.append((time.monotonic(), json.loads(line)))
        self.caller.close()


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@pytest.mark.timed
def test_from_the_result_to_the_read_of_the_client(tmp_path: Path) -> None:
    """In real time, with a client that reads, and one that does not: the first feels nothing of the second.

    Counted from the result, which a busy machine has later.
    """
    port, listeners, results = free_port(), list[Any](), dict[int, float]()

    def note(live: Any, m: Any) -> None:
        results[m.burst.first_index] = m.t + m.burst.duration / 2 + m.time_step.latency_s
        if not listeners:
            listeners.extend([Listener(port), Caller(port, receive_buffer=2048)])

    real = "sim:uniform?seconds=3&fps=20&width=224&height=192&bits=12"
    outcome = live_run(tmp_path / "run", real, each=note, **{"measure.burst": 1, "strain_out.tcp": str(port)})
    good, stalled = listeners
    good.join(LONG_S)
    stalled.close()
    late = [at - results[said["frame"]] for at, said in good.got]
    assert len(late) > 0.9 * len(results) > 20
    assert np.percentile(late, 95) < 0.3 and min(late) > 0
    (report,) = [r for r in outcome.outputs.reports if r.name.startswith("strain out")]
    assert report.summary.startswith("2 clients") and not report.failed


@pytest.mark.timed
def test_the_table_can_be_followed_while_the_test_runs(tmp_path: Path) -> None:
    """Without a load to wait for, a row appears within one measurement."""
    rows: list[int] = []

    def count(live: Any, m: Any) -> None:
        path = tmp_path / "run" / "strain.csv"
        until = time.monotonic() + 2
        while m.number and time.monotonic() < until:
            with path.open() as file:
                there = sum(1 for _ in csv.reader(file)) - 1
            if there >= m.number:
                break
        rows.append(there if m.number else 0)

    live_run(tmp_path / "run", SIM, each=count, **{"load.address": "none:"})
    assert len(rows) > 10 and all(there >= number for number, there in enumerate(rows))


RATE, UNTIL = 5e-4, 4e-3


@pytest.mark.slow
@pytest.mark.timed
def test_the_strain_rate_is_held_through_yield(tmp_path: Path) -> None:
    """Within the 20 % of ISO 6892-1 over a second, where the machine alone would be 40 % off."""
    outcome = main(str(tmp_path / "run"), RATE, UNTIL)
    assert outcome.exit_code == 0
    late = [e.text for e in outcome.run_state.event_log.events() if "another program takes" in e.text]
    if late:  # a program that is late by itself fails
        pytest.skip(f"this machine is too busy for the control of a rate: {late[0]}")
    time_steps, specimen = outcome.run_state.history.time_steps, outcome.rig.specimen
    assert specimen is not None
    times = np.array([specimen.elapsed(time_step.t) for time_step in time_steps])
    truth = specimen.axial_strain(times)
    assert UNTIL < truth[-1] < UNTIL + 1e-3
    pulled = times[truth > 2e-4]
    grid = np.arange(pulled[0] + 1.0, pulled[-1] - 1.0, 0.25)
    rates = specimen.axial_strain(grid + 1.0) - specimen.axial_strain(grid)
    settled = (specimen.axial_strain(grid) > 2.6e-3) | (specimen.axial_strain(grid + 1.0) < 2e-3)
    assert np.abs(rates[settled] / RATE - 1).max() < 0.2
    assert np.abs(rates / RATE - 1).max() < 0.6
    notes = [e.text for e in outcome.run_state.event_log.events() if e.kind is EventKind.NOTE]
    assert notes == ["strain rate 0.0005 1/s"]


def test_the_machine_is_soft_until_yield_and_only_pulls() -> None:
    now = [0.0]
    machine = Machine(0, 1e-3, lambda t: t, lambda: now[0])
    machine.drive(1e-3)
    now[0] = 1.0
    machine.drive(-5.0)
    assert machine.strain(0.5) == 0.5e-3 * ELASTIC_SHARE and machine.strain(3.0) == 1e-3 * ELASTIC_SHARE
    now[0] = 4.0
    machine.drive(1e-3)
    left = (1e-3 - 1e-3 * ELASTIC_SHARE) / (1e-3 * ELASTIC_SHARE)
    np.testing.assert_allclose(machine.strain([4 + left, 5 + left, 0.0, -1.0]), [1e-3, 2e-3, 0.0, 0.0])


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
