"""A server of lines, by TCP or a unix socket: it answers its clients, sends lines to all, and never waits for one."""

from __future__ import annotations

import contextlib
import hmac
import logging
import selectors
import socket
import threading
import time
from collections.abc import Callable

log = logging.getLogger(__name__)

MAX_CLIENTS = 32
MAX_LINE_BYTES = 4096
"""Of a line that a client sends; the connection is closed where more comes without an end of line."""
_SEND_BUFFER = 1 << 16  # of the kernel: small, so that a client that stalls reads few old lines later
_PAUSE_S = 0.05


class Client:
    """A connection without blocking.

    Attributes
    ----------
    authorized : bool
        Whether the client has sent the token, or needs none.
    taken, skipped : int
        Lines that were sent, and lines that were not since the client did not read.
    """

    def __init__(self, connection: socket.socket, name: str, token: str) -> None:
        self._connection, self.name, self._token = connection, name, token
        self.authorized = not token
        self.taken = self.skipped = 0
        self._unfinished, self._unsent = b"", b""
        connection.setblocking(False)
        with contextlib.suppress(OSError):  # a unix socket has none
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)

    def receive(self) -> list[str]:
        """The whole lines that have arrived; raises OSError where the connection is closed."""
        try:
            data = self._connection.recv(MAX_LINE_BYTES)
        except BlockingIOError:
            return []
        if not data:
            raise ConnectionError("closed by the client")
        *lines, self._unfinished = (self._unfinished + data).split(b"\n")
        if len(self._unfinished) > MAX_LINE_BYTES or any(len(line) > MAX_LINE_BYTES for line in lines):
            raise ConnectionError("a line without an end")
        return [line.decode("utf-8", "replace").strip() for line in lines]

    def authorize(self, line: str) -> bool:
        """Authorize the client where ``line`` is the token, with or without ``token`` before it; whether it was."""
        given = line.removeprefix("token ").strip()
        self.authorized = hmac.compare_digest(given.encode(), self._token.encode())
        return self.authorized

    def send(self, line: bytes) -> bool:
        """Send a line without blocking; where that is not possible it is skipped and counted.

        Raises OSError where the connection is closed.
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
        """The part of ``data`` that could not be sent now."""
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


class LineServer:
    """Answers the lines of its clients, and sends lines to all of them.

    A client of a server with a token sends ``token WORD`` first. The server closes the connection of a
    browser, so that no web page can send commands.

    Parameters
    ----------
    listening : socket
        Closed with the server.
    token : str
        Empty where none is needed.
    answer : callable, optional
        Takes a line and gives the answer; without it the lines of clients are ignored.
    greeting : str
        The first line sent to a client; empty for none.
    """

    def __init__(
        self,
        listening: socket.socket,
        token: str = "",
        answer: Callable[[str], str] | None = None,
        greeting: str = "",
    ) -> None:
        self._listening, self._token, self._answer, self._greeting = listening, token, answer, greeting
        name = listening.getsockname()
        self.port: int = name[1] if isinstance(name, tuple) else 0
        self.served = self.taken = self.skipped = 0
        self._clients: dict[int, Client] = {}
        self._lock = threading.RLock()
        self._woken, self._waker = socket.socketpair()
        self._ending = False
        self._thread = threading.Thread(target=self._work, name=f"port {self.port}", daemon=True)

    def start(self) -> None:
        """Begin to listen."""
        self._thread.start()

    def send(self, line: str) -> bool:
        """Send a line to all clients; one that does not read is skipped and counted: then False."""
        data = line.encode() + b"\n"
        with self._lock:
            taken = [self._send(one, data) for one in list(self._clients.values()) if one.authorized]
        return all(taken)

    def close(self) -> None:
        """Close all connections."""
        self._ending = True
        self._waker.send(b"x")
        if self._thread.ident is not None:
            self._thread.join()
        with self._lock:
            for client in list(self._clients.values()):
                self._drop(client)
        for one in (self._listening, self._woken, self._waker):
            one.close()

    def _work(self) -> None:
        with selectors.DefaultSelector() as selector:
            selector.register(self._listening, selectors.EVENT_READ)
            selector.register(self._woken, selectors.EVENT_READ)
            while not self._ending:
                ready = [key.fileobj for key, _ in selector.select()]
                with self._lock:
                    for one in ready:
                        if one is self._listening:
                            self._accept(selector)
                        elif isinstance(one, Client):
                            self._listen_to(one, selector)

    def _accept(self, selector: selectors.BaseSelector) -> None:
        try:
            connection, peer = self._listening.accept()
        except OSError:  # closed again, or no file descriptor is left: then a pause before the next try
            time.sleep(_PAUSE_S)
            return
        if len(self._clients) >= MAX_CLIENTS:
            connection.close()
            return
        client = Client(connection, str(peer), self._token)
        self._clients[client.fileno()] = client
        selector.register(client, selectors.EVENT_READ)
        self.served += 1
        if client.authorized:
            self._greet(client)

    def _greet(self, client: Client) -> None:
        if self._greeting:
            self._send(client, self._greeting.encode() + b"\n")

    def _listen_to(self, client: Client, selector: selectors.BaseSelector) -> None:
        try:
            for line in client.receive():
                if not self._handle(client, line):
                    raise ConnectionError("refused")
        except OSError as over:
            log.debug("%s: %s", client.name, over)
            selector.unregister(client)
            self._drop(client)

    def _handle(self, client: Client, line: str) -> bool:
        """Answer ``line``; False where the connection is to be closed."""
        if not client.authorized:
            authorized = client.authorize(line)
            self._send(client, b"ok\n" if authorized else b"no: give the token first: token WORD\n")
            if authorized:
                self._greet(client)
            return authorized
        if " HTTP/" in line:
            return False
        if self._answer is None:
            return True
        return client.send(self._answer(line).encode() + b"\n")

    def _send(self, client: Client, data: bytes) -> bool:
        try:
            return client.send(data)
        except OSError:
            return True  # the server's thread finds it closed, and drops it

    def _drop(self, client: Client) -> None:
        if self._clients.pop(client.fileno(), None) is not None:
            self.taken += client.taken
            self.skipped += client.skipped
        client.close()
