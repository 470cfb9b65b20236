"""The consumers that feed the view: maps and curves, the status card, the large figures."""

from __future__ import annotations

import math
import time
from dataclasses import replace

from acquire.clock import Clock
from acquire.errors import DataError
from acquire.events import Event
from acquire.frame import Frame
from acquire.load_sample import LoadSample
from live.pipeline.consumer import Consumer
from live.pipeline.history import History
from live.pipeline.measurement import Measurement, TimeStep
from live.pipeline.queues import Thinned
from live.pipeline.run_state import RunState
from live.results.summary import StatusCard
from live.ui.rerun.view import View

CLOSE_S = 10.0
"""At the end of a test: to draw what waits and to close the file."""

IDLE_S, RESPONSE_S = 0.5, 10.0
CARD_TIME_STEPS = 2000
"""The figures of the card use at most so many time steps, evenly thinned; those of the summary use all."""


class RerunConsumer(Consumer):
    """Passes everything to the view. Each call is one append; the thread and process of the view do the rest."""

    name = "view"
    blocks = False

    def __init__(self, view: View, run_state: RunState) -> None:
        self._view, self._run_state = view, run_state

    def frame(self, frame: Frame) -> None:
        """Offer a frame; the view accepts a few a second."""
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
        """Offer an event, with the name of its device."""
        self._view.event(
            replace(event, source=self._run_state.event_log.names.get(event.source, event.source))
        )

    def end(self) -> str:
        """Draw what waits, and close the view."""
        self._view.close(CLOSE_S)
        if self._view.failed:
            raise DataError(self._view.failed)
        return self._view.report


class CardWriter(Consumer):
    """Writes the status card of the view once a second of the test, in its own thread; now and then the response."""

    name = "status card"

    def __init__(
        self, view: View, card: StatusCard, run_state: RunState, clock: Clock = time.monotonic
    ) -> None:
        self._clock = clock
        self._view, self._card, self._run_state = view, card, run_state
        self._time_steps: Thinned[TimeStep] = Thinned(CARD_TIME_STEPS)
        self._response_t = -math.inf

    def measurement(self, measurement: Measurement) -> None:
        """Keep the means; write the card when it is due."""
        self._time_steps.append(measurement.time_step)
        if self._card.is_due(measurement.t):
            history = History()
            for time_step in self._time_steps.items():
                history.add(time_step)
            snapshot = self._run_state.snapshot(self._clock(), measurement.time_step)
            self._view.status(self._card.written(snapshot, history))
            if measurement.t - self._response_t >= RESPONSE_S:
                self._response_t = measurement.t
                self._view.whole(self._run_state.response.maps())

    def end(self) -> str:
        """Show the last response."""
        self._view.whole(self._run_state.response.maps())
        return ""


class FiguresWriter(Consumer):
    """Shows the large figures with the newest load, alarms and state."""

    name = "figures"

    def __init__(self, view: View, run_state: RunState, clock: Clock = time.monotonic) -> None:
        self._view, self._run_state, self._clock = view, run_state, clock

    def measurement(self, measurement: Measurement) -> None:
        """Show the newest measurement."""
        self._view.figures(self._run_state.snapshot(self._clock(), measurement.time_step))

    def event(self, event: Event) -> None:
        """Wake the thread: the first event comes before the first frame."""

    def idle(self) -> float:
        """Show the newest load and state, also before the first measurement."""
        if self._run_state.health.live and not math.isnan(self._run_state.health.frame_t):
            self._view.figures(self._run_state.snapshot(self._clock()))
        return IDLE_S

    def end(self) -> str:
        """Show that the test has ended, and no value as if it went on."""
        self._view.figures(self._run_state.snapshot(self._clock()))
        return ""
