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

    def __init__(self, view: View, books: RunState) -> None:
        self._view, self._books = view, books

    def frame(self, frame: Frame) -> None:
        """Offer a frame; a few a second are taken."""
        self._view.picture(frame)

    def measurement(self, measurement: Measurement) -> None:
        """Offer a measurement."""
        if self._view.failed:
            raise DataError(self._view.failed)
        self._view.show(measurement)

    def settled(self, measurement: Measurement) -> None:
        """Offer a point of the curve."""
        axial, _ = measurement.instant.axial(self._books.history.axis_by_now)
        self._view.point(axial, measurement.force)

    def load(self, sample: LoadSample) -> None:
        """Offer a load sample."""
        self._view.load(sample.t, sample.force)

    def event(self, event: Event) -> None:
        """Offer an event, a device by its name."""
        self._view.event(replace(event, source=self._books.journal.names.get(event.source, event.source)))

    def end(self) -> str:
        """Let it draw what waits, and close it."""
        self._view.close(CLOSE_S)
        if self._view.failed:
            raise DataError(self._view.failed)
        return self._view.report


class CardWriter(Consumer):
    """Writes the status card of the view anew, once a second of the test, on a thread of its own."""

    name = "status card"

    def __init__(self, view: View, card: StatusCard, books: RunState) -> None:
        self._view, self._card, self._books = view, card, books
        self._instants: Thinned[TimeStep] = Thinned(CARD_INSTANTS)

    def measurement(self, measurement: Measurement) -> None:
        """Keep its means, and write the card where the last one is old."""
        self._instants.append(measurement.instant)
        if self._card.is_due(measurement.t):
            history = History()
            for instant in self._instants.items():
                history.add(instant)
            snapshot = self._books.snapshot(measurement.t, measurement.instant)
            self._view.status(self._card.written(snapshot, history))


class FiguresWriter(Consumer):
    """Shows the large figures of the view, with the newest load, alarms and state."""

    name = "figures"

    def __init__(self, view: View, books: RunState) -> None:
        self._view, self._books = view, books
        self._last: TimeStep | None = None

    def measurement(self, measurement: Measurement) -> None:
        """Show the newest."""
        self._last = measurement.instant
        self._view.figures(self._books.snapshot(measurement.t, self._last))

    def event(self, event: Event) -> None:
        """Wake up: the first one comes before the first frame."""

    def idle(self) -> float:
        """Show what has changed meanwhile, also before anything is measured."""
        vitals = self._books.vitals
        if vitals.state and not math.isnan(vitals.frame_t):
            self._view.figures(self._books.snapshot(vitals.frame_t, self._last))
        return IDLE_S
