"""The list of ports, their identities, and why one cannot be opened."""

from __future__ import annotations

import errno
import pty
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest

from acquire.errors import ConfigError, DeviceError
from acquire.serial_line import ports as serial_ports
from acquire.serial_line.ports import LineSettings, find_again, identity_of, list_serial_ports, open_port


@dataclass(order=True)
class Listed:
    device: str
    description: str = "n/a"
    vid: int | None = None
    pid: int | None = None
    serial_number: str | None = None


@pytest.fixture
def listed(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Listed]]:
    from serial.tools import list_ports

    ports = [
        Listed("/dev/ttyS0"),
        Listed("/dev/ttyUSB1", "FT232R", 0x0403, 0x6001, "A1"),
        Listed("/dev/ttyACM0", "Uno", 0x2341, 0x43, None),
    ]
    monkeypatch.setattr(list_ports, "comports", lambda: list(ports))
    yield ports


def test_the_list(listed: list[Listed]) -> None:
    ports = {port.device: port for port in list_serial_ports()}
    assert ports["/dev/ttyUSB1"].identity == "0403:6001:A1"
    assert "FT232R" in ports["/dev/ttyUSB1"].text()
    assert ports["/dev/ttyS0"].identity == ""


def test_a_device_is_found_under_its_new_name(listed: list[Listed]) -> None:
    identity = identity_of("/dev/ttyUSB1")
    listed[1] = Listed("/dev/ttyUSB7", "FT232R", 0x0403, 0x6001, "A1")
    assert find_again("/dev/ttyUSB1", identity) == "/dev/ttyUSB7"
    assert find_again("/dev/ttyS0", "") == "/dev/ttyS0"


def test_two_devices_alike_are_not_mixed_up(listed: list[Listed]) -> None:
    listed += [Listed("/dev/ttyACM1", "Uno", 0x2341, 0x43, None)]
    assert find_again("/dev/ttyACM9", "2341:0043:") == "/dev/ttyACM9"


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.EACCES, "denied"), "usermod"),
        (OSError(errno.EBUSY, "busy"), "another program has it open"),
        (OSError(errno.ENOENT, "gone"), "there is no such port; serial ports here: /dev/ttyACM0"),
    ],
)
def test_why_not(error: OSError, words: str, listed: list[Listed], monkeypatch: pytest.MonkeyPatch) -> None:
    import serial

    def refuse(*args: object, **keys: object) -> None:
        raise error

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(DeviceError) as caught:
        open_port(LineSettings("/dev/ttyNONE"))
    assert words in str(caught.value) and "/dev/ttyNONE" in str(caught.value)


def test_a_port_that_is_open_already_is_busy() -> None:
    import os

    master, slave = pty.openpty()
    name = os.ttyname(slave)
    first = open_port(LineSettings(name))
    with pytest.raises(DeviceError, match="another program"):
        open_port(LineSettings(name))
    first.close()
    os.close(master)
    os.close(slave)


def test_an_impossible_line_is_a_matter_of_configuration() -> None:
    with pytest.raises(ConfigError):
        open_port(LineSettings("loop://", bytesize=9))


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


def test_a_pty_has_no_wire(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(serial_ports.os, "path", SimpleNamespace(realpath=lambda p: "/dev/pts/3"))
    assert LineSettings(str(tmp_path / "tty")).byte_time_s == 0.0
