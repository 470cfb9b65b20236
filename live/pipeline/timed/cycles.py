"""The cycles of a test that goes on: counted with every burst, the figures of the last one as channels."""

from __future__ import annotations

import itertools
import math
from array import array
from collections.abc import Mapping

import numpy as np

from acquire.load_cell import LoadLog
from analysis.evaluate.cyclic.cycles import Cycle, CycleCounter
from analysis.evaluate.cyclic.loop import BurstStrains
from analysis.evaluate.lag import Track
from live.config.figures import CYCLE_CHANNELS
from live.pipeline.measurement import TimeStep

NONE = dict.fromkeys(CYCLE_CHANNELS, math.nan)


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
