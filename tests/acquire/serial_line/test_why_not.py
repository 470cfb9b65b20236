"""Ports that cannot be opened, in words; a TCP connection by value; and ports in a list."""

from __future__ import annotations

import errno
import os
import socket
import termios
import threading
from collections.abc import Iterator

import pytest

from acquire.errors import ConfigError, DeviceError
from acquire.opening import Opening
from acquire.serial_line import byte_ports
from acquire.serial_line import ports as serial_ports
from acquire.serial_line.byte_ports import TcpPort
from acquire.serial_line.ports import (
    LineSettings,
    PortInfo,
    _host_and_port,
    _why,
    check_present,
    open_port,
    ports_line,
)


@pytest.mark.parametrize(
    ("url", "error", "words"),
    [
        (
            "/dev/x",
            OSError(errno.EACCES, "no"),
            "this user may not open it; add yourself to the group that owns",
        ),
        (
            "/dev/x",
            OSError(errno.EAGAIN, "no"),
            "another program has it open (a serial monitor?); close that one",
        ),
        ("/dev/x", OSError("Could not exclusively lock port"), "another program has it open"),
        (
            "socket://h:1",
            OSError(errno.ECONNREFUSED, "no"),
            "nobody answers there (no); check address",
        ),
        ("rfc2217://h:1", TimeoutError("late"), "nobody answers there (late)"),
        ("/dev/x", OSError("odd"), "there is no such port; this machine has no serial port now"),
        ("/dev/null", termios.error("odd"), "cannot be opened (odd); this machine has no serial port now"),
        ("spy://x", OSError("odd"), "cannot be opened (odd)"),
    ],
)
def test_why_a_port_does_not_open(
    url: str, error: Exception, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serial_ports, "list_serial_ports", list)
    monkeypatch.setattr(serial_ports, "group_of", lambda path: "")
    assert _why(url, error).startswith(f"{url}: {words}")
    if error.args[0] == errno.EACCES:
        assert "usermod -aG dialout $USER" in _why(url, error)
        monkeypatch.setattr(serial_ports, "group_of", lambda path: "uucp")
        assert "usermod -aG uucp $USER" in _why(url, error)


def test_ports_in_a_list(monkeypatch: pytest.MonkeyPatch) -> None:
    listed = [PortInfo("/dev/a", "n/a", "", True), PortInfo("/dev/b", "FT232R", "0403:6001:", False)]
    assert [port.text() for port in listed] == [
        "  /dev/a",
        "  /dev/b  FT232R  0403:6001:  (this user may not open it: see docs/load-cells.md)",
    ]
    monkeypatch.setattr(serial_ports, "list_serial_ports", lambda: listed[:1])
    assert ports_line() == "serial ports here: /dev/a"
    check_present("/dev/null")
    check_present("socket://nowhere:1")
    with pytest.raises(DeviceError, match="/dev/nothing: there is no such port; serial ports here: /dev/a"):
        check_present("/dev/nothing")


@pytest.mark.parametrize("url", ["socket://h", "socket://:7", "socket://", "rfc2217://h"])
def test_a_network_needs_a_host_and_a_port(url: str) -> None:
    with pytest.raises(
        ConfigError, match=r"a host and a port are missing; write for example socket://192\.168"
    ):
        open_port(LineSettings(url))


def test_settings_of_pyserial_mean_nothing_to_a_network_and_others_are_refused() -> None:
    assert _host_and_port("socket://host:4001?logging=debug&poll_modem=&ign_set_control") == ("host", 4001)
    with pytest.raises(ConfigError, match="unknown setting 'speed'"):
        open_port(LineSettings("socket://host:4001?speed=5"))
    with pytest.raises(ConfigError, match="socket://host:99999: "):
        open_port(LineSettings("socket://host:99999"))


@pytest.fixture
def ends(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[TcpPort, socket.socket]]:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port = TcpPort("127.0.0.1", listening.getsockname()[1], 0.01)
        end, _ = listening.accept()
        yield port, end
        end.close()
        port.close()


def test_a_connection_gives_what_is_there_up_to_the_limit(ends: tuple[TcpPort, socket.socket]) -> None:
    port, end = ends
    assert port.receive(10) == b"" and port.receive(10, wait=False) == b""
    end.sendall(b"1234567")
    assert port.receive(4) + port.receive(4) == b"1234567"
    port.wake()
    end.sendall(b"8")
    assert port.receive(4) == b"8", "woken, and something has come"
    port.write(b"command")
    assert end.recv(100) == b"command"
    option = port._socket.getsockopt
    assert option(socket.IPPROTO_TCP, socket.TCP_NODELAY) and option(socket.SOL_SOCKET, socket.SO_KEEPALIVE)


def test_a_peer_that_takes_nothing_is_gone(
    ends: tuple[TcpPort, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(byte_ports, "WRITE_S", 0.01)
    with pytest.raises(TimeoutError, match="the other side takes no commands"):
        ends[0].write(bytes(1 << 26))


def test_a_wait_lasts_as_long_as_the_address_says() -> None:
    assert (byte_ports.CONNECT_S, byte_ports.WRITE_S) == (3.0, 0.5)


def test_what_opens_before_it_is_given_up_is_closed_by_that() -> None:
    closed: list[str] = []
    opening = Opening(lambda: "port", closed.append)
    assert opening.done(60)
    opening.abandon()
    assert closed == ["port"]
    opening.abandon()
    assert closed == ["port"]


def test_what_is_taken_is_not_closed_and_an_error_comes_out() -> None:
    closed: list[str] = []
    opening = Opening(lambda: "port", closed.append)
    assert opening.done(60) and opening.take() == "port"
    opening.abandon()
    assert closed == []
    go = threading.Event()

    def fail() -> str:
        go.wait(60)
        raise OSError("gone")

    failing = Opening(fail, closed.append)
    assert not failing.done(0.0)
    go.set()
    assert failing.done(60)
    with pytest.raises(OSError, match="gone"):
        failing.take()


def test_the_line_of_the_kernel_is_set_as_asked() -> None:
    """Speed, bits, parity and stop bits of a pseudo-terminal, as the kernel has them."""
    master, slave = os.openpty()
    port = open_port(LineSettings(os.ttyname(slave), 19200, 7, "E", 2))
    flags, speed = termios.tcgetattr(slave)[2], termios.tcgetattr(slave)[4]
    port.close()
    os.close(master)
    os.close(slave)
    assert speed == termios.B19200
    assert flags & termios.CSTOPB and not flags & termios.PARODD
