"""Reads ``strain.h5`` back, also the one a killed process left behind.

Maps are fetched from the file when asked for; per-row values are in memory. HDF5 may wait for ever
on an unfinished file that was damaged too, so such a file is first read by a child process,
``python -m live.results FILE``. A file that does not hold what ``layout`` declares is refused.

Results as an ``xarray.Dataset``, where xarray is installed (``phasedic[xarray]``).
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from acquire.closing import Closing
from acquire.errors import ConfigError, DataError
from acquire.hdf5 import (
    Declared,
    JsonField,
    as_text,
    check_links,
    check_object,
    check_size,
    open_dataset,
    open_datasets,
    open_group,
    probe,
    read_attribute,
    read_object,
    read_scalar,
    read_superblock,
    stored_rows,
)
from analysis.field import ZoiGrid
from live.results import layout
from live.results.quantities import MEANS, quantity_of
from live.results.row import FORMAT, FORMAT_VERSION


class ShownAs(Protocol):
    """In which units and axes numbers come out."""

    def shown(self, name: str, values: NDArray[Any]) -> NDArray[Any]: ...
    def unit(self, name: str) -> str: ...
    def x(self, grid: ZoiGrid) -> NDArray[np.float64]: ...
    def y(self, grid: ZoiGrid) -> NDArray[np.float64]: ...
    def axes(self) -> str: ...


class Stored:
    """As the file holds them: px, y down, strains dimensionless."""

    def shown(self, name: str, values: NDArray[Any]) -> NDArray[Any]:
        """The same."""
        return values

    def unit(self, name: str) -> str:
        """As it is kept."""
        return quantity_of(name).unit

    def x(self, grid: ZoiGrid) -> NDArray[np.float64]:
        """(C,), px."""
        return grid.x

    def y(self, grid: ZoiGrid) -> NDArray[np.float64]:
        """(R,), px."""
        return grid.y

    def axes(self) -> str:
        """In words."""
        return (
            "x right, y down, px, from the centre of the first pixel; all values lie on the reference picture"
        )


def dataset(strain: Strain, shown: ShownAs, fields: tuple[str, ...] | None = None) -> Any:
    """Maps and means with coordinates ``time``, ``y``, ``x`` and units; ``fields`` are maps, all without.

    Raises
    ------
    ConfigError
        xarray is not installed.
    DataError
        There is no such map, or it cannot be read.
    """
    try:
        import xarray
    except ImportError:
        raise ConfigError("this needs xarray: pip install 'phasedic[xarray]'") from None
    maps = {
        name: (("time", "y", "x"), shown.shown(name, strain.maps(name)), _attributes_dataset(shown, name))
        for name in fields or strain.names
    }
    means = {
        mean_name(name): ("time", shown.shown(name, values), _attributes_dataset(shown, name))
        for name, values in strain.values.items()
        if name != "time_s"
    }
    places = {
        "time": ("time", strain.time_s, {"units": "s"}),
        "y": ("y", shown.y(strain.grid), _attributes_dataset(shown, "y")),
        "x": ("x", shown.x(strain.grid), _attributes_dataset(shown, "x")),
    }
    about = {"strain_measure": strain.strain_measure, "start_time": strain.start_utc, "axes": shown.axes()}
    return xarray.Dataset({**maps, **means}, places, about)


def mean_name(name: str) -> str:
    """The name of a column where it stands beside maps, which may have the same."""
    plain = MEANS.get(name, name)
    if plain.removeprefix("sigma_").startswith("gauge_"):
        return plain
    averaged = quantity_of(plain.removeprefix("sigma_")).is_strain or plain in ("u", "v")
    return f"mean_{plain}" if averaged else plain


def _attributes_dataset(shown: ShownAs, name: str) -> dict[str, str]:
    return {"units": shown.unit(name), "long_name": quantity_of(name).words}


_log = logging.getLogger(__name__)
_LENGTH, _PLACE = JsonField(int, 1, layout.MOST_PIXELS), JsonField(int, 0, layout.MOST_PIXELS)


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
        root = _attributes(file, layout.ROOT)
        check_links(file)
        entry = open_group(file, "entry")
        strain, mean = open_group(entry, "strain"), open_group(entry, "mean")
        self.start_utc = as_text(root["start_time"])
        said = _attributes(strain, layout.STRAIN)
        self.strain_measure = as_text(said["strain_measure"])
        self.grid = _grid(strain, said["grid"], path)
        self.config, self.metadata, self.versions = (
            read_object(item[()], f"{path}: {name}")
            for name, item in open_datasets(entry, layout.TEXTS).items()
        )
        self.names = layout.MAPS
        self._maps = open_datasets(strain, {n: layout.map_declared(n, self.grid.shape) for n in self.names})
        columns = _columns(mean)
        self.n = _rows(path, [*self._maps.values(), *columns.values()], whole=not unfinished)
        self.values: dict[str, NDArray[Any]] = {name: item[: self.n] for name, item in columns.items()}
        self.time_s: NDArray[np.float64] = self.values["time_s"]
        _tell_of_times(path, self.time_s)

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
        except (
            LookupError,
            OSError,
            RuntimeError,
            ValueError,
            TypeError,
            MemoryError,
            OverflowError,
        ) as error:
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
        dataset = self._maps[name]
        try:
            if isinstance(rows, int):
                return np.asarray(dataset[rows])
            return np.asarray(dataset[rows.start : rows.stop : rows.step])
        except (OSError, RuntimeError) as error:
            raise DataError(f"{self.path}: map {name!r} cannot be read ({error}); make it again") from error

    @property
    def force_one_zero(self) -> NDArray[np.float64]:
        """The force as if the zero of the first instant had held to the end, (T,) N: no tare in mid-test."""
        force, zero = np.asarray(self.values["force_N"], np.float64), self.values.get("zero_N")
        return force if zero is None else force + np.asarray(zero - zero[:1], np.float64)

    def to_xarray(self, *fields: str) -> Any:
        """Maps and means as an ``xarray.Dataset`` with coordinates ``time`` (s), ``y`` and ``x`` (px) and units.

        Parameters
        ----------
        *fields : str
            Maps; all without.

        Raises
        ------
        ConfigError
            xarray is not installed (``pip install 'phasedic[xarray]'``).
        DataError
            There is no such map, or it cannot be read.
        """
        return dataset(self, Stored(), fields or None)

    def __repr__(self) -> str:
        rows, columns = self.grid.shape
        return f"<Strain {self.path.name}: {self.n} instants of {rows} x {columns} ZOIs, {self.strain_measure} strain>"

    def close(self) -> None:
        """Close the file; again without effect."""
        self._file.close()


def _open(path: Path, probed: bool) -> tuple[Any, bool]:
    import h5py

    if not path.exists():
        raise DataError(f"{path}: no such file; phasedic run and replay write a strain.h5 into --out")
    if not path.is_file() or not h5py.is_hdf5(path):
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
    found = as_text(read_attribute(file, "format", layout.ROOT["format"])) if "format" in file.attrs else None
    if found != FORMAT:
        shown = "something else" if found is None else repr(found[:40])
        raise DataError(f"{path}: holds {shown}, not {FORMAT}; give a strain.h5")
    version = read_attribute(file, "format_version", layout.ROOT["format_version"])
    if int(version) > FORMAT_VERSION:
        raise DataError(
            f"{path}: format version {version}, this program reads up to {FORMAT_VERSION}; update phasedic"
        )


def _attributes(item: Any, declared: Mapping[str, Declared]) -> dict[str, Any]:
    return {name: read_attribute(item, name, what) for name, what in declared.items()}


def _grid(strain: Any, text: Any, path: Path) -> ZoiGrid:
    """The grid, once its description and what stands in the file agree."""
    where = f"{path}: the grid"
    said = read_object(text, where)
    check_object(said, {"roi": JsonField(dict), "size": _LENGTH, "step": _LENGTH}, where)
    check_object(said["roi"], {"x": _PLACE, "y": _PLACE, "width": _LENGTH, "height": _LENGTH}, where)
    active = open_dataset(strain, "active", Declared("u1", (None, None), 0, 1))
    shape = tuple((said["roi"][name] - said["size"]) // said["step"] + 1 for name in ("height", "width"))
    if active.shape != shape:
        raise DataError(f"{where} is described as {shape} ZOIs, but {active.shape} are there; make it again")
    grid = ZoiGrid.from_dict(said, read_scalar(active, Declared("u1", shape, 0, 1)).astype(bool))
    for name, places in (("x", grid.x), ("y", grid.y)):
        if not np.array_equal(open_dataset(strain, name, Declared("f8", places.shape))[()], places):
            raise DataError(f"{where} has other centres {name} than its description says; make it again")
    return grid


def _columns(mean: Any) -> dict[str, Any]:
    """All columns: those that every file has, and whatever another version has added."""
    ours = {*layout.NEEDED, *(name for name in mean if name in layout.KNOWN)}
    known = {name: layout.column_declared(name) for name in ours}
    there = (name for name in mean if not name.endswith(layout.ERRORS))
    return open_datasets(mean, dict.fromkeys(there, layout.ANY_COLUMN) | known)


def _rows(path: Path, datasets: Sequence[Any], *, whole: bool) -> int:
    """Whole rows; a kill may fall between two datasets of one."""
    lengths = {stored_rows(item) for item in datasets}
    if whole and lengths | {len(item) for item in datasets} != {min(lengths)}:
        raise DataError(
            f"{path}: its maps and columns are not of one length; make it again with phasedic replay"
        )
    return min(lengths)


def _tell_of_times(path: Path, times: NDArray[np.float64]) -> None:
    for count, what in (
        (np.count_nonzero(np.isnan(times)), "rows have no time"),
        (np.count_nonzero(np.diff(times) < 0), "times run backwards"),
    ):
        if count:
            _log.warning("%s: %d %s; they are taken as they stand", path, count, what)
