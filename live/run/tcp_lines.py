"""A server of lines: any number of clients, none of which is ever waited for.

One client of a server of lines: what it says, line by line, and what it is told, never waited for.
"""

from __future__ import annotations

import contextlib
import hmac
import logging
import selectors
import socket
import threading
import time
from collections.abc import Callable

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


log = logging.getLogger(__name__)

MOST_CLIENTS = 32
_PAUSE_S = 0.05


class LineServer:
    """Answers the lines of its clients, and tells all of them lines.

    A client of a server with a token says ``token WORD`` first. A request of a browser is let go, so
    that no page from elsewhere can say anything here.

    Parameters
    ----------
    listening : socket
        Closed with the server.
    token : str
        Empty where none is needed.
    hear : callable, optional
        Called with a line, gives the answer; without it, what clients say is passed over.
    greeting : str
        The first line that a client is told, where there is one.
    """

    def __init__(
        self,
        listening: socket.socket,
        token: str = "",
        hear: Callable[[str], str] | None = None,
        greeting: str = "",
    ) -> None:
        self._listening, self._token, self._hear, self._greeting = listening, token, hear, greeting
        self.port: int = listening.getsockname()[1]
        self.served = self.taken = self.skipped = 0
        self._clients: dict[int, Client] = {}
        self._lock = threading.RLock()
        self._woken, self._waker = socket.socketpair()
        self._ending = False
        self._thread = threading.Thread(target=self._work, name=f"port {self.port}", daemon=True)

    def start(self) -> None:
        """Begin to listen."""
        self._thread.start()

    def tell(self, line: str) -> None:
        """Tell all clients a line; one that does not read is passed over, and counted."""
        data = line.encode() + b"\n"
        with self._lock:
            for client in list(self._clients.values()):
                if client.admitted:
                    self._told(client, data)

    def close(self) -> None:
        """Let all clients go."""
        self._ending = True
        self._waker.send(b"x")
        if self._thread.ident is not None:
            self._thread.join()
        with self._lock:
            for client in list(self._clients.values()):
                self._let_go(client)
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
            connection, (host, port, *_) = self._listening.accept()
        except OSError:  # gone again, or no handle is left: then it would be tried without a pause
            time.sleep(_PAUSE_S)
            return
        if len(self._clients) >= MOST_CLIENTS:
            connection.close()
            return
        client = Client(connection, f"{host}:{port}", self._token)
        self._clients[client.fileno()] = client
        selector.register(client, selectors.EVENT_READ)
        self.served += 1
        if client.admitted:
            self._greet(client)

    def _greet(self, client: Client) -> None:
        if self._greeting:
            self._told(client, self._greeting.encode() + b"\n")

    def _listen_to(self, client: Client, selector: selectors.BaseSelector) -> None:
        try:
            for line in client.heard():
                if not self._answered(client, line):
                    raise ConnectionError("let go")
        except OSError as over:
            log.debug("%s: %s", client.name, over)
            selector.unregister(client)
            self._let_go(client)

    def _answered(self, client: Client, line: str) -> bool:
        """Whether the client may go on."""
        if not client.admitted:
            admitted = client.admits(line)
            self._told(client, b"ok\n" if admitted else b"no: give the token first: token WORD\n")
            if admitted:
                self._greet(client)
            return admitted
        if " HTTP/" in line:
            return False
        if self._hear is None or not line:
            return True
        return client.tell(self._hear(line).encode() + b"\n")

    def _told(self, client: Client, data: bytes) -> None:
        try:
            client.tell(data)
        except OSError:
            return  # the listening thread finds it closed, and lets it go

    def _let_go(self, client: Client) -> None:
        if self._clients.pop(client.fileno(), None) is not None:
            self.taken += client.taken
            self.skipped += client.skipped
        client.close()
