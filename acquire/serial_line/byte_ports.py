"""Ports as streams of bytes: one block of what came, with a limit, and no long wait.

``TtyPort`` wraps pyserial, for ports of this machine. ``TcpPort`` is a socket: pyserial reads one byte at a
time from it, and its opening lasts as long as the other side sends. ``Rfc2217Port`` is a serial port behind a
terminal server (Telnet with the COM port option, RFC 854 and RFC 2217): pyserial has no write time-out
there, an unbounded queue, and fails on a server that ends a negotiation which it did not begin.
"""

from __future__ import annotations

import contextlib
import io
import select
import socket
import time
from collections.abc import Callable
from typing import Any, Protocol

from acquire.errors import DeviceError
from acquire.text import Message

CONNECT_S = 3.0
WRITE_S = 0.5

SE, SB, WILL, WONT, DO, DONT, IAC = 240, 250, 251, 252, 253, 254, 255
BINARY, SGA, COM_PORT = 0, 3, 44
BAUD, SIZE, PARITY, STOP, CONTROL = 1, 2, 3, 4, 5
ANSWER = 100  # what the server adds to the number of a command
PARITIES = {"N": 1, "O": 2, "E": 3}
STOPS = {1.0: 1, 2.0: 2, 1.5: 3}
NO_FLOW_CONTROL, DTR_ON, RTS_ON = 1, 8, 11
MAX_NEGOTIATION = 64  # bytes kept of a negotiation

_OURS, _THEIRS = frozenset({BINARY, SGA, COM_PORT}), frozenset({BINARY, SGA, COM_PORT})


class Port(Protocol):
    """Where bytes come from and go to; every method raises one of ``PORT_ERRORS`` when it is gone."""

    def receive(self, limit: int, /, *, wait: bool = True) -> bytes:
        """What is there, at most ``limit`` bytes; b"" when nothing came within the read time-out.

        With ``wait=False`` what is there at once.
        """
        ...

    def write(self, data: bytes, /) -> object: ...

    def wake(self) -> None:
        """End a ``receive`` that waits; from any thread."""
        ...

    def close(self) -> None: ...


class TtyPort:
    """A ``serial.Serial``, or another of pyserial's ports."""

    def __init__(self, port: Any) -> None:
        self._port = port

    def receive(self, limit: int, /, *, wait: bool = True) -> bytes:
        """See ``Port``."""
        data = bytes(self._port.read(1)) if wait else b""
        if not wait:
            self._let_kernel_deliver()
        waiting = min(self._port.in_waiting, limit - len(data)) if data or not wait else 0
        return data + (self._port.read(waiting) if waiting else b"")

    def _let_kernel_deliver(self) -> None:
        """Have Linux count all that came: behind a full buffer of 4 kB it holds 64 kB, moved by a kernel worker.

        ``in_waiting`` does not wait for that worker; ``select`` does before it finds nothing.
        """
        with contextlib.suppress(io.UnsupportedOperation):  # a port without a descriptor
            select.select([self._port.fileno()], [], [], 0)

    def write(self, data: bytes, /) -> object:
        """See ``Port``."""
        return self._port.write(data)

    def wake(self) -> None:
        """See ``Port``; where pyserial cannot, the read time-out does it."""
        cancel = getattr(self._port, "cancel_read", None)
        if cancel is not None:
            cancel()

    def close(self) -> None:
        """Close it."""
        self._port.close()


