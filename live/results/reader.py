"""Reads ``strain.h5`` back, also the one a killed process left behind.

Maps are read from the file on request; the columns are in memory. HDF5 may wait for ever on an unfinished
file that is damaged too, so a child process, ``python -m live.results FILE``, reads such a file first. A file
that does not hold what ``layout`` declares is refused.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire import hdf5
from acquire.errors import ConfigError, DataError
from acquire.opening import Closing
from acquire.text.message import Message, word
from analysis.field import ZoiGrid
from live.results import layout
from live.results.quantities import Display, mean_name, quantity_of
from live.results.stored_response import StoredResponse, read_response

_log = logging.getLogger(__name__)
_ROUNDING_S = 1e-6  # of times that were typed
_LENGTH, _POSITION = hdf5.JsonField(int, 1, layout.MAX_SIDE_PX), hdf5.JsonField(int, 0, layout.MAX_SIDE_PX)


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
    names : tuple of str
        Maps of each instant.
    response : StoredResponse or None
        What each place did over all instants; its maps are among those of ``maps`` too, the same at each instant.
    """

    def __init__(self, path: Path, file: Any, *, unfinished: bool) -> None:
        self.path, self._file, self.unfinished = path, file, unfinished
        root = hdf5.read_attributes(file, layout.ROOT)
        hdf5.check_links(file)
        entry = hdf5.open_group(file, "entry")
        strain, mean = hdf5.open_group(entry, "strain"), hdf5.open_group(entry, "mean")
        self.start_utc = hdf5.as_text(root["start_time"])
        described = hdf5.read_attributes(strain, layout.STRAIN)
        self.strain_measure = hdf5.as_text(described["strain_measure"])
        self.grid = _grid(strain, described["grid"], path)
        self.config, self.metadata, self.versions = (
            hdf5.read_object(item[()], f"{path}: {name}")
            for name, item in hdf5.open_datasets(entry, layout.TEXTS).items()
        )
        self._maps = hdf5.open_datasets(strain, layout.maps(self.grid.shape))
        self.names = tuple(self._maps)
        self._references = _references(entry, self.grid.shape)
        self.response: StoredResponse | None = read_response(entry, self.grid.shape)
        columns = _columns(mean)
        self.n = _rows(path, [*self._maps.values(), *columns.values()], whole=not unfinished)
        self.values: dict[str, NDArray[Any]] = {name: item[: self.n] for name, item in columns.items()}
        self.time_s: NDArray[np.float64] = self.values["time_s"]
        _warn_of_times(path, self.time_s)

    @classmethod
    def open(cls, path: Path, *, probed: bool = False) -> Strain:
        """Open the results at ``path``; ``probed``: no child process reads it first.

        Raises
        ------
        DataError
            Missing, not HDF5, not of phasedic, newer than this program, or damaged.
        """
        file, unfinished = _open(path, probed)
        try:
            hdf5.check_format(path, file, layout.ROOT, layout.FORMAT, layout.FORMAT_VERSION)
            return cls(path, file, unfinished=unfinished)
        except DataError:
            file.close()
            raise
        except hdf5.DAMAGE as error:
            file.close()
            raise DataError(
                "{path}: is damaged ({why}); make it again with phasedic replay", path, error
            ) from error

    @property
    def whole_names(self) -> tuple[str, ...]:
        """Maps of the whole test: those of ``response``."""
        return () if self.response is None else self.response.names

    def check_measured(self) -> None:
        """Raises DataError where there is no row."""
        if not self.n:
            raise DataError("{path}: holds no measurement", self.path)

    def rows_between(self, start_s: float | None, end_s: float | None, options: str) -> tuple[int, ...]:
        """The rows between two times, s since the start of the test, both included.

        Parameters
        ----------
        start_s, end_s : float or None, s
        options : str
            Which give them, for the message.

        Raises
        ------
        ConfigError
            There is none.
        DataError
            The file holds no measurement.
        """
        self.check_measured()
        t = self.time_s
        low, high = t[0] if start_s is None else start_s, t[-1] if end_s is None else end_s
        rows = np.flatnonzero((t >= low - _ROUNDING_S) & (t <= high + _ROUNDING_S))
        if not rows.size:
            raise ConfigError(
                "{options}: no measurement between {low:g} and {high:g} s; the test has {first:.6g} to {last:.6g} s",
                *(options, low, high, t[0], t[-1]),
            )
        return tuple(rows.tolist())

    def maps(self, name: str, row: int | slice = slice(None)) -> NDArray[Any]:
        """(T, R, C) maps of ``name`` (see ``names``), or the (R, C) map of one row.

        Raises
        ------
        DataError
            There is no such map or row.
        """
        names = (*self.names, *self.whole_names)
        if name not in names:
            raise DataError(
                "{path}: no map {name}; there are {known}", self.path, repr(name), ", ".join(names)
            )
        if isinstance(row, int) and not -self.n <= row < self.n:
            self.check_measured()
            raise DataError(
                "{path}: no row {row}; give 0 to {last}, or -1 (the last) to {first}",
                self.path,
                row,
                self.n - 1,
                -self.n,
            )
        rows = range(self.n)[row]
        try:
            if self.response is not None and name in self.response.names:
                one = self.response.map(name)
                return one if isinstance(rows, int) else np.broadcast_to(one, (len(rows), *one.shape))
            dataset = self._maps[name]
            if isinstance(rows, int):
                return np.asarray(dataset[rows])
            return np.asarray(dataset[rows.start : rows.stop : rows.step])
        except (OSError, RuntimeError) as error:
            raise DataError(
                "{path}: map {name} cannot be read ({why}); make it again", self.path, repr(name), error
            ) from error

    def reference(self, row: int) -> int | None:
        """The number of the reference at one row, for ``normal``.

        None in files of earlier versions, and of the estimator by phases.
        """
        if not self._references:
            return None
        found = np.flatnonzero(
            self._references[layout.FIRST_ROW][: len(self._references[layout.NORMAL])] <= row
        )
        return int(found[-1]) if found.size else None

    def normal(self, reference: int) -> NDArray[np.float32]:
        """Normal matrices of the ZOIs of a reference, by which areas weigh them: upper triangles (21, R, C).

        Raises
        ------
        DataError
            They cannot be read.
        """
        try:
            return np.asarray(self._references[layout.NORMAL][reference])
        except (OSError, RuntimeError, ValueError) as error:
            raise DataError(
                "{path}: the normal matrices cannot be read ({why}); make it again", self.path, error
            ) from error

    @property
    def force_one_zero(self) -> NDArray[np.float64]:
        """The force as if the zero of the first instant had held to the end, (T,) N: no tare in mid-test."""
        force, zero = np.asarray(self.values["force_N"], np.float64), self.values.get("zero_N")
        return force if zero is None else force + np.asarray(zero - zero[:1], np.float64)

    def to_xarray(self, *fields: str, display: Display | None = None) -> Any:
        """Maps and means as an ``xarray.Dataset`` with coordinates ``time`` (s), ``y`` and ``x`` and units.

        Parameters
        ----------
        *fields : str
            Maps; all where none is named.
        display : Display, optional
            Units and axes; else as the file holds them (px, y down).

        Raises
        ------
        ConfigError
            xarray is not installed (``pip install 'phasedic[xarray]'``).
        DataError
            There is no such map, or it cannot be read.
        """
        try:
            import xarray
        except ImportError:
            raise ConfigError("this needs xarray: pip install 'phasedic[xarray]'") from None
        display = display or Display()

        def variable(axes: Any, name: str, values: NDArray[Any]) -> tuple[Any, NDArray[Any], dict[str, str]]:
            return axes, values, {"units": display.unit(name), "long_name": str(quantity_of(name).words)}

        names = [name for name in self.values if name != "time_s"]
        data = {
            n: variable(("time", "y", "x"), n, display.shown(n, self.maps(n))) for n in fields or self.names
        }
        data |= {mean_name(n): variable("time", n, display.shown(n, self.values[n])) for n in names}
        coordinates = {
            "time": ("time", self.time_s, {"units": "s"}),
            "y": variable("y", "y", display.y(self.grid)),
            "x": variable("x", "x", display.x(self.grid)),
        }
        about = {
            "strain_measure": self.strain_measure, "start_time": self.start_utc, "axes": display.axes(),
        }  # fmt: skip
        return xarray.Dataset(data, coordinates, about)

    def __repr__(self) -> str:
        rows, columns = self.grid.shape
        return f"<Strain {self.path.name}: {self.n} instants of {rows} x {columns} ZOIs, {self.strain_measure} strain>"

    def close(self) -> None:
        """Close the file; idempotent."""
        self._file.close()


