"""Waiting for the force: a measurement is settled once its force can no longer change.

The force at a time is final when the load log reaches past it. Until then a measurement waits, at
most ``HOLD_S`` of measured time, so that files and curves say what a replay will say.
"""

from __future__ import annotations

from collections import deque
from typing import Protocol

from live.measure.measurement import Measurement

HOLD_S = 2.0
"""Measurements wait for their force at most this long, in measured time."""


class Loads(Protocol):
    """What is asked of a load log (``acquire.load_cell.LoadLog``)."""

    def force_at(self, t: float) -> float: ...

    def raw_force_at(self, t: float) -> float: ...

    def zero_at(self, t: float) -> float: ...

    def covers(self, t: float) -> bool: ...


class Settling:
    """Holds measurements until their force is final.

    Parameters
    ----------
    loads : LoadLog
    hold_s : float, s
    """

    def __init__(self, loads: Loads, hold_s: float = HOLD_S) -> None:
        self._loads, self._hold_s = loads, hold_s
        self._held: deque[Measurement] = deque()

    def __len__(self) -> int:
        """Measurements that still wait."""
        return len(self._held)

    def add(self, measurement: Measurement) -> list[Measurement]:
        """Take one measurement; those that are settled by now, in order, with their force."""
        self._held.append(measurement)
        settled = []
        while self._held and self._is_final(self._held[0], measurement.t):
            settled.append(self._with_force(self._held.popleft()))
        return settled

    def rest(self) -> list[Measurement]:
        """All that still wait, with the force as far as it is known."""
        held, self._held = self._held, deque()
        return [self._with_force(measurement) for measurement in held]

    def _is_final(self, measurement: Measurement, newest_t: float) -> bool:
        return self._loads.covers(measurement.t) or newest_t - measurement.t > self._hold_s

    def _with_force(self, measurement: Measurement) -> Measurement:
        t = measurement.t
        return measurement.with_force(
            self._loads.force_at(t), self._loads.raw_force_at(t), self._loads.zero_at(t)
        )