class TcpPort:
    """A TCP connection to a converter.

    Parameters
    ----------
    host, port : str, int
    read_timeout_s : float, s

    Raises
    ------
    OSError
        Nobody answers.
    """

    def __init__(self, host: str, port: int, read_timeout_s: float) -> None:
        self._read_timeout_s = read_timeout_s
        self._socket = socket.create_connection((host, port), CONNECT_S)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        self._woken, self._waker = socket.socketpair()

    def receive(self, limit: int, /, *, wait: bool = True) -> bytes:
        """See ``Port``."""
        return self._receive(limit, self._read_timeout_s if wait else 0.0)

    def _receive(self, limit: int, seconds: float) -> bytes:
        ready, _, _ = select.select([self._socket, self._woken], [], [], seconds)
        if self._woken in ready:
            self._woken.recv(64)
        if self._socket not in ready:
            return b""
        data = self._socket.recv(limit)
        if not data:
            raise ConnectionError(Message("the other side closed the connection"))
        return data

    def write(self, data: bytes, /) -> object:
        """See ``Port``; a peer that takes nothing for half a second is gone."""
        while data:
            _, ready, _ = select.select([], [self._socket], [], WRITE_S)
            if not ready:
                raise TimeoutError(Message("the other side takes no commands"))
            data = data[self._socket.send(data) :]
        return None

    def wake(self) -> None:
        """See ``Port``."""
        self._waker.send(b"x")

    def close(self) -> None:
        """Close it."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        for one in (self._socket, self._woken, self._waker):
            one.close()


class Telnet:
    """Takes Telnet's commands out of what the server sends.

    Attributes
    ----------
    replies : bytearray
        What has to be sent back; the caller takes it out.
    willing : bool
        The server supports RFC 2217.
    answered : set of int
        Settings that the server has answered.
    """

    def __init__(self) -> None:
        self.replies = bytearray()
        self.willing = False
        self.answered: set[int] = set()
        self._begun = bytearray()  # of a command that is not whole yet
        self._sent: set[tuple[int, int]] = set()

    def begin(self) -> bytes:
        """What is offered and asked for at the start."""
        for action, option in ((WILL, COM_PORT), (DO, COM_PORT), (WILL, BINARY), (DO, BINARY), (DO, SGA)):
            self._say(action, option)
        return self.take_replies()

    def take_replies(self) -> bytes:
        """What is to be sent now."""
        replies = bytes(self.replies)
        self.replies.clear()
        return replies

    def feed(self, data: bytes) -> bytes:
        """The data of the line in what has come."""
        data, out = bytes(self._begun) + data, bytearray()
        self._begun.clear()
        at = 0
        while at < len(data):
            mark = data.find(b"\xff", at)
            if mark < 0:
                out += data[at:]
                break
            out += data[at:mark]
            size = self._command(data[mark : mark + MAX_NEGOTIATION])
            if size == 0:  # the rest of it is still to come
                self._begun += data[mark:]
                break
            out += b"\xff" if data[mark : mark + 2] == b"\xff\xff" else b""
            at = mark + size
        return bytes(out)

    def _command(self, data: bytes) -> int:
        """Follow the command at the beginning of ``data``; its length, 0 when it is not whole."""
        if len(data) < 2:
            return 0
        if data[1] in (WILL, WONT, DO, DONT):
            if len(data) < 3:
                return 0
            self._negotiate(data[1], data[2])
            return 3
        return self._settings(data) if data[1] == SB else 2

    def _settings(self, data: bytes) -> int:
        end = data.find(bytes([IAC, SE]), 2)
        if end < 0:
            return MAX_NEGOTIATION if len(data) >= MAX_NEGOTIATION else 0
        if data[2:3] == bytes([COM_PORT]) and end > 3:
            self.answered.add(data[3] - ANSWER)
        return end + 2

    def _negotiate(self, action: int, option: int) -> None:
        if option == COM_PORT and action in (WILL, DO):
            self.willing = True
        if action == WILL:
            self._say(DO if option in _THEIRS else DONT, option)
        elif action == DO:
            self._say(WILL if option in _OURS else WONT, option)

    def _say(self, action: int, option: int) -> None:
        """Once, so that no two sides can answer each other for ever."""
        if (action, option) not in self._sent:
            self._sent.add((action, option))
            self.replies += bytes([IAC, action, option])


def escaped(data: bytes) -> bytes:
    """Data of the line as Telnet sends it."""
    return data.replace(b"\xff", b"\xff\xff")


def setting(command: int, value: int, size: int = 1) -> bytes:
    """A command of RFC 2217."""
    body = escaped(value.to_bytes(size, "big"))
    return bytes([IAC, SB, COM_PORT, command]) + body + bytes([IAC, SE])


class Rfc2217Port(TcpPort):
    """The port, with its line set.

    Parameters
    ----------
    host, port : str, int
    line : bytes
        The commands that set it (``line_settings``).
    read_timeout_s : float, s

    Raises
    ------
    OSError
        Nobody answers.
    DeviceError
        The server does not support RFC 2217.
    """

    def __init__(self, host: str, port: int, line: bytes, read_timeout_s: float) -> None:
        super().__init__(host, port, read_timeout_s)
        self._telnet = Telnet()
        try:
            super().write(self._telnet.begin())
            self._until(
                lambda: self._telnet.willing,
                Message("speaks no RFC 2217; use socket:// for a plain connection"),
            )
            super().write(line)
            wanted = {BAUD, SIZE, PARITY, STOP}
            self._until(
                lambda: wanted <= self._telnet.answered,
                Message("does not answer to the settings of the line"),
            )
        except BaseException:
            self.close()
            raise

    def _until(self, done: Callable[[], bool], words: str) -> None:
        until = time.monotonic() + CONNECT_S
        while not done():
            if time.monotonic() > until:
                raise DeviceError("the other side {words}", words)
            self._take(4096, 0.05)

    def _take(self, limit: int, seconds: float) -> bytes:
        data = self._telnet.feed(self._receive(limit, seconds))
        if self._telnet.replies:
            super().write(self._telnet.take_replies())
        return data

    def receive(self, limit: int, /, *, wait: bool = True) -> bytes:
        """See ``Port``."""
        return self._take(limit, self._read_timeout_s if wait else 0.0)

    def write(self, data: bytes, /) -> object:
        """See ``Port``."""
        return super().write(escaped(data))


def line_settings(baud: int, bytesize: int, parity: str, stopbits: float) -> bytes:
    """The commands that set a line, without flow control, with DTR and RTS on."""
    return b"".join(
        (
            setting(BAUD, baud, 4),
            setting(SIZE, bytesize),
            setting(PARITY, PARITIES[parity]),
            setting(STOP, STOPS[stopbits]),
            setting(CONTROL, NO_FLOW_CONTROL),
            setting(CONTROL, DTR_ON),
            setting(CONTROL, RTS_ON),
        )
    )
