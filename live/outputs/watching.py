"""The view and its status card as consumers."""

from __future__ import annotations

from acquire.errors import DataError
from acquire.events import Event
from acquire.frame import Frame
from acquire.load_sample import LoadSample
from live.measure import History, Instant, Measurement
from live.outputs.consumer import Consumer
from live.tell import Ledger, StatusCard
from live.view import Thinned, View

CLOSE_S = 10.0
"""For drawing what waits and closing the file at the end of a test."""

CARD_INSTANTS = 2000
"""The figures of the card are of so many instants at most, evenly thinned; those of the summary of all."""


class Watching(Consumer):
    """Shows everything. An offer is one append; the view's own thread and process do the rest."""

    name = "view"
    blocks = False

    def __init__(self, view: View) -> None:
        self._view = view

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
        """Offer an event."""
        self._view.event(event)

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
            history.instants += self._instants.items()
            self._view.status(self._card.written(history, self._ledger))
