"""What a test gives: one row a measurement in ``strain.h5`` and ``strain.csv``.

The force of a measurement must be final when it comes here (``live.pipeline.measurement.ForceMatching``). Recording,
drawing and reporting are not done here; ``Strain`` (``reader``) reads the file back. The format is
described in docs/strain-format.md.

The results as a consumer: every measurement, in order, once its force is final.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from acquire.closing import Closing
from acquire.errors import DataError
from live.pipeline.consumer import Consumer, Policy, RunInfo
from live.pipeline.history import AxisFinder
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import RunState
from live.results.folder import versions
from live.results.row import ResultsInfo, StrainRow
from live.results.strain_csv import CsvWriter
from live.results.strain_h5 import FLUSH_S, StrainWriter

if TYPE_CHECKING:
    from analysis.field import ZoiGrid
    from live.pipeline.measurement import Measurement


class Results(Closing):
    """Writes ``strain.h5`` and ``strain.csv`` into a folder; a context manager.

    Parameters
    ----------
    folder : Path
        Made where it does not exist; files in it are never overwritten.
    grid : ZoiGrid
    info : ResultsInfo
    flush_s : float, s
        A row waits no longer than this to be readable by others, and safe from a kill.

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
                raise DataError(f"{path} exists already and is not overwritten; choose another --out")
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise DataError(f"{folder}: cannot be made ({error.strerror}); choose another --out") from error
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
        """Bring rows that have waited long enough to the file, as ``add`` does too; raises as that.

        Returns
        -------
        float, s
            Time after which this must be called again if no row comes; infinite where none waits.
        """
        return self._h5.flush_when_due()

    def close(self) -> None:
        """Close both files; again without effect."""
        if self._closed:
            return
        self._closed = True
        try:
            self._csv.close()
        finally:
            self._h5.close()


SELDOM_S = 10.0  # a row may wait for its flush where nobody would have it from a broken run


class Files(Consumer):
    """Writes ``results``; a disk with bad moments holds the measurement up only when ``room`` of them wait.

    Then nothing is lost: bursts are skipped, and counted, as with any slow measurement.
    """

    name = "results"
    policy = Policy.WAIT
    room = 64
    critical = True

    def __init__(self, results: Results) -> None:
        self._results = results

    def matched(self, measurement: Measurement) -> None:
        """Write one row."""
        self._results.add(measurement)

    def idle(self) -> float:
        """A row that is not flushed must not wait for one that does not come."""
        return self._results.flush_when_due()

    def end(self) -> str:
        """Close the files."""
        self._results.close()
        return ""


def write_results(about: RunInfo, run_state: RunState) -> Sequence[Consumer]:
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
    return [Files(Results(about.folder, about.grid, info, SELDOM_S if about.deferred else FLUSH_S))]
