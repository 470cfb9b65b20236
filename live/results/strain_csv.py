"""``strain.csv``: one line a measurement, flushed as it is written; the header carries the units."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain
from pathlib import Path

from acquire.errors import DataError
from live.config.figures import columns
from live.results.row import StrainRow, gauge_columns

COLUMNS = columns()
"""Of all valid ZOIs; strains are dimensionless. Then come those of ``ResultsInfo.extras``, and value,
sigma and share of each virtual gauge."""


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
