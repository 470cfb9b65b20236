"""The results as a consumer: every measurement, in order, once its force is final."""

from __future__ import annotations

from live.measure import Measurement
from live.outputs.consumer import Consumer, Policy
from live.results import Results


class Files(Consumer):
    """Writes ``results``; a disk with bad moments holds the measurement up only when ``room`` of them wait.

    Then nothing is lost: bursts are skipped, and counted, as with any slow measurement.
    """

    name = "results"
    policy = Policy.WAIT
    room = 64
    vital = True

    def __init__(self, results: Results) -> None:
        self._results = results

    def settled(self, measurement: Measurement) -> None:
        """Write one row."""
        self._results.add(measurement)

    def idle(self) -> float:
        """A row that is not flushed must not wait for one that does not come."""
        return self._results.flush_when_due()

    def end(self) -> str:
        """Close the files."""
        self._results.close()
        return ""
