"""What a simulated indicator puts on the line at each sample, with the faults of the day.

Pure: the time is handed in. Chunks come out; between two chunks of one sample the line pauses.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hw_mocks.faults import Fault, FaultPlan
from hw_mocks.indicator import Indicator, IndicatorReading, Status


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
