"""Ports as streams of bytes: what is there in one block, never more than asked for, never waiting for long.

A socket is read by our own few lines: pyserial's reports one byte at a time, and its opening lasts as
long as the other side keeps sending.
"""

from __future__ import annotations

import contextlib
import select
import socket
from typing import Any, Protocol

CONNECT_S = 3.0
WRITE_S = 0.5


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
        waiting = min(self._port.in_waiting, limit - len(data)) if data or not wait else 0
        return data + (self._port.read(waiting) if waiting else b"")

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
            raise ConnectionError("the other side closed the connection")
        return data

    def write(self, data: bytes, /) -> object:
        """See ``Port``; a peer that takes nothing for half a second is gone."""
        while data:
            _, ready, _ = select.select([], [self._socket], [], WRITE_S)
            if not ready:
                raise TimeoutError("the other side takes no commands")
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