def _open(path: Path, probed: bool) -> tuple[Any, bool]:
    import h5py

    if not path.exists():
        raise DataError("{path}: no such file; phasedic run and replay write a strain.h5 into --out", path)
    if not path.is_file() or not h5py.is_hdf5(path):
        raise DataError("{path}: is not an HDF5 file; give a strain.h5 of phasedic", path)
    block = hdf5.read_superblock(path)
    hdf5.check_size(path, block)
    if block.unfinished and not probed:
        hdf5.probe(path, "live.results")
    try:
        file = hdf5.open_file(path, swmr=block.unfinished)
    except (OSError, RuntimeError) as error:
        raise DataError(
            "{path}: cannot be opened ({why}); make it again with phasedic replay", path, error
        ) from error
    if block.unfinished:
        _log.warning(Message("{path} was not closed by its writer; reading all its complete rows", path))
    return file, block.unfinished


def _grid(strain: Any, text: Any, path: Path) -> ZoiGrid:
    """The grid; its description and the arrays in the file must agree."""
    where = f"{path}: the grid"
    described = hdf5.read_object(text, where)
    hdf5.check_object(described, {"roi": hdf5.JsonField(dict), "size": _LENGTH, "step": _LENGTH}, where)
    hdf5.check_object(
        described["roi"], {"x": _POSITION, "y": _POSITION, "width": _LENGTH, "height": _LENGTH}, where
    )
    active = hdf5.open_dataset(strain, "active", layout.GRID["active"])
    shape = tuple(
        (described["roi"][name] - described["size"]) // described["step"] + 1 for name in ("height", "width")
    )
    if active.shape != shape:
        raise DataError(
            "{where} is described as {shape} ZOIs, but {found} are there; make it again",
            *(where, shape, active.shape),
        )
    grid = ZoiGrid.from_dict(described, hdf5.read_scalar(active, layout.GRID["active"]).astype(bool))
    for name, places in (("x", grid.x), ("y", grid.y)):
        if not np.array_equal(hdf5.open_dataset(strain, name, layout.GRID[name])[()], places):
            raise DataError(
                "{where} has other centres {name} than its description; make it again", where, name
            )
    return grid


