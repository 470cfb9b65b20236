"""The serial ports of this machine: their list, their identity, and opening one by pyserial."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlsplit

from acquire.errors import ConfigError, DeviceError
from acquire.serial_line.byte_ports import WRITE_S, Port, Rfc2217Port, TcpPort, TtyPort, line_settings
from acquire.system import TERMINAL_ERRORS, group_of
from acquire.text import Message, joined

LINE_ERRORS: tuple[type[Exception], ...] = (OSError, *TERMINAL_ERRORS)
PORT_ERRORS: tuple[type[Exception], ...] = (*LINE_ERRORS, TypeError, ValueError)
"""What a port that is gone raises; TypeError and ValueError come from one closed while it is read."""

_PYSERIALS = {"logging", "ign_set_control", "poll_modem"}  # settings of its URLs that mean nothing here


@dataclass(frozen=True, slots=True)
class PortInfo:
    """A serial port that there is.

    Attributes
    ----------
    device : str
        ``/dev/ttyUSB0``.
    description : str
    identity : str
        Of the USB device behind it, the same wherever it is plugged in; "" where it has none.
    accessible : bool
        Whether this user may read and write it.
    """

    device: str
    description: str
    identity: str
    accessible: bool

    def text(self) -> str:
        """One line for a person."""
        words = [word for word in (self.description, self.identity) if word and word != "n/a"]
        denied = "" if self.accessible else Message("  (this user may not open it: see docs/load-cells.md)")
        line = f"  {self.device}  {'  '.join(words)}".rstrip()
        return joined("", (line, denied)) if denied else line


def list_serial_ports() -> list[PortInfo]:
    """All serial ports that something stands behind."""
    from serial.tools import list_ports as tool

    return [
        PortInfo(
            port.device, port.description or "", _identity(port), os.access(port.device, os.R_OK | os.W_OK)
        )
        for port in sorted(tool.comports())
    ]


def _identity(port: Any) -> str:
    if port.vid is None:
        return ""
    return f"{port.vid:04x}:{port.pid:04x}:{port.serial_number or ''}"


def identity_of(device: str) -> str:
    """Identity of the USB device behind a port; "" where it has none."""
    real = os.path.realpath(device)
    return next((p.identity for p in list_serial_ports() if os.path.realpath(p.device) == real), "")


def find_again(device: str, identity: str) -> str:
    """Where a port is now: under another name, if its device came back as another port."""
    if not identity:
        return device
    same = [port.device for port in list_serial_ports() if port.identity == identity]
    return same[0] if len(same) == 1 else device


def ports_line() -> str:
    """The ports there are, in one sentence."""
    ports = [port.text().strip() for port in list_serial_ports()]
    return (
        Message("serial ports here: ") + ", ".join(ports)
        if ports
        else Message("this machine has no serial port now")
    )


@dataclass(frozen=True, slots=True)
class LineSettings:
    """How a port is opened.

    Attributes
    ----------
    url : str
        A device or a pyserial URL, without settings of ours.
    baud, bytesize, parity, stopbits
    read_timeout_s : float, s
        After which a read returns empty-handed.
    """

    url: str
    baud: int = 9600
    bytesize: int = 8
    parity: str = "N"
    stopbits: float = 1
    read_timeout_s: float = 0.1

    @property
    def byte_time_s(self) -> float:
        """Time that one byte takes on the wire, s; 0 where there is no wire (pty, network)."""
        if "://" in self.url or os.path.realpath(self.url).startswith("/dev/pts/"):
            return 0.0
        return (1 + self.bytesize + (self.parity != "N") + self.stopbits) / self.baud


def check_present(url: str) -> None:
    """Refuse a port that is not there without opening it, which can reset a device.

    Raises
    ------
    DeviceError
        Lists the ports there are.
    """
    if url.startswith("/dev/") and not Path(url).exists():
        raise DeviceError("{url}: there is no such port; {ports_line}", url, ports_line())


def open_port(line: LineSettings) -> Port:
    """Open a port.

    Raises
    ------
    ConfigError
        The URL or a line setting is impossible.
    DeviceError
        Not there, busy, or not allowed; lists the ports there are.
    """
    opener = _NETWORK.get(line.url.partition("://")[0], _by_pyserial)
    try:
        return opener(line)
    except LINE_ERRORS as error:
        raise DeviceError(_why(line.url, error)) from error
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ConfigError("{url}: {error}", line.url, error) from error


def _by_pyserial(line: LineSettings) -> Port:
    import serial

    return TtyPort(
        serial.serial_for_url(
            line.url,
            baudrate=line.baud,
            bytesize=line.bytesize,
            parity=line.parity,
            stopbits=line.stopbits,
            timeout=line.read_timeout_s,
            write_timeout=WRITE_S,
            exclusive=None if "://" in line.url else True,
        )
    )


def _socket(line: LineSettings) -> Port:
    return TcpPort(*_host_and_port(line.url), line.read_timeout_s)


def _rfc2217(line: LineSettings) -> Port:
    commands = line_settings(line.baud, line.bytesize, line.parity, line.stopbits)
    try:
        return Rfc2217Port(*_host_and_port(line.url), commands, line.read_timeout_s)
    except DeviceError as error:
        raise DeviceError("{url}: {error}", line.url, error) from error


_NETWORK: Mapping[str, Callable[[LineSettings], Port]] = {"socket": _socket, "rfc2217": _rfc2217}


def _host_and_port(url: str) -> tuple[str, int]:
    parts = urlsplit(url)
    unknown = {key for key, _ in parse_qsl(parts.query, keep_blank_values=True)} - _PYSERIALS
    if unknown:
        raise ValueError(f"unknown setting {min(unknown)!r}")
    if not parts.hostname or parts.port is None:
        raise ValueError("a host and a port are missing; write for example socket://192.168.0.7:4001")
    return parts.hostname, parts.port


def _why(url: str, error: Exception) -> str:
    code = getattr(error, "errno", None)
    if code == errno.EACCES:
        return Message(
            "{url}: this user may not open it; add yourself to the group that owns it (sudo usermod -aG "
            "{group_of} $USER), then log in again",
            url,
            group_of(Path(url)) or "dialout",
        )
    if code in (errno.EBUSY, errno.EAGAIN) or "exclusively lock" in str(error):
        return Message("{url}: another program has it open (a serial monitor?); close that one", url)
    if url.partition("://")[0] in _NETWORK:
        return Message(
            "{url}: nobody answers there ({error}); check address, cable and power of the converter",
            url,
            error,
        )
    if "://" not in url and not Path(url).exists():
        return Message("{url}: there is no such port; {ports_line}", url, ports_line())
    return Message("{url}: cannot be opened ({error}); {ports_line}", url, error, ports_line())
