"""Writes the results: one row a measurement in ``strain.h5`` and ``strain.csv``, as a consumer of the run.

A measurement is written once its force is final (``live.pipeline.measurement.ForceMatching``), in order.
``Strain`` (``reader``) reads the file back. docs/strain-format.md describes the format.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from acquire.errors import DataError
from acquire.opening import Closing
from live.config.loading import Config
from live.pipeline.consumer import Consumer, Policy, RunInfo
from live.pipeline.history import AxisFinder
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import RunState
from live.results.folder import versions
from live.results.layout import COLUMNS, ResultsInfo, StrainRow, gauge_columns
from live.results.strain_h5 import FLUSH_S, StrainWriter

if TYPE_CHECKING:
    from analysis.field import ZoiGrid

DEFERRED_FLUSH_S = 10.0  # in a replay, which can be run again


class CsvWriter:
    """Appends rows to a new file.

    Raises
    ------
    DataError
        The file exists, or cannot be written.
    """

    def __init__(self, path: Path, *, extras: Iterable[str] = (), gauges: Iterable[str] = ()) -> None:
        self._path = path
        self._columns = (*COLUMNS, *extras, *chain.from_iterable(map(gauge_columns, gauges)))
        try:
            self._file = path.open("x", encoding="ascii", newline="\n")
        except OSError as error:
            raise self._trouble(error) from error
        self._put(",".join(self._columns))

    def write(self, row: StrainRow) -> None:
        """One line; see the class for what is raised."""
        self._put(",".join(_text(row.values[column]) for column in self._columns))

    def close(self) -> None:
        """Close the file; what stands in it was flushed line by line."""
        try:
            self._file.close()
        except OSError as error:
            raise self._trouble(error) from error

    def _put(self, line: str) -> None:
        try:
            self._file.write(line + "\n")
            self._file.flush()
        except OSError as error:
            raise self._trouble(error) from error

    def _trouble(self, error: OSError) -> DataError:
        return DataError(
            "{path}: cannot be written ({why}); make room or choose another place", self._path, error
        )


def _text(value: float | int) -> str:
    return str(value) if isinstance(value, int) else f"{value:.10g}"


class Results(Closing):
    """Writes ``strain.h5`` and ``strain.csv`` into a folder; a context manager.

    Parameters
    ----------
    folder : Path
        Created where it does not exist; files in it are never overwritten.
    grid : ZoiGrid
    info : ResultsInfo
    flush_s : float, s
        After this time at most, others can read a row, and a kill does not lose it.

    Raises
    ------
    DataError
        A file exists already, or cannot be written.
    """

    def __init__(self, folder: Path, grid: ZoiGrid, info: ResultsInfo, flush_s: float = FLUSH_S) -> None:
        self._info, self._axis = info, AxisFinder(info.axis)
        self.h5_path, self.csv_path = folder / "strain.h5", folder / "strain.csv"
        self.written = 0
        self._closed = False
        for path in (self.h5_path, self.csv_path):
            if path.exists():
                raise DataError("{path} exists already and is not overwritten; choose another --out", path)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise DataError(
                "{folder}: cannot be made ({why}); choose another --out", folder, error
            ) from error
        self._h5 = StrainWriter(self.h5_path, grid, info, flush_s)
        try:
            self._csv = CsvWriter(self.csv_path, extras=info.extras, gauges=info.gauges)
        except DataError:
            self._h5.close()
            raise

    def add(self, measurement: Measurement) -> None:
        """Write one measurement.

        Raises
        ------
        DataError
            The file cannot be written (a full disk); what was written before stays readable.
            Stop adding then.
        """
        row = StrainRow.of(measurement, self._info, self._axis.add(measurement.time_step))
        self._h5.write(row)
        self._csv.write(row)
        self.written += 1

    def flush_when_due(self) -> float:
        """Flush rows that have waited ``flush_s``, as ``add`` does too; raises as ``add``.

        Returns
        -------
        float, s
            Time after which this must be called again if no row comes; infinite where none waits.
        """
        return self._h5.flush_when_due()

    def close(self) -> None:
        """Close both files; idempotent."""
        if self._closed:
            return
        self._closed = True
        try:
            self._csv.close()
        finally:
            self._h5.close()


class ResultsConsumer(Consumer):
    """Writes ``results``; a slow disk delays the measurement only when the queue is full.

    Then no result is lost: bursts are skipped, and counted, as with any slow measurement.
    """

    name = "results"
    policy = Policy.WAIT
    queue_size = 64
    critical = True

    def __init__(self, results: Results) -> None:
        self._results = results

    def matched(self, measurement: Measurement) -> None:
        """Write one row."""
        self._results.add(measurement)

    def idle(self) -> float:
        """Flush the last rows, also where no further one comes."""
        return self._results.flush_when_due()

    def end(self) -> str:
        """Close the files."""
        self._results.close()
        return ""


class ResponseConsumer(Consumer):
    """Fills the response of the places that a test shows while it goes on; a burst that is dropped has no weight."""

    name = "response"
    queue_size = 64

    def __init__(self, run_state: RunState, config: Config) -> None:
        self._run_state = run_state
        run_state.response.channel = config.output.response or ""
        run_state.response.area_m2 = config.specimen.area_m2 or math.nan

    def matched(self, measurement: Measurement) -> None:
        """Add one burst."""
        self._run_state.response.add(measurement, self._run_state.history.current_axis)


def write_results(about: RunInfo, run_state: RunState) -> Sequence[Consumer]:
    """The consumers of a run that writes its results and shows nothing; it adds up a response that is wanted.

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
        plates=bool(config.plate),
        lens=config.lens.focal_px is not None,
        response=config.output.response or "",
    )
    results = Results(about.folder, about.grid, info, DEFERRED_FLUSH_S if about.deferred else FLUSH_S)
    watch = [ResponseConsumer(run_state, config)] if config.output.response else []
    return [ResultsConsumer(results), *watch]
