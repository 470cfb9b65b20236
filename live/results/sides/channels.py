"""Front and back of a test that runs, as channels of its alarms and strain outputs."""

from __future__ import annotations

import math
import time
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from acquire.text import Message
from acquire.text.message import word
from live.config.cameras import FRONT
from live.pipeline.measurement import AXIAL, TimeStep
from live.pipeline.run_state import RunState
from live.pipeline.snapshot import BURST
from live.pipeline.timed.figure import LACKING
from live.results.sides.together import JointStrain, longest_gap, newest

LATE_S = 1.0
"""A side that is behind the other by more than this, and by more than a usual gap, gives no strains."""


class JointChannels:
    """The channels of front and back together (``live.config.figures.JOINT_CHANNELS``); for any thread."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._states: Mapping[str, RunState] = {}
        self._live = False
        self._last_t = -math.inf  # the newest instant of both so far

    def attach(self, states: Mapping[str, RunState], *, live: bool) -> None:
        """Both sides have begun; recorded pictures (not ``live``) may be read one side after the other."""
        self._states, self._live = states, live

    def read(self, start: float) -> dict[str, float]:
        """The channels at the newest instant of both; none where there is no such instant, or it is too old.

        ``start`` is time zero, s, monotonic.
        """
        if not self._states or self.lost:
            return {}
        strains = newest(self._states, self._clock())
        found = {"mean_time_s": strains[AXIAL].t - start} if AXIAL in strains else {}
        for name, one in strains.items():
            channel = name if name == AXIAL else f"gauge_{name}"
            found |= _channels(channel, one)
            if name in self._states[FRONT].history.time_steps.gauges:
                found |= _channels(f"gauge_{name}", one)
        return found

    @property
    def lost(self) -> str:
        """Why there is no mean of both any more; empty while there is, and before both have measured."""
        for side, state in self._states.items():
            if state.health.camera_failed:
                return Message("the camera of the {side} has failed", word(side))
            if state.snapshot(self._clock()).figure(BURST).state in LACKING:
                return Message("the {side} gives no strains", word(side))
        steps = {side: state.history.time_steps for side, state in self._states.items()}
        if not self._live or not all(steps.values()):
            return ""
        ends = {side: one[-1].t for side, one in steps.items()}
        late, ahead = sorted(ends, key=lambda side: ends[side])
        limit = max(LATE_S, *(longest_gap(np.array([s.t for s in one[-3:]])) for one in steps.values()))
        if _went_on(steps[ahead], ends[late]) > limit:
            return Message("the {late} gives no strains", word(late))
        joint = newest(self._states, self._clock())
        if AXIAL in joint:
            self._last_t = joint[AXIAL].t
        since = _went_on(steps[late], self._last_t)
        return Message("no strain of both for {since:.1f} s", since) if since > limit else ""


def _went_on(steps: Sequence[TimeStep], t: float) -> float:
    """How long ``steps`` go on after ``t``, s; a pause before their next is not counted."""
    first = bisect_right(steps, t, key=lambda step: step.t)
    return steps[-1].t - steps[first].t if first < len(steps) else 0.0


def _channels(name: str, one: JointStrain) -> dict[str, float]:
    return {f"mean_{name}": one.mean, f"bending_{name}": one.bending, f"sigma_mean_{name}": one.sigma}
