"""One client of a server of lines: what it says, line by line, and what it is told, never waited for."""

from __future__ import annotations

import contextlib
import hmac
import socket

MOST_BYTES = 4096
"""Of a line that a client sends; one that sends more without an end of line is let go."""
_SEND_BUFFER = 1 << 16  # of the kernel: a client that stalls reads little that is old when it goes on


class Client:
    """A connection that is never waited for.

    Attributes
    ----------
    admitted : bool
        Has given the token, or needs none.
    taken, skipped : int
        Lines that were sent, and that found no room since it did not read.
    """

    def __init__(self, connection: socket.socket, name: str, token: str) -> None:
        self._connection, self.name, self._token = connection, name, token
        self.admitted = not token
        self.taken = self.skipped = 0
        self._said, self._unsent = b"", b""
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)

    def heard(self) -> list[str]:
        """The whole lines that came; raises OSError where the connection is over."""
        try:
            data = self._connection.recv(MOST_BYTES)
        except BlockingIOError:
            return []
        if not data:
            raise ConnectionError("closed by the client")
        *lines, self._said = (self._said + data).split(b"\n")
        if len(self._said) > MOST_BYTES or any(len(line) > MOST_BYTES for line in lines):
            raise ConnectionError("a line without an end")
        return [line.decode("utf-8", "replace").strip() for line in lines]

    def admits(self, line: str) -> bool:
        """Whether ``line`` is ``token`` and the token; then the client is admitted."""
        given = line.removeprefix("token ").strip()
        self.admitted = hmac.compare_digest(given.encode(), self._token.encode())
        return self.admitted

    def tell(self, line: bytes) -> bool:
        """Send a line, where the client has room for it; else it is skipped and counted.

        Raises OSError where the connection is over.
        """
        if self._unsent:
            self._unsent = self._rest(self._unsent)
        if self._unsent:
            self.skipped += 1
            return False
        rest = self._rest(line)
        self._unsent = b"" if rest == line else rest
        self.taken += rest != line
        self.skipped += rest == line
        return rest != line

    def _rest(self, data: bytes) -> bytes:
        """What could not be sent now."""
        try:
            return data[self._connection.send(data) :]
        except BlockingIOError:
            return data

    def fileno(self) -> int:
        """For selectors."""
        return self._connection.fileno()

    def close(self) -> None:
        """Close the connection."""
        with contextlib.suppress(OSError):
            self._connection.close()
