"""The values of the output channels at a measurement, with the newest force."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping

from live.pipeline.measurement import Measurement, TimeStep
from live.pipeline.snapshot import Snapshot

RATE_S = 1.0
"""The strain rate is the slope of the axial strain over this time."""


class ChannelValues:
    """Computes the channels of one measurement after the other; each user has its own.

    Parameters
    ----------
    start : float, s
        Time zero, monotonic.
    snapshot : callable
        Takes a time (s, monotonic) and a TimeStep, gives the Snapshot
        (``live.pipeline.run_state.RunState.snapshot``).
    more : callable
        Gives the values of further channels.
    """

    def __init__(
        self,
        start: float,
        snapshot: Callable[[float, TimeStep], Snapshot],
        more: Callable[[], Mapping[str, float]] = dict,
    ) -> None:
        self._start, self._snapshot, self._more = start, snapshot, more
        self._recent: deque[tuple[float, float]] = deque()

    def read(self, measurement: Measurement) -> dict[str, float]:
        """All channels by name; NaN where one is not known."""
        step = measurement.time_step
        now = self._snapshot(step.t, step)
        values = {
            "time_s": step.t - self._start,
            "frame": measurement.burst.first_index,
            "axial": now.axial,
            "sigma_axial": now.sigma_axial,
            "strain_rate": self._rate(step.t, now.axial),
            "force_N": now.force_N,
            "stress_MPa": now.stress_Pa * 1e-6,
            "lost_share": 1 - step.n_valid / max(step.n_zoi, 1),
        }
        values |= {
            name: getattr(step, name) for name in ("exx", "eyy", "exy", "largest", "latency_s", "noise_GL")
        }
        for name, gauge in step.gauges.items():
            values |= {f"gauge_{name}": gauge.value, f"sigma_gauge_{name}": gauge.sigma}
        return {**values, **self._more()}

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
