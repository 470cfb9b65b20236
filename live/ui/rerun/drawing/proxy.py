"""A proxy before the server of rerun: viewers pass, requests of foreign web pages do not.

The port is bound here before it is published, so no two tests publish the same one. The server of rerun
answers a request with any Host header: a web page whose name is rebound to 127.0.0.1 could read the test. So it
listens behind this proxy, on Linux at a random address of 127.0.0.0/8. The Host of an HTTP/1 request must be this
machine; browsers use HTTP/1 on a plain port, and all requests of one connection have one Host. HTTP/2 (the
viewer) passes.

A viewer that receives nothing while data wait (a stopped program) is disconnected: rerun would wait for it and
draw no more.
"""

from __future__ import annotations

import asyncio
import contextlib
import random
import re
import socket
import sys
import threading
import time
from collections.abc import Callable

from acquire.text import Message
from live.config.listen_address import listening_socket

HOST, TRIES = "127.0.0.1", 50
STOPPED_S, STOPPED_BYTES = 10.0, 500_000
"""A viewer that received nothing for so long while so much was drawn has stopped."""

_VIEWER_BYTES = 2**14  # a connection that received less is not a viewer of the test
_HEAD_BYTES, _PIECE_BYTES = 2**16, 2**16
_HTTP2 = b"PRI * HTTP/2.0\r\n\r\n"
_HERE = re.compile(rb"(?:127\.0\.0\.1|localhost|\[::1\])(?::\d+)?")
_FORBIDDEN = b"HTTP/1.1 403 Forbidden\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"


class ViewerProxy:
    """Listens on 127.0.0.1 as soon as it is constructed; accepts connections once it is opened.

    Parameters
    ----------
    first_port : int
        The first port that is tried.
    notify : callable
        Called by the thread of the proxy with a message for a person.

    Raises
    ------
    OSError
        ``TRIES`` ports in a row are taken.
    """

    def __init__(self, first_port: int, notify: Callable[[str], None]) -> None:
        self._socket = _listening(first_port)
        self._notify = notify
        self._drawn = 0
        self._connections: list[_Connection] = []
        self.port: int = self._socket.getsockname()[1]

    def open(self, host: str, port: int) -> None:
        """Accept viewers, for the server at ``host``, ``port``."""
        serve = self._serve(host, port)
        threading.Thread(target=asyncio.run, args=(serve,), name="proxy", daemon=True).start()

    def close(self) -> None:
        """Release the port of a proxy that was not opened."""
        self._socket.close()

    def drawn(self, count: int) -> None:
        """Set the total of bytes drawn; callable from any thread."""
        self._drawn = count

    async def _serve(self, host: str, port: int) -> None:
        async def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            with contextlib.suppress(OSError, EOFError, asyncio.LimitOverrunError, TimeoutError):
                await self._connect(reader, writer, host, port)
            writer.close()

        server = await asyncio.start_server(accept, sock=self._socket, limit=_HEAD_BYTES)
        await server.start_serving()
        while True:
            await asyncio.sleep(1.0)
            self._drop_stopped()

    async def _connect(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, host: str, port: int
    ) -> None:
        async with asyncio.timeout(STOPPED_S):
            head = await reader.readuntil(b"\r\n\r\n")
        if not host_allowed(head):
            writer.write(_FORBIDDEN)
            await writer.drain()
            return
        from_server, to_server = await asyncio.open_connection(host, port)
        to_server.write(head)
        connection = _Connection(writer, self._drawn)
        self._connections.append(connection)
        tasks = [
            asyncio.create_task(_forward(reader, to_server, lambda count: None)),
            asyncio.create_task(
                _forward(from_server, writer, lambda count: connection.received(count, self._drawn))
            ),
        ]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        finally:
            self._connections.remove(connection)
            for task in tasks:
                task.cancel()
            to_server.close()

    def _drop_stopped(self) -> None:
        for connection in self._connections:
            if connection.has_stopped(self._drawn):
                connection.writer.transport.abort()
                self._notify(
                    Message("a viewer received nothing for {s:.0f} s and was disconnected", STOPPED_S)
                )


class _Connection:
    """A connection to a viewer, and when it last received something."""

    def __init__(self, writer: asyncio.StreamWriter, drawn: int) -> None:
        self.writer = writer
        self._total, self._drawn, self._t = 0, drawn, time.monotonic()

    def received(self, count: int, drawn: int) -> None:
        self._total += count
        self._drawn, self._t = drawn, time.monotonic()

    def has_stopped(self, drawn: int) -> bool:
        missed = drawn - self._drawn > STOPPED_BYTES and self._total > _VIEWER_BYTES
        return missed and time.monotonic() - self._t > STOPPED_S and not self.writer.is_closing()


async def _forward(
    source: asyncio.StreamReader, sink: asyncio.StreamWriter, received: Callable[[int], None]
) -> None:
    while piece := await source.read(_PIECE_BYTES):
        sink.write(piece)
        await sink.drain()
        received(len(piece))


def host_allowed(head: bytes) -> bool:
    """Whether a connection with this head comes from a viewer, or from a page of this machine."""
    if head == _HTTP2:
        return True
    hosts = [line.partition(b":")[2].strip() for line in head.split(b"\r\n") if line[:5].lower() == b"host:"]
    return len(hosts) == 1 and _HERE.fullmatch(hosts[0].lower()) is not None


def _listening(first_port: int) -> socket.socket:
    try:
        return listening_socket(HOST, first_port, TRIES)
    except OSError:
        raise OSError(f"no free port from {first_port} on; set another view.port") from None


def hidden_address() -> tuple[str, int]:
    """A free address and port; on Linux the address is random."""
    numbers = random.SystemRandom()
    host = f"127.{'.'.join(str(numbers.randint(1, 254)) for _ in range(3))}"
    with socket.socket() as probe:
        probe.bind((host if sys.platform == "linux" else HOST, 0))
        found, port = probe.getsockname()
        return str(found), int(port)


def wait_for(host: str, port: int, seconds: float = 20.0) -> None:
    """Wait until a server listens there.

    Raises
    ------
    OSError
        None does after ``seconds``.
    """
    until = time.monotonic() + seconds
    while True:
        try:
            socket.create_connection((host, port), 1.0).close()
            return
        except OSError:
            if time.monotonic() > until:
                raise
            time.sleep(0.05)
