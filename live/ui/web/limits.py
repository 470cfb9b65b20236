"""How near the figures of the page are to the limits of their alarms."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

from live.config.figures import figure_of
from live.config.sections import AlarmConfig
from live.pipeline.snapshot import AXIAL

NEAR, SOON_S = 0.9, 10.0
"""A figure is near its limit from this share of it, or where it reaches it within this time at the present rate."""
RATE_S, LEAST_S = 2.0, 0.5
"""The rate is that of the last ``RATE_S``; over less than ``LEAST_S`` there is none."""


class FigureLimits:
    """The limits of force, stress and axial strain of one test; for one thread.

    Parameters
    ----------
    alarms : sequence of AlarmConfig
    """

    def __init__(self, alarms: Sequence[AlarmConfig]) -> None:
        self._alarms = alarms
        self._last: deque[tuple[float, Mapping[str, float]]] = deque()
        self._beyond = [False] * len(alarms)

    def add(self, t: float, values: Mapping[str, float]) -> None:
        """The figures by name at ``t``, s, in SI units."""
        self._last.append((t, values))
        while t - self._last[0][0] > RATE_S:
            self._last.popleft()

    def rate(self, name: str) -> float:
        """Rate of a figure, 1/s; NaN where it is not known."""
        known = [(t, values[name]) for t, values in self._last if math.isfinite(values[name])]
        if len(known) < 2 or known[-1][0] - known[0][0] < LEAST_S:
            return math.nan
        return (known[-1][1] - known[0][1]) / (known[-1][0] - known[0][0])

    def of(self, name: str, value: float, axial_name: str = "") -> dict[str, Any] | None:
        """The limit that the figure is nearest to; None without one, and of a figure that is not known.

        Returns
        -------
        dict
            value (SI), share of it, near, beyond, and ends: the alarm ends the test.
        """
        found = [self._one(k, name, value, axial_name) for k in range(len(self._alarms))]
        return max((one for one in found if one), key=lambda one: float(one["share"]), default=None)

    @staticmethod
    def of_range(force: float, range_N: float) -> dict[str, Any] | None:
        """The range of the load cell in place of a limit; None where force or range is not known."""
        share = abs(force) / range_N
        if not math.isfinite(share):
            return None
        return {
            "value": range_N, "share": share, "near": share >= NEAR, "beyond": False, "ends": False, "range": True,
        }  # fmt: skip

    def _one(self, k: int, name: str, value: float, axial_name: str) -> dict[str, Any] | None:
        alarm = self._alarms[k]
        own = {axial_name, f"gauge_{axial_name}"} if axial_name else set()
        channel = figure_of(AXIAL if alarm.channel in own else alarm.channel)
        unit = channel.one
        if (channel.of, channel.part) != (name, "value") or not math.isfinite(value):
            return None
        sign, limit = (1.0, alarm.above) if alarm.above is not None else (-1.0, alarm.below or 0.0)
        limit, over = limit * unit, sign * (value - limit * unit)
        beyond = over > 0 or (self._beyond[k] and over > -alarm.hysteresis * unit)
        self._beyond[k] = beyond
        if sign * limit <= 0:  # a least force, say: no share of it
            return (
                {"value": limit, "share": 1.0, "near": False, "beyond": True, "ends": alarm.end}
                if beyond
                else None
            )
        near = sign * value >= NEAR * sign * limit or -over < SOON_S * sign * self.rate(name)
        return {
            "value": limit,
            "share": max(value / limit, 0.0),
            "near": near and not beyond,
            "beyond": beyond,
            "ends": alarm.end,
        }
