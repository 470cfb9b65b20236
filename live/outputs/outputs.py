"""What is done with all that a test gives, live or in a replay: every consumer gets its share."""

from __future__ import annotations

from collections.abc import Sequence

from acquire.events import Event, EventKind
from acquire.frame import Frame
from acquire.load_cell import LoadLog
from acquire.load_sample import LoadSample
from live.measure import History, Instant, Measurement, Settling
from live.outputs.consumer import Consumer, Report
from live.outputs.worker import Worker
from live.tell import Journal


class Outputs:
    """Passes everything on to all consumers; a trouble in one of them stops that one alone.

    Parameters
    ----------
    consumers : sequence of Consumer
    loads : LoadLog
        Says when the force of a measurement is final.
    journal : Journal
        Told where a consumer fails; its events go to the consumers.
    history : History
        Gets the means of every measurement.

    Attributes
    ----------
    history : History
    """

    def __init__(
        self, consumers: Sequence[Consumer], loads: LoadLog, journal: Journal, history: History
    ) -> None:
        self.history, self._journal = history, journal
        self._settling = Settling(loads)
        self._reports: Sequence[Report] = ()
        self._workers = [Worker(consumer, self._failure) for consumer in consumers]
        for worker in self._workers:
            worker.start()
        journal.add_listener(self.event)

    def add(self, measurement: Measurement) -> Instant:
        """Take one measurement."""
        self.history.add(measurement.instant)
        self._give("measurement", measurement)
        for settled in self._settling.add(measurement):
            self._give("settled", settled)
        return measurement.instant

    def frame(self, frame: Frame) -> None:
        """Take a frame; never waits."""
        self._give("frame", frame)

    @property
    def wants_frames(self) -> bool:
        """Whether a frame is of use to anybody."""
        return any(worker.wants("frame") for worker in self._workers)

    def load(self, sample: LoadSample) -> None:
        """Take a load sample; never waits."""
        self._give("load", sample)

    def event(self, event: Event) -> None:
        """Take an event; never waits."""
        self._give("event", event)

    @property
    def reports(self) -> Sequence[Report]:
        """How the consumers fared, once they have ended."""
        return self._reports

    @property
    def failed(self) -> bool:
        """Whether a consumer that matters has stopped early."""
        return any(worker.failed and worker.vital for worker in self._workers)

    def end(self) -> None:
        """Settle what still waits for its force, and end all consumers."""
        for settled in self._settling.rest():
            self._give("settled", settled)
        self._reports = [worker.end() for worker in self._workers]

    def _give(self, kind: str, item: object) -> None:
        for worker in self._workers:
            worker.give(kind, item)

    def _failure(self, name: str, why: str, vital: bool) -> None:
        text = f"{name} stopped, all else goes on: {why}"
        self._journal.tell(EventKind.VIEW, name, text, "error" if vital else "warning")
