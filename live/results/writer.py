"""What a test gives: one row a measurement in ``strain.h5`` and ``strain.csv``.

The force of a row is final only once the load log reaches past the time of the row; until then
the row is held back, at most ``HOLD_S`` of measurements, so that the files say what a replay
will say. Recording, drawing and reporting are not done here; ``Strain`` (``results_reader``)
reads the file back. The format is described in docs/strain-format.md.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from acquire.errors import DataError
from live.results.info import Loads, ResultsInfo
from live.results.reader import Strain
from live.results.row import Row, StrainMeasure
from live.results.strain_csv import CsvWriter
from live.results.strain_h5 import StrainWriter

if TYPE_CHECKING:
    from acquire.frame import CameraInfo
    from analysis.field import ZoiGrid
    from live.measure import Measurement

__all__ = ["HOLD_S", "Results", "ResultsInfo", "Strain"]

HOLD_S = 2.0
"""Rows wait for their force at most this long, in measured time."""

_log = logging.getLogger(__name__)


class Results:
    """Writes ``strain.h5`` and ``strain.csv`` into a folder; a context manager.

    Parameters
    ----------
    folder : Path
        Made where it does not exist; files in it are never overwritten.
    grid : ZoiGrid
    start_monotonic : float, s
    start_utc : str
    loads : LoadLog
    config, metadata, versions : mapping to JSON values
    camera : CameraInfo or None
    strain_measure : "small" | "green" | "hencky"
        What the stored strains and their means are.
    area_m2 : float or None, m^2

    Raises
    ------
    DataError
        A file exists already, or cannot be written.
    """

    def __init__(
        self,
        folder: Path,
        *,
        grid: ZoiGrid,
        start_monotonic: float,
        start_utc: str,
        loads: Loads,
        config: Mapping[str, Any],
        metadata: Mapping[str, Any],
        versions: Mapping[str, Any],
        camera: CameraInfo | None,
        strain_measure: StrainMeasure = "small",
        area_m2: float | None = None,
    ) -> None:
        self._info = ResultsInfo(
            start_monotonic, start_utc, config, metadata, versions, camera, strain_measure, area_m2
        )
        self._loads = loads
        self._held: deque[Measurement] = deque()
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
        self._h5 = StrainWriter(self.h5_path, grid, self._info)
        try:
            self._csv = CsvWriter(self.csv_path, with_stress=area_m2 is not None)
        except DataError:
            self._h5.close()
            raise

    @property
    def held(self) -> int:
        """Measurements that still wait for their force."""
        return len(self._held)

    def add(self, measurement: Measurement) -> None:
        """Take one measurement, and write all whose force is known by now.

        Raises
        ------
        DataError
            The file cannot be written (a full disk); what was written before stays readable.
            Stop adding then.
        """
        self._held.append(measurement)
        while self._held and self._is_final(self._held[0], measurement.t):
            self._write(self._held.popleft())

    def close(self) -> None:
        """Write what is held and close both files; again without effect.

        Raises
        ------
        DataError
            The rows held back could not be written.
        """
        if self._closed:
            return
        self._closed = True
        try:
            while self._held and not self._h5.failed:
                self._write(self._held.popleft())
        finally:
            self._csv.close()
            self._h5.close()

    def __enter__(self) -> Results:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _is_final(self, measurement: Measurement, newest_t: float) -> bool:
        return self._loads.covers(measurement.t) or newest_t - measurement.t > HOLD_S

    def _write(self, measurement: Measurement) -> None:
        force = self._loads.force_at(measurement.t)
        row = Row.of(measurement, force, self._info)
        self._h5.write(row)
        self._csv.write(row)
        self.written += 1
