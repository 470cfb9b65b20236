"""The view and its status card as consumers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from acquire.errors import DataError
from acquire.events import Event
from acquire.frame import Frame
from acquire.load_sample import LoadSample
from live.channels import Readings
from live.measure import History, Instant, Measurement
from live.outputs.consumer import Consumer
from live.tell import Books, Ledger, StatusCard
from live.view import Figures, Thinned, View

CLOSE_S = 10.0
"""For drawing what waits and closing the file at the end of a test."""

IDLE_S = 0.5
CARD_INSTANTS = 2000
"""The figures of the card are of so many instants at most, evenly thinned; those of the summary of all."""


class Watching(Consumer):
    """Shows everything. An offer is one append; the view's own thread and process do the rest."""

    name = "view"
    blocks = False

    def __init__(self, view: View, names: Mapping[str, str]) -> None:
        self._view, self._names = view, names

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
        self._view.settled(measurement)

    def load(self, sample: LoadSample) -> None:
        """Offer a load sample."""
        self._view.load(sample.t, sample.force)

    def event(self, event: Event) -> None:
        """Offer an event, a device by its name."""
        self._view.event(replace(event, source=self._names.get(event.source, event.source)))

    def end(self) -> str:
        """Let it draw what waits, and close it."""
        self._view.close(CLOSE_S)
        if self._view.failed:
            raise DataError(self._view.failed)
        return self._view.report


class CardWriter(Consumer):
    """Writes the status card of the view anew, once a second of the test, on a thread of its own."""

    name = "status card"

    def __init__(self, view: View, card: StatusCard, ledger: Ledger) -> None:
        self._view, self._card, self._ledger = view, card, ledger
        self._instants: Thinned[Instant] = Thinned(CARD_INSTANTS)

    def measurement(self, measurement: Measurement) -> None:
        """Keep its means, and write the card where the last one is old."""
        self._instants.append(measurement.instant)
        if self._card.is_due(measurement.t):
            history = History()
            for instant in self._instants.items():
                history.add(instant)
            self._view.status(self._card.written(history, self._ledger))


class FiguresWriter(Consumer):
    """Shows the large figures of the view, with the newest load, alarms and state."""

    name = "figures"

    def __init__(self, view: View, readings: Readings, books: Books) -> None:
        self._view, self._readings, self._books = view, readings, books
        self._last: Measurement | None = None

    def measurement(self, measurement: Measurement) -> None:
        """Show the newest."""
        self._last = measurement
        self._show(measurement.t)

    def event(self, event: Event) -> None:
        """Wake up: the first one comes before the first frame."""

    def idle(self) -> float:
        """Show what has changed meanwhile, also before anything is measured."""
        vitals = self._books.vitals
        if vitals.state and not math.isnan(vitals.frame_t):
            self._show(vitals.frame_t)
        return IDLE_S

    def _show(self, t: float) -> None:
        i = None if self._last is None else self._last.instant
        read = self._readings.read(self._last) if self._last else self._readings.load()
        self._view.figures(
            Figures(
                t=t,
                state=self._books.vitals.state or "REPLAY",
                axial=read.get("axial", math.nan),
                sigma=read.get("sigma_axial", math.nan),
                force_N=read["force_N"],
                stress_MPa=read["stress_MPa"],
                valid=0 if i is None else i.n_valid,
                zois=0 if i is None else i.n_zoi,
                alarms=self._books.alarms.texts,
            )
        )
