"""The values of the channels at a measurement, with the load as it is known at once."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from live.pipeline.measurement import Measurement, TimeStep
from live.pipeline.snapshot import Snapshot

RATE_S = 1.0
"""The strain rate is the slope of the axial strain over this time."""


class ChannelValues:
    """Reads the channels of one measurement after the other; one for each who asks.

    Parameters
    ----------
    start : float, s
        Time zero, monotonic.
    snapshot : callable
        Takes a time (s, monotonic) and a TimeStep, gives the Snapshot
        (``live.pipeline.run_state.RunState.snapshot``).
    """

    def __init__(self, start: float, snapshot: Callable[[float, TimeStep], Snapshot]) -> None:
        self._start, self._snapshot = start, snapshot
        self._course: deque[tuple[float, float]] = deque()

    def read(self, measurement: Measurement) -> dict[str, float]:
        """All channels by name; NaN where one is not known."""
        i = measurement.time_step
        now = self._snapshot(i.t, i)
        values = {
            "time_s": i.t - self._start,
            "frame": measurement.burst.first_index,
            "axial": now.axial,
            "sigma_axial": now.sigma_axial,
            "strain_rate": self._rate(i.t, now.axial),
            "force_N": now.force_N,
            "stress_MPa": now.stress_Pa * 1e-6,
            "lost_share": 1 - i.n_valid / max(i.n_zoi, 1),
        }
        values |= {
            name: getattr(i, name) for name in ("exx", "eyy", "exy", "largest", "latency_s", "noise_GL")
        }
        for name, gauge in i.gauges.items():
            values |= {f"gauge_{name}": gauge.value, f"sigma_gauge_{name}": gauge.sigma}
        return values

    def _rate(self, t: float, axial: float) -> float:
        """The slope of the least-squares line through the last second, three points or more."""
        if math.isnan(axial):
            return math.nan
        if not self._course or t > self._course[-1][0]:
            self._course.append((t, axial))
        while len(self._course) > 3 and self._course[0][0] < t - RATE_S:
            self._course.popleft()
        if len(self._course) < 3:
            return math.nan
        middle = math.fsum(at for at, _ in self._course) / len(self._course)
        spread = math.fsum((at - middle) ** 2 for at, _ in self._course)
        return math.fsum((at - middle) * e for at, e in self._course) / spread if spread > 0 else math.nan
