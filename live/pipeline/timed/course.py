"""What a test that goes on has shown so far: its cycles, and the lines of its places over a channel.

Cycles are counted with every burst; the figures of the last one are channels. Page and view show the lines.
"""

from __future__ import annotations

import itertools
import math
from array import array
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from acquire.load_cell import LoadLog
from analysis.evaluate.cyclic.cycles import Cycle, CycleCounter
from analysis.evaluate.cyclic.loop import BurstStrains
from analysis.evaluate.lag import Track
from analysis.evaluate.response import WINDOW, Departures, ResponseSums
from analysis.field import Sums
from live.config.figures import CYCLE_CHANNELS
from live.pipeline.measurement import Measurement, TimeStep

NONE = dict.fromkeys(CYCLE_CHANNELS, math.nan)


Floats = NDArray[np.float64]
STRESS, MEAN, TIME = "stress", "mean", "time"
CHANNELS = (STRESS, MEAN, TIME)
"""What a strain may be held against, besides a gauge by its name."""
_SLOPES = {STRESS: "compliance", TIME: "rate"}


class CycleWatch:
    """Filled by one thread, read by any.

    Attributes
    ----------
    channels : mapping of str to float
        ``CYCLE_CHANNELS`` of the last whole cycle; NaN before there are cycles.
    newest : list of Cycle
        Those that the newest burst has completed.
    """

    def __init__(self) -> None:
        import scipy.interpolate  # noqa: F401  takes half a second, which no burst is to wait for

        self.channels: Mapping[str, float] = NONE
        self.newest: list[Cycle] = []
        self._counter: CycleCounter | None = None
        self._axis, self._readings, self._start_t = "", 0, math.nan
        self._all = {name: array("d") for name in CYCLE_CHANNELS}

    def add(self, step: TimeStep, axis: str, loads: LoadLog, area_m2: float | None, *, loaded: bool) -> None:
        """Count with one more burst and the readings until then; another ``axis`` begins anew."""
        if self._counter is None or axis != self._axis:
            self._counter, self._axis = CycleCounter(loaded=loaded), axis
            self._readings, self._start_t = 0, step.t
        t, force = loads.arrays(self._readings, step.t + loads.lag_s, self._start_t)
        self._readings += len(t)
        area = area_m2 or 1.0
        burst = BurstStrains(*(np.array([value]) for value in (step.t, step.axial(axis)[0], step.width_s)))
        self.newest = self._counter.add(Track(t - loads.lag_s, force / area), burst)
        for cycle in self.newest:
            if cycle.number == 1:
                self._all = {name: array("d") for name in CYCLE_CHANNELS}
            channels = _channels(cycle, area)
            for name, value in channels.items():
                self._all[name].append(value)
            if self._counter.is_cyclic:
                self.channels = channels

    def at(self, channel: str, number: int) -> float:
        """The value of the cycle of this number, or of the first after it that has one; NaN before there is one."""
        if math.isnan(self.channels["cycle"]):
            return math.nan
        later = itertools.islice(self._all[channel], number - 1, None)
        return next((value for value in later if not math.isnan(value)), math.nan)


def _channels(cycle: Cycle, area: float) -> dict[str, float]:
    values = (cycle.number, cycle.peak_strain, cycle.range_strain, cycle.peak_load * area, cycle.modulus)
    return dict(zip(CYCLE_CHANNELS, values, strict=True))


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
