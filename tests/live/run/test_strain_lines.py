"""Lines of strain output by value: numbers, and what was skipped or refused."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.events import Event, EventKind
from live.config.listen_address import ListenAddress
from live.run import strain_output
from live.run.strain_output import LineFormat, SerialOut, TcpOut, UdpOut, _number, _rounded
from tests.live.made_up import make_measurement
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
