"""Strain output: every measurement as a line of JSON or CSV to TCP clients, by UDP, or to a serial port.

A heartbeat tells a controller that phasedic is alive: a line at least every 0.5 s, the last measurement with its age
of now, or without strains where none is live.

Each output has its own thread and takes the newest measurement: one that stalls skips and counts, and
delays neither the measurement nor another output.
"""

from __future__ import annotations

import contextlib
import json
import math
import socket
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from acquire.errors import DeviceError, PhasedicError
from acquire.events import Event, Level
from acquire.serial_line.ports import LineSettings, open_port
from acquire.text import Message, joined
from acquire.text.message import counted
from live.config.figures import OF_SNAPSHOT
from live.pipeline.consumer import Consumer, Policy
from live.pipeline.measurement import Measurement
from live.pipeline.snapshot import AXIAL, ChannelValues
from live.run.tcp_lines import LineServer

EVERY_S = 0.4
"""After this time without a measurement comes a heartbeat: every 0.5 s with what a busy machine adds."""
_OF_NOW = [one.name for one in OF_SNAPSHOT if one.load or one.part == "age"]
"""Channels of a heartbeat that are not those of the last measurement."""
AGAIN_S = 5.0
MISSED = Message("a reader does not read, or is not there: it misses lines; end it, or let it read faster")
REOPEN_S = 1.0
"""A lost serial port is opened again at this interval."""


class LineFormat:
    """Formats the chosen channels of a measurement.

    Parameters
    ----------
    values : ChannelValues
    channels : sequence of str
    form : "json" or "csv"

    Attributes
    ----------
    heading : str
        The first line for a client, with the names; empty for JSON.
    """

    def __init__(self, values: ChannelValues, channels: Sequence[str], form: str) -> None:
        self._values, self._channels, self._json = values, tuple(channels), form == "json"
        self._last: dict[str, float] = {}
        self.heading = "" if self._json else ",".join(channels)

    def of(self, measurement: Measurement | None) -> str:
        """The line, without its end, of now where nothing is measured; an unknown value is null in JSON, nan in CSV."""
        values = self._values.read(measurement)
        self._last = self._last if measurement is None else values
        return self._line({**values, **self._values.states})

    def heartbeat(self) -> str:
        """The line of now: the last measurement and its age while it is live, else no strains."""
        now, last = self._values.read(), self._last
        if last and self._values.now.figure(AXIAL).known:
            now = now | last | {name: now[name] for name in _OF_NOW if name in now}
        return self._line({**now, **self._values.states})

    def _line(self, values: Mapping[str, float | str]) -> str:
        if not self._json:
            return ",".join(_number(values.get(channel, math.nan)) for channel in self._channels)
        rounded = {channel: _rounded(values.get(channel, math.nan)) for channel in self._channels}
        return json.dumps(rounded, separators=(",", ":"))


def _number(value: float | str) -> str:
    return str(value) if isinstance(value, int | str) else f"{value:.8g}"


def _rounded(value: float | str) -> float | str | None:
    if isinstance(value, int | str):
        return value
    return float(f"{value:.8g}") if math.isfinite(value) else None


class StrainOut(Consumer, ABC):
    """One output; ``send`` takes a line without its end, and ``to_whom`` names those who get it."""

    to_whom: str
    tell: Callable[[str, Level], None] = staticmethod(lambda text, level: None)
    _lossy = False
    policy = Policy.NEWEST
    queue_size = 2
    timeout_s = 2.0

    def __init__(self, name: str, lines: LineFormat) -> None:
        self.name, self._lines = name, lines
        self._posted: deque[str] = deque()
        self._next = self._missed_t = -math.inf  # when a heartbeat is due, and when a line was missed

    def measurement(self, measurement: Measurement) -> None:
        """Send its line."""
        self._put(self._lines.of(measurement))
        self._next = time.monotonic() + EVERY_S

    def idle(self) -> float:
        """Send a heartbeat when it is due: a client must not take the last line for the present."""
        now = time.monotonic()
        if now >= self._next:
            self._next = now + EVERY_S
            self._put(self._lines.heartbeat())
        return self._next - now

    def post(self, line: str) -> None:
        """Queue a line, from any thread; the next event sends it."""
        self._posted.append(line)

    def event(self, event: Event) -> None:
        """Send the queued lines."""
        while self._posted:
            self._put(self._posted.popleft())

    def _put(self, line: str) -> None:
        """Send a line; a reader that misses some is an error until all have come for ``AGAIN_S``."""
        arrived, now = self.send(line), time.monotonic()
        if not arrived and not self._lossy:
            self.tell(MISSED, "error")
        elif arrived and self._lossy and now > self._missed_t + AGAIN_S:
            self.tell(Message("all lines are read again"), "info")
        self.lost = self.lost or not arrived
        self._missed_t = self._missed_t if arrived else now
        self._lossy = now <= self._missed_t + AGAIN_S

    @abstractmethod
    def send(self, line: str) -> bool:
        """Send a line; False where one reader or more misses it."""


