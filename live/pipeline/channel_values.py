"""The values of the output channels at a measurement or at any moment, with the newest force."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Mapping

from live.config.figures import OF_SNAPSHOT, attributes
from live.pipeline.measurement import Measurement, TimeStep
from live.pipeline.snapshot import AXIAL, FORCE, Snapshot

_OF_STEP, _OF_BURST = attributes("step", channel=True), attributes("burst", channel=True)
RATE_S = 1.0
"""The strain rate is the slope of the axial strain over this time."""


class ChannelValues:
    """Computes the channels of one measurement after the other; each user has its own.

    Parameters
    ----------
    start : float, s
        Time zero, monotonic.
    snapshot : callable
        Takes a time (s, monotonic) and a TimeStep or None, gives the Snapshot
        (``live.pipeline.run_state.RunState.snapshot``).
    more : callable
        Gives the values of further channels.
    clock : callable giving monotonic seconds

    Attributes
    ----------
    now : Snapshot
        That of the last reading.
    """

    def __init__(
        self,
        start: float,
        snapshot: Callable[[float, TimeStep | None], Snapshot],
        more: Callable[[], Mapping[str, float]] = dict,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._start, self._snapshot, self._more, self._clock = start, snapshot, more, clock
        self._recent: deque[tuple[float, float]] = deque()
        self.now = Snapshot(math.nan)

    def read(self, measurement: Measurement | None = None) -> dict[str, float]:
        """All channels by name, NaN where one is not known; without a measurement those of this moment."""
        step = None if measurement is None else measurement.time_step
        self.now = now = self._snapshot(self._clock(), step)
        values = {one.name: getattr(now.figure(one.of), one.part) / one.one for one in OF_SNAPSHOT}
        values |= {"time_s": (now.t if step is None else step.t) - self._start, **now.cycles}
        if measurement is not None and step is not None:
            values |= {name: getattr(step, of) for name, of in _OF_STEP.items()}
            values |= {name: getattr(measurement.burst, of) for name, of in _OF_BURST.items()}
            values["strain_rate"] = self._rate(step.t, now.figure(AXIAL).value)
            for name in (f"gauge_{gauge}" for gauge in step.gauges):
                figure = now.figure(name)
                values |= {name: figure.value, f"sigma_{name}": figure.sigma}
        return {**values, **self._more()}

    @property
    def states(self) -> dict[str, str]:
        """The channels that are words, of the last reading."""
        return {"state": str(self.now.figure(AXIAL).state), "force_state": str(self.now.figure(FORCE).state)}

    def _rate(self, t: float, axial: float) -> float:
        """The slope of the least-squares line through the last second, three points or more."""
        if math.isnan(axial):
            return math.nan
        if not self._recent or t > self._recent[-1][0]:
            self._recent.append((t, axial))
        while len(self._recent) > 3 and self._recent[0][0] < t - RATE_S:
            self._recent.popleft()
        if len(self._recent) < 3:
            return math.nan
        mean_t = math.fsum(at for at, _ in self._recent) / len(self._recent)
        spread = math.fsum((at - mean_t) ** 2 for at, _ in self._recent)
        return math.fsum((at - mean_t) * e for at, e in self._recent) / spread if spread > 0 else math.nan
