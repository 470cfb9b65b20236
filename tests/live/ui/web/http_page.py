"""A page without a browser: what it asks over HTTP, and the events that it reads or leaves."""

from __future__ import annotations

import contextlib
import socket
import struct
from urllib.parse import urlsplit

from tests.live.ui.waiting import LONG_S


class HttpPage:
    """A page at the level of HTTP: the cookie, then the events, which are read or not."""

    def __init__(self, address: str) -> None:
        url = urlsplit(address)
        self.port = url.port or 0
        answer = self._ask(f"/?{url.query}", "")
        self.cookie = answer.partition("Set-Cookie: ")[2].partition(";")[0]
        assert self.cookie, answer
        self.socket = self._opened()
        self.socket.sendall(self._request("/events", self.cookie))
        assert self.socket.recv(12) == b"HTTP/1.1 200"

    def _opened(self) -> socket.socket:
        opened = socket.socket()
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)  # soon full
        opened.settimeout(LONG_S)
        opened.connect(("127.0.0.1", self.port))
        return opened

    def _request(self, path: str, cookie: str) -> bytes:
        return f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{self.port}\r\nCookie: {cookie}\r\n\r\n".encode()

    def _ask(self, path: str, cookie: str) -> str:
        with self._opened() as one:
            one.sendall(self._request(path, cookie))
            return one.recv(4096).decode()

    def read(self, size: int) -> None:
        """Read at least ``size`` bytes."""
        while size > 0:
            piece = self.socket.recv(2**16)
            assert piece, f"it closes the connection {size} bytes too early"
            size -= len(piece)

    def read_all(self) -> None:
        """Read until the server closes the connection, and keep nothing."""
        self.socket.settimeout(None)
        while self.socket.recv(2**16):
            pass

    def points(self) -> None:
        """Ask for the curve from its begin on, as a browser that was reloaded does."""
        with self._opened() as one:
            one.sendall(self._request("/points?edition=0&count=0", self.cookie))
            while one.recv(2**16):
                pass

    def rest(self) -> bytes:
        """Read to the end."""
        found = b""
        with self.socket as one, contextlib.suppress(ConnectionResetError):
            while piece := one.recv(2**16):
                found += piece
        return found

    def kill(self) -> None:
        """Reset the connection, as a killed browser does."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.socket.close()
