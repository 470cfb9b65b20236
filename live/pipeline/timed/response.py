"""The lines of the places over a channel while a test goes on, as the page and the view show them."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from analysis.evaluate.response import WINDOW, Departures, ResponseSums
from analysis.field import Sums
from live.pipeline.measurement import Measurement

Floats = NDArray[np.float64]
STRESS, MEAN, TIME = "stress", "mean", "time"
CHANNELS = (STRESS, MEAN, TIME)
"""What a strain may be held against, besides a gauge by its name."""
_SLOPES = {STRESS: "compliance", TIME: "rate"}


def slope_name(channel: str) -> str:
    """Name of the map of slopes over ``channel``: compliance, rate or amplification."""
    return _SLOPES.get(channel, "amplification")


def leaves_name(channel: str) -> str:
    """Name of the map of where places leave their lines; empty over time."""
    return "" if channel == TIME else "leaves_at_stress" if channel == STRESS else "leaves_at_strain"


def shown_names(channel: str | None) -> tuple[str, ...]:
    """The maps over ``channel`` that a person looks at first; none without one."""
    return tuple(filter(None, (slope_name(channel), "chi2", leaves_name(channel)))) if channel else ()


class ResponseWatch:
    """Filled by one thread, read by any. Unlike the evaluation of a finished test it looks at each burst once.

    A burst counts where the load, without one the channel, is higher than ever before; over time every one does.

    Attributes
    ----------
    channel : str
        "stress", "mean", "time" or a gauge; empty: nothing is added.
    area_m2 : float or None
    """

    def __init__(self) -> None:
        self.channel, self.area_m2 = "", math.nan
        self._axis, self._top, self._first_t = "", 0.0, math.nan
        self._pattern: Sums | None = None
        self._reference = -1
        self._over: list[Departures] = []
        self._sums = ResponseSums()

    def add(self, m: Measurement, axis: str) -> None:
        """One more burst with its force; another ``axis`` of the load begins anew."""
        if axis != self._axis:
            self._axis, self._top, self._first_t, self._over, self._sums = axis, 0.0, m.t, [], ResponseSums()
        if m.field.sums is not self._pattern:
            self._pattern, self._reference = m.field.sums, self._reference + 1
        x, sigma_x = self._channel(m)
        stress = m.force / self.area_m2
        level = abs(stress if math.isfinite(stress) else x)
        if not math.isfinite(x) or (self.channel != TIME and not level > self._top):
            return
        self._top = level
        along = f"e{2 * axis}"
        y, sigma = m.field.value(along), m.field.sigma(along, "current")
        if self.channel == TIME:
            self._sums += ResponseSums.of(x, y, sigma, self._reference)
            return
        # The noise of the mean is in each of its places; of a gauge it is not known in which.
        channels = [(x, (sigma_x, sigma_x**2 * (self.channel == MEAN)))]
        if math.isfinite(stress) and self.channel != STRESS:
            channels.append((stress, (0.0, 0.0)))
        for _ in channels[len(self._over) :]:
            self._over.append(Departures(m.field.grid.shape))
            self._over[-1].window = WINDOW  # how many will come is not known
        # A place that has left its line over the stress is not elastic over another channel either.
        for one, (value, noise) in reversed([*zip(self._over, channels, strict=False)]):
            one.add(value, y, sigma, self._reference, noise)
            y = np.where(np.isnan(one.at), y, np.nan)

    def _channel(self, m: Measurement) -> tuple[float, float]:
        """Value and noise without that of the reference."""
        if self.channel == STRESS:
            return m.force / self.area_m2, 0.0
        if self.channel == TIME:
            return m.t - self._first_t, 0.0
        along = f"e{2 * self._axis}"
        if self.channel == MEAN:
            value, sigma = getattr(m.time_step, along), getattr(m.time_step, f"sigma_{along}")
        else:
            gauge = m.time_step.gauges[self.channel]
            value, sigma = gauge.value, gauge.sigma
        return value, sigma * math.sqrt(m.field.own_share(along))

    def maps(self) -> Mapping[str, Floats]:
        """``shown_names`` and ``sigma_`` of the first, (R, C), in SI units; nothing before there are two bursts."""
        sums = self._over[0].sums if self._over else self._sums
        if not sums.parts:
            return {}
        lines, name = sums.lines(), slope_name(self.channel)
        leaves = {leaves_name(self.channel): one.at for one in self._over[:1]}
        return {name: lines.slope, f"sigma_{name}": lines.sigma, "chi2": lines.chi2, **leaves}
