"""What all simulated indicators share: a display, a tare memory, commands in and lines out; and the simplest of them.

A dialect defines a reading on the line and the answers to commands; ``hw_mocks.sim_indicators`` has
those of real devices. ``AsciiIndicator`` is the free text of microcontroller sketches: it sends unasked and takes
no commands. Pure: bytes in, bytes out, no clock.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

Status = Literal["ok", "overload", "underload", "error"]
NEWTONS = {"N": 1.0, "kN": 1e3, "lbF": 4.4482216153, "kgF": 9.80665, "kg": 9.80665, "g": 9.80665e-3}
MAX_COMMAND = 256


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


Style = Literal["millis", "plain", "label", "openscale"]
SATURATED = {"overload": 8388607, "underload": -8388608}  # of a 24-bit converter
COUNTS_PER_N = 800
TEMPERATURE = 21.5


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
