"""The results as a consumer: every measurement, in order, once its force is final."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

from live.measure import Measurement
from live.outputs.consumer import About, Consumer, Policy
from live.results import FLUSH_S, Results, ResultsInfo
from live.setup import versions
from live.tell import Books

SELDOM_S = 10.0  # a row may wait for its flush where nobody would have it from a broken run


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


def write_results(about: About, books: Books) -> Sequence[Consumer]:
    """The results alone.

    Raises
    ------
    DataError
        A file of the results exists already, or cannot be made.
    """
    config = about.config
    info = ResultsInfo(
        about.start.monotonic,
        about.start.utc.isoformat(),
        config.as_dict(),
        dict(config.metadata),
        versions(),
        about.camera,
        strain_measure=cast(Any, config.measure.strain),
        area_m2=config.specimen.area_m2,
        gauges=dict(config.gauges),
        axis=config.specimen.axis,
        lagged=config.load.lag_s != 0,
    )
    return [Files(Results(about.folder, about.grid, info, SELDOM_S if about.aside else FLUSH_S))]
