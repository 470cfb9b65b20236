"""Measuring live: the reference, then burst after burst, whatever else happens."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable

from acquire.errors import PhasedicError
from acquire.events import Event, EventKind
from acquire.frame import Burst
from live.measure import Measurement, SmearGuard
from live.outputs import Outputs
from live.pace import MEASURE, Lag, Pace, yield_to_others
from live.run.feed import Feed
from live.run.reference_step import ReferenceStep
from live.run.setting import Setting
from live.setup import PreparedKernel
from live.tell import Books

log = logging.getLogger(__name__)


class Measuring:
    """Measures what the feed gives; a trouble here never ends the recording.

    Parameters
    ----------
    setting : Setting
    books : Books
    outputs : Outputs
    feed : Feed
    pace : Pace
    show : callable
        Called after every measurement.

    Attributes
    ----------
    failure : int
        1 where a defect ended the measurement, else 0.
    """

    def __init__(
        self,
        setting: Setting,
        books: Books,
        outputs: Outputs,
        feed: Feed,
        pace: Pace,
        show: Callable[[], None],
    ) -> None:
        self._setting, self._books, self._outputs, self._feed = setting, books, outputs, feed
        self._pace, self._show = pace, show
        self.failure = 0
        self._refused: PhasedicError | None = None
        self._thread = threading.Thread(target=self._work, name="measure", daemon=True)

    def to_the_end(self) -> None:
        """Measure, in a thread of its own, until the camera ends.

        Raises
        ------
        PhasedicError
            The reference cannot be used: the start has failed.
        """
        self._thread.start()
        self._thread.join()
        if self._refused is not None:
            raise self._refused

    def _work(self) -> None:
        yield_to_others(MEASURE)
        try:
            ready = ReferenceStep(self._setting, self._books, self._feed).take()
            if ready is None:
                self._feed.let_pass()
            else:
                self._measure(ready)
        except PhasedicError as error:
            self._refused = error
        except Exception as error:
            log.exception("the measurement failed")
            self.failure = 1
            text = f"measuring has stopped by a defect, recording goes on: {error!r}"
            self._books.journal.tell(EventKind.MEASUREMENT, "measurement", text, "error")
            self._feed.let_pass()

    def _measure(self, ready: PreparedKernel) -> None:
        journal = self._books.journal
        guard = SmearGuard(journal.record)
        for m in ready.measurements(self._feed.bursts(), self._books.loads, journal.record):
            self._books.ledger.add(measured=m.burst.n)
            journal.record(_measured(m.burst))
            m = self._timed(m)
            self._outputs.add(m)
            self._show()
            guard.look(m.burst)
            self._keep_pace(m)

    def _timed(self, m: Measurement) -> Measurement:
        """With its latency, where the frames were stamped by a clock of this machine."""
        if m.burst.clock == "nominal":
            return m
        return m.with_latency(time.monotonic() - (m.t + m.burst.duration / 2))

    def _keep_pace(self, m: Measurement) -> None:
        if math.isnan(m.instant.latency_s):
            return
        lag = Lag(m.t, m.instant.latency_s, m.instant.measure_s)
        warning = self._pace.look(lag, m.burst.n / max(self._feed.fps, 1e-3))
        self._books.vitals.latency_p95_s = self._pace.p95_s
        if warning:
            event = Event(m.t, EventKind.MEASUREMENT, "measurement", warning, "warning")
            self._books.journal.record(event)


def _measured(burst: Burst) -> Event:
    data = {"first": burst.first_index, "last": burst.last_index, "n": burst.n, "lost": burst.lost}
    text = f"frames {burst.first_index} to {burst.last_index}"
    return Event(burst.t, EventKind.MEASURED, "measurement", text, "info", data)
