"""Reads ``strain.h5`` back, also the one a killed process left behind.

Maps are fetched from the file when asked for; per-row values are in memory. HDF5 may wait for ever
on an unfinished file that was damaged too, so such a file is first read by a child process,
``python -m live.results FILE``.
"""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.closing import Closing
from acquire.errors import DataError
from acquire.hdf5 import check_size, probe, read_superblock
from analysis.field import ZoiGrid
from live.results.info import FORMAT, FORMAT_VERSION

_log = logging.getLogger(__name__)


class Strain(Closing):
    """The results of a test, open for reading; a context manager.

    Attributes
    ----------
    path : Path
    n : int
        Complete rows.
    unfinished : bool
        The file was never closed (its writer was killed, or still runs); all ``n`` rows are whole.
    grid : ZoiGrid
        With its centres ``x`` (C,), ``y`` (R,), ``size``, ``step`` (px) and ``active`` (R, C).
    time_s : (T,) float64, s
        Since the start of the test.
    start_utc : str
        ISO 8601.
    strain_measure : str
        "small", "green" or "hencky".
    config, metadata, versions : dict
    values : mapping of name to (T,) array
        The columns of ``strain.csv``, ``force_N`` and the means among them.
    """

    def __init__(self, path: Path, file: Any, *, unfinished: bool) -> None:
        self.path, self._file, self.unfinished = path, file, unfinished
        entry, strain = file["entry"], file["entry/strain"]
        self.start_utc = str(file.attrs["start_time"])
        self.strain_measure = str(strain.attrs["strain_measure"])
        self.grid = ZoiGrid.from_dict(json.loads(strain.attrs["grid"]), strain["active"][()].astype(bool))
        self.config, self.metadata, self.versions = (
            json.loads(entry[name].asstr()[()]) for name in ("config", "metadata", "versions")
        )
        self.names = tuple(name for name, item in strain.items() if item.ndim == 3)
        # A kill may fall between two datasets of a row: only whole rows count.
        self.n = min(
            *(len(strain[name]) for name in self.names), *(len(item) for item in entry["mean"].values())
        )
        self.values: dict[str, NDArray[Any]] = {k: v[: self.n] for k, v in entry["mean"].items()}
        self.time_s: NDArray[np.float64] = self.values["time_s"]

    @classmethod
    def open(cls, path: Path, *, probed: bool = False) -> Strain:
        """Open the results at ``path``; ``probed``: a child process need not look first.

        Raises
        ------
        DataError
            Missing, not HDF5, not ours, newer than this program, or damaged.
        """
        file, unfinished = _open(path, probed)
        try:
            _check(path, file)
            return cls(path, file, unfinished=unfinished)
        except DataError:
            file.close()
            raise
        except (KeyError, OSError, RuntimeError, ValueError) as error:
            file.close()
            raise DataError(f"{path}: is damaged ({error}); make it again with phasedic replay") from error

    def maps(self, name: str, row: int | slice = slice(None)) -> NDArray[Any]:
        """(T, R, C) maps of ``name`` (see ``names``), or the (R, C) map of one row.

        Raises
        ------
        DataError
            There is no such map or row.
        """
        if name not in self.names:
            raise DataError(f"{self.path}: no map {name!r}; there are {', '.join(self.names)}")
        if isinstance(row, int) and not -self.n <= row < self.n:
            raise DataError(f"{self.path}: no row {row}; there are {self.n}")
        rows = range(self.n)[row]
        dataset = self._file["entry/strain"][name]
        try:
            if isinstance(rows, int):
                return np.asarray(dataset[rows])
            return np.asarray(dataset[rows.start : rows.stop : rows.step])
        except (OSError, RuntimeError) as error:
            raise DataError(f"{self.path}: map {name!r} cannot be read ({error}); make it again") from error

    def close(self) -> None:
        """Close the file; again without effect."""
        self._file.close()


def _open(path: Path, probed: bool) -> tuple[Any, bool]:
    import h5py

    if not path.is_file():
        raise DataError(f"{path}: no such file; phasedic run and replay write a strain.h5 into --out")
    if not h5py.is_hdf5(path):
        raise DataError(f"{path}: is not an HDF5 file; give a strain.h5 of phasedic")
    block = read_superblock(path)
    check_size(path, block)
    if block.unfinished and not probed:
        probe(path, "live.results")
    try:
        file = h5py.File(path, "r", swmr=block.unfinished)
    except (OSError, RuntimeError) as error:
        raise DataError(f"{path}: cannot be opened ({error}); make it again with phasedic replay") from error
    if block.unfinished:
        _log.warning("%s was not closed by its writer; reading all its complete rows", path)
    return file, block.unfinished


def _check(path: Path, file: Any) -> None:
    found, version = file.attrs.get("format"), file.attrs.get("format_version")
    if found != FORMAT:
        raise DataError(f"{path}: holds {found or 'something else'}, not {FORMAT}; give a strain.h5")
    if version is None or int(version) > FORMAT_VERSION:
        raise DataError(
            f"{path}: format version {version}, this program reads up to {FORMAT_VERSION}; update phasedic"
        )
