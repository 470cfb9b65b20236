"""The serial ports of this machine: their list, their identity, and opening one by pyserial."""

from __future__ import annotations

import errno
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from acquire.errors import ConfigError, DeviceError


def _terminal_errors() -> tuple[type[Exception], ...]:
    """termios.error is no OSError; Windows has none."""
    try:
        import termios
    except ImportError:
        return ()
    return (termios.error,)


LINE_ERRORS: tuple[type[Exception], ...] = (OSError, *_terminal_errors())
PORT_ERRORS: tuple[type[Exception], ...] = (*LINE_ERRORS, TypeError)
"""What a port that is gone raises; TypeError comes from one closed while it is read."""


class Port(Protocol):
    """What is used of a ``serial.Serial``."""

    @property
    def in_waiting(self) -> int: ...

    def read(self, size: int, /) -> bytes: ...

    def write(self, data: bytes, /) -> int | None: ...

    def close(self) -> None: ...


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
        denied = "" if self.accessible else "  (this user may not open it: see docs/load-cells.md)"
        return f"  {self.device}  {'  '.join(words)}{denied}".rstrip()


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
    return "serial ports here: " + ", ".join(ports) if ports else "this machine has no serial port now"


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


def open_port(line: LineSettings) -> Port:
    """Open a port.

    Raises
    ------
    ConfigError
        The URL or a line setting is impossible.
    DeviceError
        Not there, busy, or not allowed; lists the ports there are.
    """
    import serial

    try:
        port: Port = serial.serial_for_url(
            line.url,
            baudrate=line.baud,
            bytesize=line.bytesize,
            parity=line.parity,
            stopbits=line.stopbits,
            timeout=line.read_timeout_s,
            write_timeout=2.0,
            exclusive=None if "://" in line.url else True,
        )
    except LINE_ERRORS as error:
        raise DeviceError(_why(line.url, error)) from error
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ConfigError(f"{line.url}: {error}") from error
    return port


def _why(url: str, error: Exception) -> str:
    code = getattr(error, "errno", None)
    if code == errno.EACCES:
        return (
            f"{url}: this user may not open it; add yourself to the group that owns it"
            f" (sudo usermod -aG {_group(url)} $USER), then log in again"
        )
    if code in (errno.EBUSY, errno.EAGAIN) or "exclusively lock" in str(error):
        return f"{url}: another program has it open (a serial monitor?); close that one"
    if "://" not in url and not Path(url).exists():
        return f"{url}: there is no such port; {ports_line()}"
    return f"{url}: cannot be opened ({error}); {ports_line()}"


def _group(url: str) -> str:
    try:
        return Path(url).group()
    except (OSError, KeyError):
        return "dialout"