def _references(entry: Any, shape: tuple[int, int]) -> dict[str, Any]:
    """What is stored of each reference; nothing in files of earlier versions."""
    if layout.REFERENCES not in entry:
        return {}
    return hdf5.open_datasets(hdf5.open_group(entry, layout.REFERENCES), layout.references(shape))


def _columns(mean: Any) -> dict[str, Any]:
    """All columns: those that every file has, and those that another version added."""
    declared = {*layout.REQUIRED, *(name for name in mean if name in layout.KNOWN)}
    known = {name: layout.column(name) for name in declared}
    present = (name for name in mean if not name.endswith(layout.ERRORS))
    return hdf5.open_datasets(mean, dict.fromkeys(present, layout.ANY_COLUMN) | known)


def _rows(path: Path, datasets: Sequence[Any], *, whole: bool) -> int:
    """Whole rows; a kill may fall between two datasets of one."""
    lengths = {hdf5.stored_rows(item) for item in datasets}
    if whole and lengths | {len(item) for item in datasets} != {min(lengths)}:
        raise DataError(
            "{path}: its maps and columns are not of one length; make it again with phasedic replay", path
        )
    return min(lengths)


def _warn_of_times(path: Path, times: NDArray[np.float64]) -> None:
    for count, what in (
        (np.count_nonzero(np.isnan(times)), word("rows have no time")),
        (np.count_nonzero(np.diff(times) < 0), word("times run backwards")),
    ):
        if count:
            _log.warning(Message("{path}: {n} {what}; they are used as they are", path, count, what))


def whole_maps(path: Path) -> dict[str, NDArray[Any]]:
    """The maps of the whole test in a ``strain.h5``, (R, C), but those without a value; raises DataError."""
    with Strain.open(path) as strain:
        maps = {name: strain.maps(name, 0) for name in strain.whole_names}
    return {name: values for name, values in maps.items() if np.isfinite(values).any()}
