"""The values of the channels at a measurement, with the load as it is known at once."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import Protocol

from live.measure import AxisFinder, Instant, Measurement

RATE_S = 1.0
"""The strain rate is the slope of the axial strain over this time."""


class Sample(Protocol):
    """What is used of a load sample."""

    @property
    def force(self) -> float: ...


class Readings:
    """Reads the channels of one measurement after the other; one for each who asks.

    Parameters
    ----------
    start : float, s
        Time zero, monotonic.
    axis : "x", "y" or "auto"
        Of the load; auto: as the strains tell it, y until then.
    area_m2 : float or None, m^2
    latest : callable giving LoadSample or None
    """

    def __init__(
        self, start: float, axis: str, area_m2: float | None, latest: Callable[[], Sample | None]
    ) -> None:
        self._start, self._area_m2, self._latest = start, area_m2, latest
        self._axis = AxisFinder(axis)
        self._course: deque[tuple[float, float]] = deque()

    def read(self, measurement: Measurement) -> dict[str, float]:
        """All channels by name; NaN where one is not known."""
        i = measurement.instant
        self._axis.add(i)
        axial, sigma = self._axial(i)
        values = {
            "time_s": i.t - self._start,
            "frame": measurement.burst.first_index,
            "axial": axial,
            "sigma_axial": sigma,
            "strain_rate": self._rate(i.t, axial),
            **self.load(i.force),
            "lost_share": 1 - i.n_valid / max(i.n_zoi, 1),
        }
        values |= {
            name: getattr(i, name) for name in ("exx", "eyy", "exy", "largest", "latency_s", "noise_GL")
        }
        for name, gauge in i.gauges.items():
            values |= {f"gauge_{name}": gauge.value, f"sigma_gauge_{name}": gauge.sigma}
        return values

    def _axial(self, i: Instant) -> tuple[float, float]:
        gauge = i.gauges.get("axial")
        if gauge is not None:
            return gauge.value, gauge.sigma
        mean = f"e{self._axis.axis * 2}"
        return getattr(i, mean), getattr(i, f"sigma_{mean}")

    def load(self, without: float = math.nan) -> dict[str, float]:
        """Force and stress of the newest sample; where there is none, of the force ``without`` (N)."""
        sample = self._latest()
        force = without if sample is None else sample.force
        return {
            "force_N": force,
            "stress_MPa": force / self._area_m2 * 1e-6 if self._area_m2 else math.nan,
        }

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
