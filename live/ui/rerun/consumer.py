"""The view and its status card as consumers."""

from __future__ import annotations

import math
from dataclasses import replace

from acquire.errors import DataError
from acquire.events import Event
from acquire.frame import Frame
from acquire.load_sample import LoadSample
from live.pipeline.consumer import Consumer
from live.pipeline.history import History, Thinned
from live.pipeline.measurement import Measurement, TimeStep
from live.pipeline.run_state import RunState
from live.results.summary import StatusCard
from live.ui.rerun.view import View

CLOSE_S = 10.0
"""For drawing what waits and closing the file at the end of a test."""

IDLE_S = 0.5
CARD_INSTANTS = 2000
"""The figures of the card are of so many instants at most, evenly thinned; those of the summary of all."""


class RerunConsumer(Consumer):
    """Shows everything. An offer is one append; the view's own thread and process do the rest."""

    name = "view"
    blocks = False

    def __init__(self, view: View, run_state: RunState) -> None:
        self._view, self._run_state = view, run_state

    def frame(self, frame: Frame) -> None:
        """Offer a frame; a few a second are taken."""
        self._view.picture(frame)

    def measurement(self, measurement: Measurement) -> None:
        """Offer a measurement."""
        if self._view.failed:
            raise DataError(self._view.failed)
        self._view.show(measurement)

    def matched(self, measurement: Measurement) -> None:
        """Offer a point of the curve."""
        axial, _ = measurement.time_step.axial(self._run_state.history.current_axis)
        self._view.point(axial, measurement.force)

    def load(self, sample: LoadSample) -> None:
        """Offer a load sample."""
        self._view.load(sample.t, sample.force)

    def event(self, event: Event) -> None:
        """Offer an event, a device by its name."""
        self._view.event(
            replace(event, source=self._run_state.event_log.names.get(event.source, event.source))
        )

    def end(self) -> str:
        """Let it draw what waits, and close it."""
        self._view.close(CLOSE_S)
        if self._view.failed:
            raise DataError(self._view.failed)
        return self._view.report


class CardWriter(Consumer):
    """Writes the status card of the view anew, once a second of the test, on a thread of its own."""

    name = "status card"

    def __init__(self, view: View, card: StatusCard, run_state: RunState) -> None:
        self._view, self._card, self._run_state = view, card, run_state
        self._time_steps: Thinned[TimeStep] = Thinned(CARD_INSTANTS)

    def measurement(self, measurement: Measurement) -> None:
        """Keep its means, and write the card where the last one is old."""
        self._time_steps.append(measurement.time_step)
        if self._card.is_due(measurement.t):
            history = History()
            for time_step in self._time_steps.items():
                history.add(time_step)
            snapshot = self._run_state.snapshot(measurement.t, measurement.time_step)
            self._view.status(self._card.written(snapshot, history))


class FiguresWriter(Consumer):
    """Shows the large figures of the view, with the newest load, alarms and state."""

    name = "figures"

    def __init__(self, view: View, run_state: RunState) -> None:
        self._view, self._run_state = view, run_state
        self._last: TimeStep | None = None

    def measurement(self, measurement: Measurement) -> None:
        """Show the newest."""
        self._last = measurement.time_step
        self._view.figures(self._run_state.snapshot(measurement.t, self._last))

    def event(self, event: Event) -> None:
        """Wake up: the first one comes before the first frame."""

    def idle(self) -> float:
        """Show what has changed meanwhile, also before anything is measured."""
        health = self._run_state.health
        if health.state and not math.isnan(health.frame_t):
            self._view.figures(self._run_state.snapshot(health.frame_t, self._last))
        return IDLE_S
