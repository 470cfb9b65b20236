"""Counts the measurements of a test whose force is not known although there is a load cell, and says so in time."""

from __future__ import annotations

import math
from collections.abc import Sequence

from acquire.events import Event, EventKind, Level
from acquire.text import Message
from live.pipeline.consumer import Consumer
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import RunState
from live.pipeline.timed.figure import OLD_S


class ForceWatch(Consumer):
    """Counts in ``run_state``; an event where ``OLD_S`` of a test have no force, and one when that is over."""

    name = "forces"
    blocks = False

    def __init__(self, run_state: RunState) -> None:
        self._run_state = run_state
        self._newest_t = self._last_t = self._since = math.nan
        self._count, self._reported = 0, False

    def measurement(self, measurement: Measurement) -> None:
        """Note how far the test is: forces come later."""
        self._newest_t = measurement.t

    def matched(self, measurement: Measurement) -> None:
        """Count one whose final force is not known."""
        t, before = measurement.t, self._last_t
        self._last_t = t
        if not math.isnan(measurement.force):
            if self._reported:
                self._emit(
                    t, Message("bursts have a force again, after {count} without", self._count), "info"
                )
            self._since, self._count, self._reported = math.nan, 0, False
            return
        self._since = t if math.isnan(self._since) else self._since
        self._count += 1
        self._run_state.frame_counts.add(without_force=1)
        if not math.isnan(before):  # a pause is no loss
            self._run_state.health.without_force_s += min(t - before, OLD_S)
        if self._newest_t - self._since >= OLD_S and not self._reported:
            self._reported = True
            why = self._run_state.loads.why_none_at(t)
            self._emit(
                t,
                Message(
                    "no force for the bursts of the last {newest_t:.1f} s: {why}",
                    self._newest_t - self._since,
                    why,
                ),
                "warning",
            )

    def _emit(self, t: float, text: str, level: Level) -> None:
        data = {"without_force": self._count}
        self._run_state.event_log.record(Event(t, EventKind.LOST, "force", text, level, data))


def with_force_watch(consumers: Sequence[Consumer], run_state: RunState) -> list[Consumer]:
    """``consumers``, and the watch where there is a load cell."""
    return [*consumers, *([ForceWatch(run_state)] if run_state.with_load else [])]
