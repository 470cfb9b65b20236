"""What all simulated indicators share: a display, a tare memory, commands in and lines out.

A dialect says how a reading looks on the line and what it answers; ``hw_mocks.sim_indicators`` has
those of real devices. Pure: bytes in, bytes out, no clock.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

Status = Literal["ok", "overload", "underload", "error"]
NEWTONS = {"N": 1.0, "kN": 1e3, "lbF": 4.4482216153, "kgF": 9.80665, "kg": 9.80665, "g": 9.80665e-3}
LONGEST_COMMAND = 256


@dataclass(frozen=True, slots=True)
class Shown:
    """What the indicator has to say at one instant.

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
    def render(self, shown: Shown) -> bytes:
        """A reading as it goes over the line, its end included."""

    def answer(self, command: bytes, shown: Shown) -> bytes:
        """The answer to a command (without its end); b"" for none."""
        return b""

    def receive(self, data: bytes, shown: Shown) -> bytes:
        """Take bytes from the host in any pieces; the answers to the commands they complete."""
        answers = []
        for byte in data:
            if byte in self.ends:
                command, self._partial = self._partial, b""
                if command:
                    answers.append(self.answer(command, shown))
            else:
                self._partial = (self._partial + bytes([byte]))[-LONGEST_COMMAND:]
        return b"".join(answers)

    def net(self, shown: Shown) -> float:
        """Force less tare, rounded to the display, N."""
        steps = round((shown.force - self.offset) / self.resolution)
        return steps * self.resolution

    def displayed(self, shown: Shown) -> tuple[str, str]:
        """The number as text and its unit."""
        unit = self.foreign if shown.foreign_unit else self.unit
        step = self.resolution / NEWTONS[unit]
        return f"{self.net(shown) / NEWTONS[unit]:.{decimals(step)}f}", unit

    def tare(self, shown: Shown) -> None:
        """Make the present load zero."""
        self.offset = shown.force


def decimals(step: float) -> int:
    """Digits after the point that a step needs."""
    return max(0, math.ceil(-math.log10(step) - 1e-9))
