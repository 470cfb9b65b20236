"""The sinks of the drawing: a server for viewers, and a file; each a rerun stream with its own rates.

Viewers reach the server through a proxy: requests of foreign web pages do not pass. The port is bound here before it
is published, so no two tests publish the same one. The server of rerun answers a request with any Host header: a web
page whose name is rebound to 127.0.0.1 could read the test. So it listens behind this proxy, on Linux at a random
address of 127.0.0.0/8. The Host of an HTTP/1 request must be this machine; browsers use HTTP/1 on a plain port, and
all requests of one connection have one Host. HTTP/2 (the viewer) passes. One that stops is disconnected.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import random
import re
import socket
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acquire.text import Message
from acquire.text.message import printable
from live.config.listen_address import listening_socket
from live.results.maps.colours import MICROSTRAIN
from live.ui.rerun.drawing.layout import blueprint
from live.ui.rerun.messages import ViewSetup, ViewTarget

HOST, TRIES = "127.0.0.1", 50
STOPPED_S, STOPPED_BYTES = 10.0, 500_000
"""A viewer that received nothing for so long while so much was drawn has stopped."""

_VIEWER_BYTES = 2**14  # a connection that received less is not a viewer of the test
_HEAD_BYTES, _PIECE_BYTES = 2**16, 2**16
_HTTP2 = b"PRI * HTTP/2.0\r\n\r\n"
_HERE = re.compile(rb"(?:127\.0\.0\.1|localhost|\[::1\])(?::\d+)?")
_FORBIDDEN = b"HTTP/1.1 403 Forbidden\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"

APPLICATION = "phasedic"
SERVER_MIB = 64
"""What a viewer that connects late can still get; beyond it the oldest pictures and maps are dropped."""

FINISHED_MIB = 768
"""For a finished test, where everything is kept: ``live.commands.show`` selects no more than that."""

RRD_LIMIT_BYTES = 1e9
_FLUSH_S = 10.0


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


@dataclass(frozen=True, slots=True)
class Rates:
    """How much goes to one sink per second of the test, and in total.

    Attributes
    ----------
    picture_hz, map_hz, row_hz : float, 1/s
        Pictures, maps, and parcels of rows (means and loads, all of them).
    gather_s : float, s
        What is drawn of one entity in this time is sent together; a file of a killed test lacks the last of it.
    parcel_bytes : int
        A parcel is sent when it reaches this size; large ones fragment the memory, which then grows by as much as
        is written.
    limit_bytes : float
        Pictures and maps stop when their total reaches this; the curves continue.
    repeat_bytes : float
        The curves are sent again from their beginning each time so much was drawn: a server drops the oldest
        data, and a viewer that connects later must show the whole test.
    """

    picture_hz: float
    map_hz: float
    row_hz: float = 10.0
    gather_s: float = 0.1
    parcel_bytes: int = 2**20
    limit_bytes: float = math.inf
    repeat_bytes: float = math.inf


ALL = Rates(math.inf, math.inf)
"""Everything is drawn."""


class RerunSink:
    """One stream, and how much was drawn into it.

    Parameters
    ----------
    stream : rerun.RecordingStream
    rates : Rates
    proxy : ViewerProxy, optional
        Told the total of bytes of pictures and maps.

    Attributes
    ----------
    drawn_bytes : int
        Of pictures and maps.
    """

    def __init__(self, stream: Any, rates: Rates, proxy: ViewerProxy | None = None) -> None:
        self.stream, self._rates, self._proxy = stream, rates, proxy
        self._hz = {
            "picture": rates.picture_hz,
            "map": rates.map_hz,
            "more": rates.map_hz / 4,
            "figures": min(4.0, 5 * rates.row_hz),
            "rows": rates.row_hz,
        }
        self._last_t = dict.fromkeys(self._hz, -math.inf)
        self._rows: dict[str, list[Sequence[float]]] = {}
        self.drawn_bytes = self._repeated_at = 0

    def count(self, data: bytes) -> None:
        """Count the bytes of a picture or map."""
        self.drawn_bytes += len(data)
        if self._proxy is not None:
            self._proxy.drawn(self.drawn_bytes)

    def takes(self, kind: str, t: float) -> bool:
        """Whether a "picture", "map", "more" (maps), "figures" or "rows" at ``t`` (s) is due; if so, it is drawn."""
        full = self.drawn_bytes >= self._rates.limit_bytes and kind not in ("rows", "figures")
        if full or t - self._last_t[kind] < 0.999 / self._hz[kind]:
            return False
        self._last_t[kind] = t
        return True

    def lacks(self, kind: str, t: float) -> bool:
        """Whether the last of that kind is older than ``t`` (s)."""
        return self._last_t[kind] < t

    def needs_curves_again(self) -> bool:
        """Whether ``repeat_bytes`` were drawn since the curves were sent."""
        if self.drawn_bytes - self._repeated_at < self._rates.repeat_bytes:
            return False
        self._repeated_at = self.drawn_bytes
        return True

    def add_row(self, path: str, row: Sequence[float]) -> None:
        """Keep (time, value ...) until rows are due."""
        self._rows.setdefault(path, []).append(row)

    def send_rows(self) -> None:
        """Draw all waiting rows."""
        kept, self._rows = self._rows, {}
        for path, rows in kept.items():
            self.send(path, rows)

    def send(self, path: str, rows: Sequence[Sequence[float]]) -> None:
        """Draw rows."""
        import rerun as rr

        if rows:
            times, *values = np.array(rows, np.float64).T
            self.stream.send_columns(path, [rr.TimeColumn("time", duration=times)], _columns(path, values))

    def close(self) -> str:
        """Send everything, and close the stream; why that failed, as on a full disk, else nothing."""
        try:
            self.stream.flush(timeout_sec=_FLUSH_S)
        except RuntimeError as error:
            return str(error)
        finally:
            self.stream.disconnect()
        return ""


def _columns(path: str, values: Sequence[Any]) -> Any:
    """The columns of rerun for the rows of an entity."""
    import rerun as rr

    if path == "load/force":
        return rr.Scalars.columns(scalars=values[0])
    means, sigmas = (value * MICROSTRAIN.factor for value in values)
    return rr.Measurements.columns(values=means, variances=sigmas**2)


def serve(setup: ViewSetup, target: ViewTarget, notify: Callable[[str], None]) -> tuple[RerunSink, int]:
    """A sink that serves viewers, and its port.

    Raises
    ------
    OSError
        No port is free.
    """
    import rerun as rr

    wanted = target.port or 0
    proxy = ViewerProxy(wanted, notify)
    if wanted and proxy.port != wanted:
        notify(Message("port {wanted} is taken; the view is on {port}", wanted, proxy.port))
    host, port = hidden_address()
    memory = FINISHED_MIB if setup.finished else SERVER_MIB
    live = Rates(setup.picture_hz, 1.0 if setup.light else 10.0, repeat_bytes=SERVER_MIB * 2**20 / 4)
    rates = ALL if setup.finished else live
    server = rr.GrpcServerSink(host, port, server_memory_limit=f"{memory}MiB")
    sink = _sink(server, setup, target.recording, rates, proxy)
    wait_for(host, port)
    proxy.open(host, port)
    return sink, proxy.port


def write(setup: ViewSetup, target: ViewTarget) -> RerunSink:
    """A sink that writes a file.

    Raises
    ------
    OSError
        It exists already, or cannot be created.
    """
    import rerun as rr

    path = Path(target.rrd or "")
    with path.open("xb"):  # rerun overwrites
        pass
    rates = (
        ALL
        if setup.finished
        else Rates(1.0, 2.0, 0.1, gather_s=20.0, parcel_bytes=2**16, limit_bytes=RRD_LIMIT_BYTES)
    )
    # The footer lists every parcel and is kept in memory until the end: 16 to 27 MiB for a file of 1 GB.
    file = rr.FileSink(str(path), write_footer=setup.finished)
    # Two streams with one name in a process would be one stream.
    return _sink(file, setup, f"{target.recording}-file", rates)


def _sink(
    rerun_sink: Any,
    setup: ViewSetup,
    recording: str,
    rates: Rates,
    proxy: ViewerProxy | None = None,
) -> RerunSink:
    import rerun as rr

    parcels = rr.ChunkBatcherConfig(flush_tick=rates.gather_s, flush_num_bytes=rates.parcel_bytes)
    stream = rr.RecordingStream(APPLICATION, recording_id=recording, batcher_config=parcels)
    stream.set_sinks(rerun_sink)
    stream.send_recording_name(printable(setup.title))
    stream.send_blueprint(blueprint(setup))
    return RerunSink(stream, rates, proxy)
