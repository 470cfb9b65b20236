"""A serial port and a clock that are not there: a script of what happens, played read by read."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from acquire.addresses import parse_address
from acquire.errors import DeviceError
from acquire.events import Event, EventKind
from acquire.load_sample import LoadFlag, LoadSample
from acquire.serial_line.cell import SerialCell
from acquire.serial_line.ports import LineSettings
from acquire.serial_line.settings import read_settings

FIRST = b"partial\r\n"
"""The first line, which may have lost its beginning."""
SILENCE = b""
STALL = b"stall"
"""Nothing for four seconds."""
QUICK = b"3 N\r\n"
"""A line that comes a third of a millisecond after the one before."""
PACES = {SILENCE: 0.0, STALL: 4.0, QUICK: 1 / 3000}


class FakeTime:
    """A clock that only moves when somebody waits."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


class FakePort:
    """Plays ``script``: bytes arrive (after ``pace`` seconds), silence lasts the read time-out, errors are raised.

    After the script ``ends`` is called and silence reigns.
    """

    def __init__(
        self,
        time: FakeTime,
        script: list[bytes | Exception],
        *,
        pace: float = 0.01,
        answers: dict[bytes, bytes] | None = None,
    ) -> None:
        self._time, self._script, self._pace = time, list(script), pace
        self._buffer = bytearray()
        self._answers = answers or {}
        self.sent: list[bytes] = []
        self.closed = 0
        self.timeout = 0.1
        self.finished = False

    def receive(self, limit: int, /, *, wait: bool = True) -> bytes:
        if not self._buffer and wait:
            self._next()
        taken, self._buffer = self._buffer[:limit], self._buffer[limit:]
        return bytes(taken)

    def wake(self) -> None:
        pass

    def _next(self) -> None:
        if not self._script:
            self.finished = True
            self._time.sleep(self.timeout)
            return
        item = self._script.pop(0)
        if isinstance(item, Exception):
            raise item
        self._time.sleep(PACES.get(item, self._pace) if item else self.timeout)
        self._buffer += b"" if item is STALL else item

    def write(self, data: bytes, /) -> int:
        self.sent.append(data)
        self._buffer += self._answers.get(data, b"")
        return len(data)

    def close(self) -> None:
        self.closed += 1


class FakeLine:
    """A serial cell on fake ports, its events, and a way to run it to the end of the script.

    Each port of ``ports`` is handed out once; an exception among them is what opening raises.
    """

    def __init__(
        self, *scripts: list[bytes | Exception] | Exception, address: str = "", wait: str = "0", **port: Any
    ) -> None:
        self.time = FakeTime()
        self.events: list[Event] = []
        self.opened: list[LineSettings] = []
        self.ports = [s if isinstance(s, Exception) else FakePort(self.time, s, **port) for s in scripts]
        self._left = list(self.ports)
        separator = "&" if "?" in address else "?"
        settings = read_settings(parse_address(f"{address or '/dev/fake?unit=N'}{separator}wait={wait}"))
        self.cell = SerialCell(
            settings, self.events.append, opener=self._open, clock=self.time, sleep=self.time.sleep
        )

    def _open(self, line: LineSettings) -> FakePort:
        self.opened.append(line)
        if not self._left:
            raise DeviceError("no more ports in this test")
        port = self._left.pop(0)
        if isinstance(port, Exception):
            raise port
        port.timeout = line.read_timeout_s
        return port

    def run(self, silences: int = 2) -> list[LoadSample]:
        """All samples until the last port has nothing more to say, and then some silence."""
        with self.cell:
            return list(self._until_the_end(silences))

    def _until_the_end(self, silences: int) -> Iterator[LoadSample]:
        last = self.ports[-1]
        quiet = 0
        while quiet <= silences:
            yield from self.cell._pass()
            quiet += isinstance(last, FakePort) and last.finished

    def passes(self, count: int) -> list[LoadSample]:
        """The samples of so many rounds."""
        return [sample for _ in range(count) for sample in self.cell._pass()]

    @property
    def port(self) -> FakePort:
        """The first port."""
        first = self.ports[0]
        assert isinstance(first, FakePort)
        return first

    @property
    def told(self) -> list[str]:
        """The sentences of the events."""
        return [event.text for event in self.events]

    @property
    def tares(self) -> list[Event]:
        return [event for event in self.events if event.kind is EventKind.TARE]


def samples_of(*chunks: bytes, address: str = "") -> list[LoadSample]:
    """What is read of these bytes behind a first line."""
    return FakeLine([FIRST, *chunks], address=address).run()


def flagged(samples: list[LoadSample], flag: LoadFlag) -> list[bool]:
    """Which of them have the flag."""
    return [flag in sample.flags for sample in samples]
