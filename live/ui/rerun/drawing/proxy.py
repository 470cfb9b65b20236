"""Where viewers connect: lets them through to rerun's server, and not whom it should not.

The port is bound here before it is told to anybody, so no two tests ever tell the same one. Rerun's
server answers whatever Host it is asked for: a web page whose name is rebound to 127.0.0.1 could read
the test. So it stands behind this door, on Linux at an address of 127.0.0.0/8 that nobody can guess. A
request of HTTP/1 must name this machine; browsers speak nothing else to a plain port, and all
requests of one of their connections are to one host. HTTP/2 (the viewer) passes.

A viewer that takes nothing while there is something to take (stopped) is let go: rerun would wait for it
and draw no more.
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

from live.config.listen_address import listening_socket

HOST, TRIES = "127.0.0.1", 50
PATIENCE_S, PATIENCE_BYTES = 10.0, 500_000
"""A viewer that took nothing for so long while so much was drawn has stopped."""

_VIEWER_BYTES = 2**14  # who took less asked for something else than the test
_HEAD_BYTES, _PIECE_BYTES = 2**16, 2**16
_HTTP2 = b"PRI * HTTP/2.0\r\n\r\n"
_HERE = re.compile(rb"(?:127\.0\.0\.1|localhost|\[::1\])(?::\d+)?")
_FORBIDDEN = b"HTTP/1.1 403 Forbidden\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"


class ViewerProxy:
    """Listens on 127.0.0.1, from the moment it is made; lets in once it is opened.

    Parameters
    ----------
    wanted : int
        The first port that is tried.
    tell : callable
        Told what a person should know; called from the door's thread.

    Raises
    ------
    OSError
        Fifty ports in a row are taken.
    """

    def __init__(self, wanted: int, tell: Callable[[str], None]) -> None:
        self._socket = _listening(wanted)
        self._tell = tell
        self._drawn = 0
        self._guests: list[_Guest] = []
        self.port: int = self._socket.getsockname()[1]

    def open(self, host: str, port: int) -> None:
        """Let viewers in, to the server at ``host``, ``port``."""
        serve = self._serve(host, port)
        threading.Thread(target=asyncio.run, args=(serve,), name="door", daemon=True).start()

    def close(self) -> None:
        """Let the port go; of a door that was not opened."""
        self._socket.close()

    def drawn(self, count: int) -> None:
        """So many bytes have been drawn in all; called from any thread."""
        self._drawn = count

    async def _serve(self, host: str, port: int) -> None:
        async def let_in(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            with contextlib.suppress(OSError, EOFError, asyncio.LimitOverrunError, TimeoutError):
                await self._let_in(reader, writer, host, port)
            writer.close()

        server = await asyncio.start_server(let_in, sock=self._socket, limit=_HEAD_BYTES)
        await server.start_serving()
        while True:
            await asyncio.sleep(1.0)
            self._let_go()

    async def _let_in(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, host: str, port: int
    ) -> None:
        async with asyncio.timeout(PATIENCE_S):
            head = await reader.readuntil(b"\r\n\r\n")
        if not is_welcome(head):
            writer.write(_FORBIDDEN)
            await writer.drain()
            return
        inside, outside = await asyncio.open_connection(host, port)
        outside.write(head)
        guest = _Guest(writer, self._drawn)
        self._guests.append(guest)
        ways = [
            asyncio.create_task(_pass(reader, outside, lambda count: None)),
            asyncio.create_task(_pass(inside, writer, lambda count: guest.took(count, self._drawn))),
        ]
        try:
            done, _ = await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
            for way in done:
                way.result()
        finally:
            self._guests.remove(guest)
            for way in ways:
                way.cancel()
            outside.close()

    def _let_go(self) -> None:
        for guest in self._guests:
            if guest.has_stopped(self._drawn):
                guest.writer.transport.abort()
                self._tell(f"a viewer took nothing for {PATIENCE_S:.0f} s (stopped?) and was let go")


class _Guest:
    """A connection to a viewer, and when it last took something."""

    def __init__(self, writer: asyncio.StreamWriter, drawn: int) -> None:
        self.writer = writer
        self._total, self._drawn, self._t = 0, drawn, time.monotonic()

    def took(self, count: int, drawn: int) -> None:
        self._total += count
        self._drawn, self._t = drawn, time.monotonic()

    def has_stopped(self, drawn: int) -> bool:
        missed = drawn - self._drawn > PATIENCE_BYTES and self._total > _VIEWER_BYTES
        return missed and time.monotonic() - self._t > PATIENCE_S and not self.writer.is_closing()


async def _pass(
    source: asyncio.StreamReader, sink: asyncio.StreamWriter, took: Callable[[int], None]
) -> None:
    while piece := await source.read(_PIECE_BYTES):
        sink.write(piece)
        await sink.drain()
        took(len(piece))


def is_welcome(head: bytes) -> bool:
    """Whether a connection that begins so is from a viewer, or from a page of this machine."""
    if head == _HTTP2:
        return True
    hosts = [line.partition(b":")[2].strip() for line in head.split(b"\r\n") if line[:5].lower() == b"host:"]
    return len(hosts) == 1 and _HERE.fullmatch(hosts[0].lower()) is not None


def _listening(wanted: int) -> socket.socket:
    try:
        return listening_socket(HOST, wanted, TRIES)
    except OSError:
        raise OSError(f"no free port from {wanted} on; set another view.port") from None


def hidden() -> tuple[str, int]:
    """An address and port that nobody listens on, and on Linux nobody guesses."""
    numbers = random.SystemRandom()
    host = f"127.{'.'.join(str(numbers.randint(1, 254)) for _ in range(3))}"
    with socket.socket() as probe:
        probe.bind((host if sys.platform == "linux" else HOST, 0))
        found, port = probe.getsockname()
        return str(found), int(port)


def wait_for(host: str, port: int, seconds: float = 20.0) -> None:
    """Until somebody listens there.

    Raises
    ------
    OSError
        Nobody does, after ``seconds``.
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
