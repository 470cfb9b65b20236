"""What the testing machine does over time: hold, pull to yield, pull on, hold.

Two constant strain rates, as ISO 6892-1 has them: a slow one through the elastic part, where
most is to be measured, and a faster one beyond yield. Times are seconds since the test began.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hw_mocks.machine import Machine

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Programme:
    """Strain over time, made of straight pieces.

    Attributes
    ----------
    hold_s : float, s
        At rest, for the reference burst.
    ramp_s : float, s
        Pulling.
    end_s : float, s
        At rest at the highest strain.
    knee_strain, max_strain : float
        Axial strain where the rate changes, and at the end of the ramp.
    knee : float
        Part of the ramp's time spent up to ``knee_strain``.
    machine : Machine or None
        Driven from outside; then it alone says the strain, and the times are those of the test.
    """

    hold_s: float = 2.0
    ramp_s: float = 17.0
    end_s: float = 1.0
    knee_strain: float = 2e-3
    max_strain: float = 8e-3
    knee: float = 0.6
    machine: Machine | None = None

    @property
    def duration_s(self) -> float:
        """Length of the whole test, s."""
        return self.hold_s + self.ramp_s + self.end_s

    @property
    def knee_s(self) -> float:
        """Time since the start at which the rate changes, s."""
        return self.hold_s + self.knee * self.ramp_s

    def strain(self, t: ArrayLike) -> Array:
        """Axial strain at ``t`` seconds since the start; 0 before."""
        if self.machine is not None:
            return self.machine.strain(t)
        times = (self.hold_s, self.knee_s, self.hold_s + self.ramp_s)
        return np.asarray(np.interp(np.asarray(t, float), times, (0.0, self.knee_strain, self.max_strain)))

    def progress(self, t: ArrayLike) -> Array:
        """Part of the ramp that is done, 0 to 1."""
        return np.clip((np.asarray(t, float) - self.hold_s) / self.ramp_s, 0.0, 1.0)


class TestClock:
    """When the test began, on the clock of whoever drives it; shared by both devices.

    A simulated camera claims the start, so that the hold is not spent while a view opens; without
    one, the load cell begins the test.
    """

    __test__ = False  # for pytest: not a test case

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._start: float | None = None
        self.claimed = False

    @property
    def start(self) -> float | None:
        """Monotonic seconds, or None before the test began."""
        return self._start

    def begin(self, now: float) -> float:
        """Begin at ``now`` unless the test has begun already; gives the start, s."""
        with self._lock:
            if self._start is None:
                self._start = now
            return self._start

    def elapsed(self, now: float) -> float:
        """Seconds since the start; 0 before it began."""
        return 0.0 if self._start is None else now - self._start
