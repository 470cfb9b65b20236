"""What all simulated indicators share: a display, a tare memory, commands in and lines out; and the simplest of them.

A dialect defines a reading on the line and the answers to commands; ``hw_mocks.sim_indicators`` has
those of real devices. ``AsciiIndicator`` is the free text of microcontroller sketches: it sends unasked and takes
no commands. Pure: bytes in, bytes out, no clock.

At each sample an indicator puts chunks on the line, with the faults of the day; between two chunks of one sample the
line pauses. The time is handed in.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from hw_mocks.sim_settings import Fault, FaultPlan

Status = Literal["ok", "overload", "underload", "error"]
NEWTONS = {"N": 1.0, "kN": 1e3, "lbF": 4.4482216153, "kgF": 9.80665, "kg": 9.80665, "g": 9.80665e-3}
MAX_COMMAND = 256

Style = Literal["millis", "plain", "label", "openscale"]
SATURATED = {"overload": 8388607, "underload": -8388608}  # of a 24-bit converter
COUNTS_PER_N = 800
TEMPERATURE = 21.5


@dataclass(frozen=True, slots=True)
class IndicatorReading:
    """The state of the indicator at one instant.

    Attributes
    ----------
    force : float, N
        Gross, tension positive, noise included.
    ms : float, ms
        Since the indicator was switched on.
    stable : bool
    status : "ok" | "overload" | "underload" | "error"
    foreign_unit : bool
        The display was switched to another unit.
    """

    force: float
    ms: float = 0.0
    stable: bool = True
    status: Status = "ok"
    foreign_unit: bool = False


class Indicator(ABC):
    """One simulated indicator.

    Parameters
    ----------
    resolution : float, N
        Step of the display.
    unit : str
        Shown on the line where the dialect has units.

    Attributes
    ----------
    left : float
        Lines still to be sent unasked; infinite: continuous output.
    rate : float or None, 1/s
        Of unasked lines where a command has set it.
    offset : float, N
        What tare has taken off.
    """

    name: ClassVar[str]
    line: ClassVar[tuple[int, int, str]] = (9600, 8, "N")  # baud, bits, parity
    ends: ClassVar[bytes] = b"\r\n"
    unasked: ClassVar[bool] = False
    foreign: ClassVar[str] = "kN"
    banner: ClassVar[bytes] = b""

    def __init__(self, resolution: float = 0.1, unit: str = "N") -> None:
        self.resolution, self.unit = resolution, unit
        self.restart()

    def restart(self) -> None:
        """As after switching on."""
        self._partial = b""
        self.left = math.inf if self.unasked else 0.0
        self.rate: float | None = None
        self.offset = 0.0

    @abstractmethod
    def render(self, shown: IndicatorReading) -> bytes:
        """A reading as it goes over the line, its end included."""

    def answer(self, command: bytes, shown: IndicatorReading) -> bytes:
        """The answer to a command (without its end); b"" for none."""
        return b""

    def receive(self, data: bytes, shown: IndicatorReading) -> bytes:
        """Take bytes from the host in any pieces; the answers to the commands they complete."""
        answers = []
        for byte in data:
            if byte in self.ends:
                command, self._partial = self._partial, b""
                if command:
                    answers.append(self.answer(command, shown))
            else:
                self._partial = (self._partial + bytes([byte]))[-MAX_COMMAND:]
        return b"".join(answers)

    def net(self, shown: IndicatorReading) -> float:
        """Force less tare, rounded to the display, N."""
        steps = round((shown.force - self.offset) / self.resolution)
        return steps * self.resolution

    def displayed(self, shown: IndicatorReading) -> tuple[str, str]:
        """The number as text and its unit."""
        unit = self.foreign if shown.foreign_unit else self.unit
        step = self.resolution / NEWTONS[unit]
        return f"{self.net(shown) / NEWTONS[unit]:.{decimals(step)}f}", unit

    def tare(self, shown: IndicatorReading) -> None:
        """Make the present load zero."""
        self.offset = shown.force


def decimals(step: float) -> int:
    """Digits after the point that a step needs."""
    return max(0, math.ceil(-math.log10(step) - 1e-9))


class AsciiIndicator(Indicator):
    """Parameters as ``Indicator``, and the style of its lines.

    - millis: ``12345,0.512,N``
    - plain: ``0.512 N``
    - label: ``Reading: 0.512 N``
    - openscale: ``12345,0.512,N,409,21.5,``
    """

    name = "ascii"
    line = (115200, 8, "N")
    unasked: ClassVar[bool] = True
    banner: ClassVar[bytes] = b"\r\nSerial load cell, press x for menu\r\nReadings:\r\n"

    def __init__(self, resolution: float = 0.1, unit: str = "N", style: Style = "millis") -> None:
        super().__init__(resolution, unit)
        self._style = style

    def render(self, shown: IndicatorReading) -> bytes:
        """See ``Indicator``; a saturated converter shows its end value."""
        value, unit = self.displayed(shown)
        if shown.status in SATURATED and self._style != "openscale":
            value = str(SATURATED[shown.status])
        if shown.status == "error":
            value = "nan"
        return (self._text(shown, value, unit) + "\r\n").encode()

    def _text(self, shown: IndicatorReading, value: str, unit: str) -> str:
        if self._style == "plain":
            return f"{value} {unit}"
        if self._style == "label":
            return f"Reading: {value} {unit}"
        if self._style == "millis":
            return f"{shown.ms:.0f},{value},{unit}"
        raw = SATURATED.get(shown.status, round(shown.force * COUNTS_PER_N))
        return f"{shown.ms:.0f},{value},{unit},{raw},{TEMPERATURE},"


@dataclass(frozen=True, slots=True, eq=False)
class Sensing:
    """What the indicator measures and how well.

    Attributes
    ----------
    force : callable
        N, tension positive, at a time on the indicator's clock, s.
    elapsed : callable
        Seconds since the test began at such a time; faults are due by it.
    rate : float, 1/s
    noise_N : float, N
        Standard deviation, white.
    capacity_N : float, N
        Beyond it the display shows overload or underload.
    """

    force: Callable[[float], float]
    elapsed: Callable[[float], float]
    rate: float = 80.0
    noise_N: float = 1.0
    capacity_N: float = 10_000.0


class IndicatorOutput:
    """Turns instants into bytes.

    Parameters
    ----------
    indicator : Indicator
    sensing : Sensing
    boot : float, s
        When it was switched on.
    seed : int
    faults : FaultPlan
    """

    def __init__(
        self,
        indicator: Indicator,
        sensing: Sensing,
        boot: float,
        seed: int = 0,
        faults: FaultPlan | None = None,
    ) -> None:
        self._indicator, self._sensing, self._boot = indicator, sensing, boot
        self._rng = np.random.default_rng(seed)
        self._faults = faults or FaultPlan()
        self._held: list[bytes] = []
        self._left = {"duplicate": 0.0, "split": 0.0, "partial": 0.0}
        self._slowdown = 1.0

    def interval(self, t: float) -> float:
        """Seconds from the sample at ``t`` to the next."""
        if fault := self._faults.begun("rate", self._sensing.elapsed(t)):
            self._slowdown = max(fault.amount, 1e-3)
        return 1 / ((self._indicator.rate or self._sensing.rate) * self._slowdown)

    def unplugged(self, t: float) -> bool:
        """Whether the port is out at ``t``."""
        return self._faults.lasting("unplug", self._sensing.elapsed(t)) is not None

    def shown(self, t: float) -> IndicatorReading:
        """The display at ``t``, with fresh noise."""
        e, s = self._sensing.elapsed(t), self._sensing
        force = s.force(t) + s.noise_N * float(self._rng.standard_normal())
        status: Status = "ok"
        if force > s.capacity_N or self._faults.lasting("overload", e):
            status = "overload"
        elif force < -s.capacity_N:
            status = "underload"
        stable = self._faults.lasting("unstable", e) is None
        return IndicatorReading(
            force, (t - self._boot) * 1e3, stable, status, self._faults.lasting("unit", e) is not None
        )

    def answers(self, data: bytes, t: float) -> bytes:
        """The answers to what the host sent."""
        if self._faults.lasting("silence", self._sensing.elapsed(t)):
            return b""
        return self._worn(self._indicator.receive(data, self.shown(t)), t)

    def sample(self, t: float) -> list[bytes]:
        """What goes out at the sample of ``t``; empty while the indicator is not sending."""
        e = self._sensing.elapsed(t)
        before = self._interruptions(t, e)
        if self._indicator.left <= 0 or self._faults.lasting("silence", e):
            return [before] if before else []
        self._indicator.left -= 1
        line = self._worn(self._indicator.render(self.shown(t)), t)
        if self._faults.lasting("late", e):
            self._held.append(line)
            return []
        held, self._held = b"".join(self._held), []
        return self._cut(before + held, line, e)

    def _worn(self, line: bytes, t: float) -> bytes:
        """The lasting faults of the writing."""
        e = self._sensing.elapsed(t)
        if self._faults.lasting("comma", e):
            line = line.replace(b".", b",")
        if self._faults.lasting("cr", e):
            line = line.replace(b"\r\n", b"\r")
        return line

    def _interruptions(self, t: float, e: float) -> bytes:
        """What comes in between two lines."""
        parts = []
        if self._faults.begun("reset", e):
            self._boot = t
            self._indicator.restart()
            parts.append(self._indicator.banner)
        if fault := self._faults.begun("jump", e):
            self._boot -= fault.amount
        if fault := self._faults.begun("garbage", e):
            parts.append(self._rng.bytes(int(fault.amount)))
        if fault := self._faults.begun("nul", e):
            parts.append(bytes(int(fault.amount)))
        if fault := self._faults.begun("backlog", e):
            parts.extend(self._old(fault, t))
        return b"".join(parts)

    def _old(self, fault: Fault, t: float) -> list[bytes]:
        dt = self.interval(t)
        return [
            self._indicator.render(self.shown(t - k * dt)) for k in range(round(fault.amount / dt), 0, -1)
        ]

    def _cut(self, before: bytes, line: bytes, e: float) -> list[bytes]:
        """The faults of single lines."""
        if self._counts("partial", e):
            line = line[len(line) // 2 :]
        if self._counts("duplicate", e):
            line += line
        if self._counts("split", e):
            middle = len(line) // 2
            return [before + line[:middle], line[middle:]]
        return [before + line]

    def _counts(self, name: str, e: float) -> bool:
        """Whether the fault takes this line."""
        while fault := self._faults.begun(name, e):
            self._left[name] += fault.amount
        taken = self._left[name] >= 1
        self._left[name] -= taken
        return taken