class TcpOut(StrainOut):
    """To any number of TCP clients."""

    def __init__(self, listening: socket.socket, token: str, lines: LineFormat) -> None:
        self._server = LineServer(listening, token, greeting=lines.heading)
        super().__init__(f"strain out (port {self._server.port})", lines)
        self.port = self._server.port
        self.to_whom = "to programs with the token" if token else "to every user of this machine"

    def begin(self) -> None:
        """Listen."""
        self._server.start()

    def send(self, line: str) -> bool:
        """To all clients; those that do not read are skipped."""
        return self._server.send(line)

    def end(self) -> str:
        """Close the connections."""
        self._server.close()
        server = self._server
        skipped = Message("{n} skipped by clients that did not read", server.skipped) * (server.skipped > 0)
        return joined(", ", (counted(server.served, "client"), counted(server.taken, "line"), skipped))


class UdpOut(StrainOut):
    """To one address by UDP, without confirmation."""

    def __init__(self, host: str, port: int, lines: LineFormat) -> None:
        super().__init__(f"strain out (udp {host}:{port})", lines)
        self._to = (host, port)
        self.to_whom = "to whoever listens there, unencrypted"
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._sent = self._skipped = 0

    def send(self, line: str) -> bool:
        """Send a datagram; one that the system refuses is counted."""
        try:
            self._socket.sendto(line.encode() + b"\n", self._to)
        except OSError:
            self._skipped += 1
            return False
        self._sent += 1
        return True

    def end(self) -> str:
        """Close the socket."""
        self._socket.close()
        return f"{self._sent} lines" + f", {self._skipped} refused" * (self._skipped > 0)


class SerialOut(StrainOut):
    """To a serial port, opened again after it is lost.

    Raises
    ------
    ConfigError, DeviceError
        The port cannot be opened at the start.
    """

    def __init__(self, line: LineSettings, lines: LineFormat) -> None:
        super().__init__(f"strain out ({line.url})", lines)
        self._settings = line
        self.to_whom = "to the device there"
        self._port: Any = open_port(line)
        self._lost = -float("inf")
        self._sent = self._skipped = 0
        self._sent_heading = False

    def send(self, line: str) -> bool:
        """Write; a port that takes nothing for half a second is lost, and opened again a second later."""
        if not self._sent_heading and self._lines.heading:
            line = f"{self._lines.heading}\n{line}"
        if self._port is None and time.monotonic() - self._lost > REOPEN_S:
            self._lost = time.monotonic()
            with contextlib.suppress(PhasedicError, DeviceError):
                self._port = open_port(self._settings)
        if self._port is not None and self._written(line.encode() + b"\n"):
            self._sent_heading = True
            self._sent += 1
            return True
        self._skipped += 1
        return False

    def _written(self, data: bytes) -> bool:
        try:
            self._port.write(data)
        except Exception:  # pyserial's time-out, an unplugged port: termios.error is no OSError
            self._close()
            self._lost = time.monotonic()
            return False
        return True

    def _close(self) -> None:
        if self._port is not None:
            with contextlib.suppress(Exception):
                self._port.close()
            self._port = None

    def end(self) -> str:
        """Close the port."""
        self._close()
        skipped = Message("{n} skipped, the port took nothing", self._skipped) * (self._skipped > 0)
        return joined(", ", (counted(self._sent, "line"), skipped))
