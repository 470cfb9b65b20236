"""The view and its status card as consumers."""

from __future__ import annotations

from acquire.errors import DataError
from acquire.events import Event
from acquire.frame import Frame
from acquire.load_sample import LoadSample
from live.measure import History, Measurement
from live.outputs.consumer import Consumer
from live.tell import Ledger, StatusCard
from live.view import RerunView

CLOSE_S = 5.0


class Watching(Consumer):
    """Shows everything; the view has queues and threads of its own, so nothing here blocks."""

    name = "view"
    blocks = False

    def __init__(self, view: RerunView) -> None:
        self._view = view

    def frame(self, frame: Frame) -> None:
        """Offer a frame; a few a second are taken."""
        self._view.picture(frame)

    def measurement(self, measurement: Measurement) -> None:
        """Offer a measurement; the newest win."""
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
        return f"{self._view.skipped} measurements not drawn" * (self._view.skipped > 0)


class CardWriter(Consumer):
    """Writes the status card of the view anew, once a second of the test."""

    name = "status card"

    def __init__(self, view: RerunView, card: StatusCard, history: History, ledger: Ledger) -> None:
        self._view, self._card, self._history, self._ledger = view, card, history, ledger

    def measurement(self, measurement: Measurement) -> None:
        """Write the card where the last one is old."""
        card = self._card.due(measurement.t, self._history, self._ledger)
        if card is not None:
            self._view.status(card)
