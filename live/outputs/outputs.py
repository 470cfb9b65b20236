"""What is done with each measurement, live or in a replay: results, view, history, screen.

A trouble in one of them stops that one alone, loudly.
"""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable

from acquire.errors import PhasedicError
from acquire.events import EventKind
from acquire.frame import Frame
from live.measure import History, Instant, Measurement
from live.results import Results
from live.tell import Journal, Ledger, StatusCard
from live.view import RerunView

log = logging.getLogger(__name__)
WAITING = 64  # measurements


class Outputs:
    """Passes each measurement on to those who want it; results are written by a thread of their own.

    A disk with bad moments holds up the measurement only when ``WAITING`` measurements wait for it,
    and then nothing is lost: bursts are skipped, and counted, as with any slow measurement.
    """

    def __init__(
        self,
        results: Results | None,
        view: RerunView | None,
        journal: Journal,
        card: StatusCard,
        ledger: Ledger,
    ) -> None:
        self._view, self._journal = view, journal
        self._card, self._ledger = card, ledger
        self.history = History()
        self.failed = False
        self._waiting: queue.Queue[Measurement | None] = queue.Queue(WAITING)
        self._writer = threading.Thread(target=self._write_all, args=(results,), name="results", daemon=True)
        self._writer.start()

    def add(self, measurement: Measurement) -> Instant:
        """Take one measurement."""
        if not self.failed:
            self._waiting.put(measurement)
        if self._view is not None:
            self._view.show(measurement)
        instant = self.history.add(measurement)
        if self._view is not None and (card := self._card.due(self.history, self._ledger)):
            self._view.status(card)
        return instant

    def picture(self, frame: Frame) -> None:
        """Offer a frame to the view, which takes a few a second."""
        if self._view is not None:
            self._view.picture(frame)

    def load(self, t: float, force: float) -> None:
        """Offer a load sample to the view."""
        if self._view is not None:
            self._view.load(t, force)

    @property
    def view(self) -> RerunView | None:
        """The view, where there is one."""
        return self._view

    def close(self) -> None:
        """Write what waits and what is held back, and close."""
        self._waiting.put(None)
        self._writer.join()
        if self._view is not None:
            self._view.close(5.0)
            if self._view.failed:
                self._journal.tell(EventKind.VIEW, "view", self._view.failed, "warning")

    def _write_all(self, results: Results | None) -> None:
        while (measurement := self._waiting.get()) is not None:
            if results is not None and not self.failed:
                self._guarded(results.add, measurement)
        if results is not None:
            self._guarded(results.close)

    def _guarded(self, step: Callable[..., None], *arguments: Measurement) -> None:
        """One step of the results; the first that fails ends them, loudly, and nothing else."""
        try:
            step(*arguments)
            return
        except PhasedicError as error:
            text = f"the results stop here, all else goes on: {error}"
        except Exception as error:
            log.exception("the results failed")
            text = f"the results stop here by a defect, all else goes on: {error!r}"
        if not self.failed:
            self.failed = True
            self._journal.tell(EventKind.MEASUREMENT, "results", text, "error")
