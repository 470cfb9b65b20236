"""Serial ports: their list and identity, opening one, why one does not open, and the time of a byte."""

from __future__ import annotations

import contextlib
import errno
import os
import pty
import termios
import tty
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from acquire.errors import ConfigError, DeviceError
from acquire.serial_line import ports as serial_ports
from acquire.serial_line.ports import (
    LineSettings,
    PortInfo,
    _host_and_port,
    _why,
    check_present,
    find_again,
    identity_of,
    list_serial_ports,
    open_port,
    ports_line,
)


@dataclass(order=True)
class Listed:
    """As pyserial lists a port."""

    device: str
    description: str = "n/a"
    vid: int | None = None
    pid: int | None = None
    serial_number: str | None = None


@pytest.fixture
def listed(monkeypatch: pytest.MonkeyPatch) -> list[Listed]:
    from serial.tools import list_ports

    ports = [
        Listed("/dev/ttyS0"),
        Listed("/dev/ttyUSB1", "FT232R", 0x0403, 0x6001, "A1"),
        Listed("/dev/ttyACM0", "Uno", 0x2341, 0x43, None),
    ]
    monkeypatch.setattr(list_ports, "comports", lambda: list(ports))
    monkeypatch.setattr(serial_ports.os, "access", lambda path, mode: path != "/dev/ttyS0")
    return ports


def test_the_list(listed: list[Listed]) -> None:
    assert list_serial_ports() == [
        PortInfo("/dev/ttyACM0", "Uno", "2341:0043:", True),
        PortInfo("/dev/ttyS0", "n/a", "", False),
        PortInfo("/dev/ttyUSB1", "FT232R", "0403:6001:A1", True),
    ]
    assert [port.text() for port in list_serial_ports()] == [
        "  /dev/ttyACM0  Uno  2341:0043:",
        "  /dev/ttyS0  (this user may not open it: see docs/load-cells.md)",
        "  /dev/ttyUSB1  FT232R  0403:6001:A1",
    ]
    del listed[1:]
    assert ports_line().startswith("serial ports here: /dev/ttyS0")
    check_present("/dev/null")
    check_present("socket://nowhere:1")
    with pytest.raises(
        DeviceError, match="/dev/nothing: there is no such port; serial ports here: /dev/ttyS0"
    ):
        check_present("/dev/nothing")


def test_a_device_is_found_under_its_new_name_unless_two_are_alike(listed: list[Listed]) -> None:
    identity = identity_of("/dev/ttyUSB1")
    listed[1] = Listed("/dev/ttyUSB7", "FT232R", 0x0403, 0x6001, "A1")
    assert find_again("/dev/ttyUSB1", identity) == "/dev/ttyUSB7"
    assert find_again("/dev/ttyS0", "") == "/dev/ttyS0"
    listed.append(Listed("/dev/ttyACM1", "Uno", 0x2341, 0x43, None))
    assert find_again("/dev/ttyACM9", "2341:0043:") == "/dev/ttyACM9"


@pytest.mark.parametrize(
    ("url", "error", "words"),
    [
        (
            "/dev/x",
            OSError(errno.EACCES, "no"),
            "this user may not open it; add yourself to the group that owns it (sudo usermod -aG dialout $USER)",
        ),
        (
            "/dev/x",
            OSError(errno.EAGAIN, "no"),
            "another program has it open (a serial monitor?); close that one",
        ),
        ("/dev/x", OSError(errno.EBUSY, "busy"), "another program has it open"),
        ("/dev/x", OSError("Could not exclusively lock port"), "another program has it open"),
        ("socket://h:1", OSError(errno.ECONNREFUSED, "no"), "nobody answers there (no); check address"),
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
    monkeypatch.setattr(serial_ports, "group_of", lambda path: "uucp")
    assert error.args[0] != errno.EACCES or "usermod -aG uucp $USER" in _why(url, error)


def test_a_port_that_pyserial_refuses_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    import serial

    def refuse(*args: object, **keys: object) -> None:
        raise OSError(errno.ENOENT, "gone")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(DeviceError, match="/dev/ttyNONE: there is no such port"):
        open_port(LineSettings("/dev/ttyNONE"))


NO_PORT = r"a host and a port are missing; write for example socket://192\.168"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        *((LineSettings(url), NO_PORT) for url in ("socket://h", "socket://:7", "socket://", "rfc2217://h")),
        (LineSettings("socket://host:4001?speed=5"), "unknown setting 'speed'"),
        (LineSettings("socket://host:99999"), "socket://host:99999: "),
        (LineSettings("loop://", bytesize=9), "loop://: "),
    ],
    ids=str,
)
def test_an_impossible_port_is_a_matter_of_configuration(line: LineSettings, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        open_port(line)


def test_settings_of_pyserial_mean_nothing_to_a_network() -> None:
    assert _host_and_port("socket://host:4001?logging=debug&poll_modem=&ign_set_control") == ("host", 4001)


@pytest.fixture
def terminal() -> Iterator[tuple[int, int, str]]:
    """A pseudo-terminal: both its ends, and the name of the second."""
    master, slave = pty.openpty()
    yield master, slave, os.ttyname(slave)
    os.close(master)
    os.close(slave)


def test_the_line_of_the_kernel_is_set_as_asked_and_the_port_is_ours_alone(
    terminal: tuple[int, int, str],
) -> None:
    """Speed, bits, parity and stop bits of a pseudo-terminal, as the kernel has them."""
    _, slave, name = terminal
    port = open_port(LineSettings(name, 19200, 7, "E", 2))
    flags, speed = termios.tcgetattr(slave)[2], termios.tcgetattr(slave)[4]
    with pytest.raises(DeviceError, match="another program"):
        open_port(LineSettings(name))
    port.close()
    assert speed == termios.B19200
    assert flags & termios.CSTOPB and not flags & termios.PARODD


def test_all_that_waits_comes_without_a_pause(terminal: tuple[int, int, str]) -> None:
    """Behind a full buffer of 4 kB Linux holds 64 kB, which a worker of the kernel moves when it likes."""
    master, slave, name = terminal
    tty.setraw(slave)
    os.set_blocking(master, False)
    port = open_port(LineSettings(name))
    for _ in range(100):
        sent, received = 0, 0
        with contextlib.suppress(BlockingIOError):
            while sent < 60_000:
                sent += os.write(master, b"x" * 1000)
        while data := port.receive(1 << 16, wait=False):
            received += len(data)
        assert received == sent > 4096
    port.close()


@pytest.mark.parametrize(
    ("line", "byte_time_s"),
    [
        (LineSettings("/dev/ttyUSB0", 9600), 10 / 9600),
        (LineSettings("/dev/ttyUSB0", 2400, 7, "E"), 10 / 2400),
        (LineSettings("/dev/ttyUSB0", 9600, 8, "E", 2), 12 / 9600),
        (LineSettings("socket://host:1", 9600), 0.0),
    ],
)
def test_time_of_a_byte(line: LineSettings, byte_time_s: float) -> None:
    assert line.byte_time_s == pytest.approx(byte_time_s)


def test_a_link_to_a_pseudo_terminal_has_no_wire(terminal: tuple[int, int, str], tmp_path: Path) -> None:
    (tmp_path / "tty").symlink_to(terminal[2])
    assert LineSettings(str(tmp_path / "tty")).byte_time_s == 0.0
