"""``strain.h5``: the strain maps of a test, crash-safe and readable by NeXus viewers.

Every dataset and attribute is made before SWMR mode is switched on, and rows are flushed soon: after a kill they are
in the file (open it with ``swmr=True``, as ``Strain.open`` does).
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquire import hdf5
from acquire.clock import Clock
from acquire.errors import DataError
from acquire.text import Message
from acquire.text.message import counted
from analysis.evaluate import load_axis
from live.results import layout
from live.results.layout import STRAINS, StrainRow, gauge_columns
from live.results.stored_response import CORRELATION, CURRENT, GROUP, add_group

if TYPE_CHECKING:
    from analysis.field import Sums, ZoiGrid
    from live.results.layout import ResultsInfo

VALUE_BITS, SIGMA_BITS = 9, 9
"""Binary digits kept: of a value below its standard uncertainty; of an uncertainty."""
FLUSH_S = 0.25  # a row of a live test waits for its flush no longer than this


class StrainWriter:
    """Makes the file and appends rows to it.

    Parameters
    ----------
    path : Path
    grid : ZoiGrid
    info : ResultsInfo
    flush_s : float, s
        A row waits for its flush no longer than this.
    now : callable
        Gives seconds; times the flushes.

    Raises
    ------
    DataError
        The file exists or cannot be written. After a failed write ``failed`` is True, and what
        was flushed before stays readable.
    """

    def __init__(
        self,
        path: Path,
        grid: ZoiGrid,
        info: ResultsInfo,
        flush_s: float = FLUSH_S,
        now: Clock = time.monotonic,
    ) -> None:
        self._path, self.failed, self._axis = path, False, info.axis
        self._flushed = 0  # rows
        self._timer = hdf5.FlushTimer(flush_s, now)
        with self._guard():
            self._file = hdf5.create_file(path, lambda file: _declare(file, grid, info))
        entry = self._file["entry"]
        self._maps = {n: hdf5.PictureStack(entry["strain"][n]) for n in layout.maps(grid.shape)}
        self._values = hdf5.RowTable(entry["mean"], list(layout.mean(info.gauges, info.extras)))
        references = entry[layout.REFERENCES]
        self._normal, self._first_row = (
            hdf5.PictureStack(references[layout.NORMAL]),
            references[layout.FIRST_ROW],
        )
        of_response = (CURRENT, CORRELATION) if info.response else ()
        self._noise = [hdf5.GrowingDataset(entry[GROUP][name]) for name in of_response]
        self._grid = grid
        self._pattern: Sums | None = None

    def write(self, row: StrainRow) -> None:
        """Append one row."""
        with self._guard():
            self._append(row)
        self._timer.wrote()
        self.flush_when_due()

    def flush_when_due(self) -> float:
        """Flush where a row has waited for ``flush_s``; ``write`` does that too.

        Returns
        -------
        float, s
            Time after which this must be called again if no row comes; infinite where none waits.
        """
        if self._timer.left_s() == 0:
            with self._guard():
                self._flush()
        return self._timer.left_s()

    def close(self) -> None:
        """Close the file; after a failed write, leave it as it is on the disk."""
        if self.failed:
            hdf5.abandon_file(self._file)
        else:
            with self._guard():
                self._flush()
                # Viewers begin with the last instant; with the first, where the file was never closed.
                shown = _slice_of(max(self._values.length - 1, 0))
                self._file["entry/strain"].attrs.modify("default_slice", shown)
                self._write_axis()
                self._file.close()

    def _append(self, row: StrainRow) -> None:
        values = self._values.row(row.values)
        if row.pattern is not None and row.pattern is not self._pattern:
            self._pattern = row.pattern
            self._normal.append(normal_matrices(row.pattern, self._grid))
            self._first_row.resize((self._normal.length,))
            self._first_row[-1] = next(iter(self._maps.values())).length
            if row.noise is not None:
                self._noise[1].append(row.noise[1][None].astype(np.float32))
        for name, stored in rounded(row.maps).items():
            self._maps[name].append(stored)
        if row.noise is not None:
            self._noise[0].append(np.array([row.noise[0]], np.float32))
        self._values.hold(values)

    def _flush(self) -> None:
        self._timer.began()
        self._values.write()
        self._file.flush()
        self._timer.done()
        self._flushed = self._values.length

    def _write_axis(self) -> None:
        """The axis of the load, and the angle from it to the largest strain, found from all means."""
        mean = self._file["entry/mean"]
        exx, eyy, exy, s_xx, s_yy = (
            np.asarray(mean[name], np.float64) for name in (*STRAINS, "sigma_exx", "sigma_eyy")
        )
        load = load_axis(exx, eyy, exy, self._axis, np.fmax(s_xx, s_yy))
        mean.attrs.modify("load_axis", np.array(load.axis, "S1"))
        mean.attrs.modify("load_angle_deg", np.float64(math.degrees(load.angle.value)))

    @contextmanager
    def _guard(self) -> Iterator[None]:
        try:
            yield
        except (OSError, RuntimeError) as error:  # HDF5 reports a full disk as a RuntimeError
            self.failed = True
            raise self._trouble(error) from error

    def _trouble(self, error: Exception) -> DataError:
        kept = Message("; {rows} before can be read", counted(self._flushed, "row")) if self._flushed else ""
        return DataError(
            "{path}: cannot be written ({why}){kept}; make room on the disk or choose another --out",
            self._path,
            hdf5.reason(error),
            kept,
        )


def normal_matrices(pattern: Sums, grid: ZoiGrid) -> NDArray[np.float32]:
    """Upper triangles of the normal matrices of all ZOIs, (21, R, C), zero where one has no pattern."""
    at = np.flatnonzero(grid.active)
    out = np.zeros((layout.N_PAIRS, *grid.shape), np.float32)
    out.reshape(layout.N_PAIRS, -1)[:, at] = pattern.information(at)[np.triu_indices(6)]
    return out


def rounded(maps: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """The maps without the digits that are noise, which no compression makes smaller.

    A value keeps the binary digits down to 1/512 of its standard uncertainty (so it changes by 1/1024 of it at
    most), a standard uncertainty and the residual keep nine significant ones (0.2 %). Values without an
    uncertainty stay as they are.
    """
    stored = dict(maps)
    for name in (*layout.PLAIN_MAPS, "blur"):
        sigma = maps[f"sigma_{name}"]
        stored[name] = _to_digit(maps[name], np.frexp(sigma)[1] - 1 - VALUE_BITS, sigma)
    for name in (*(f"sigma_{name}" for name in (*layout.PLAIN_MAPS, "blur")), "residual"):
        stored[name] = _to_digit(maps[name], np.frexp(maps[name])[1] - SIGMA_BITS, maps[name])
    return stored


def _to_digit(values: NDArray[Any], digit: NDArray[Any], scale: NDArray[Any]) -> NDArray[Any]:
    """Round to multiples of 2**digit, where ``scale``, from which the digit is, is a number above 0."""
    with np.errstate(invalid="ignore", over="ignore"):
        multiple = np.ldexp(np.rint(np.ldexp(values, -digit)), digit)
        return np.where(np.isfinite(multiple) & (scale > 0) & np.isfinite(scale), multiple, values)


def _declare(file: Any, grid: ZoiGrid, info: ResultsInfo) -> None:
    """Everything but the rows. Texts have no fixed length, as h5py makes them by itself."""
    file.attrs.update(
        NX_class="NXroot",
        default="entry",
        format=layout.FORMAT,
        format_version=layout.FORMAT_VERSION,
        creator="phasedic",
        start_time=info.start_utc,
    )
    entry = hdf5.new_group(file, "entry", "NXentry", fixed=False, default="strain")
    notes = {name: json.dumps(getattr(info, name), default=str, indent=1) for name in layout.TEXTS}
    title = hdf5.storable(str(info.metadata.get("specimen", "") or "phasedic"))
    begin = {"start_time": info.start_utc, "start_monotonic_s": info.start_monotonic, "title": title}
    hdf5.new_datasets(entry, layout.ENTRY, begin | notes, fixed=False)
    _add_strain(entry, grid, info)
    references = hdf5.new_group(entry, layout.REFERENCES, "NXcollection", fixed=False)
    hdf5.new_datasets(references, layout.references(grid.shape), fixed=False)
    if info.response:
        add_group(entry, info.response, grid.shape)
    _add_mean(entry, info)
    _add_gauges(entry, info)
    _add_camera(entry, info)


def _slice_of(row: int) -> Any:
    """The map that viewers show first (NeXus default_slice), of fixed length: it is changed in place."""
    return np.array([str(row), ".", "."], "S12")


def _add_strain(entry: Any, grid: ZoiGrid, info: ResultsInfo) -> None:
    strain = hdf5.new_group(
        entry, "strain", "NXdata", fixed=False, signal="eyy", axes=["time_s", "y", "x"],
        strain_measure=info.strain_measure,
        grid=json.dumps(grid.to_dict()),
        frame_of_reference="fields lie on the reference picture; x right, y down, px",
        auxiliary_signals=["exx", "exy"],
        title=f"Strain maps, {info.strain_measure} strain",
        default_slice=_slice_of(0),
    )  # fmt: skip
    places = {"x": np.asarray(grid.x, np.float64), "y": np.asarray(grid.y, np.float64)}
    values = {
        **places,
        "active": grid.active.astype(np.uint8),
        "size": int(grid.size),
        "step": int(grid.step),
    }
    hdf5.new_datasets(strain, layout.maps(grid.shape) | layout.GRID, values, fixed=False)
    for name in (*layout.PLAIN_MAPS, "blur"):
        strain[f"{name}{layout.ERRORS}"] = strain[f"sigma_{name}"]


def _add_mean(entry: Any, info: ResultsInfo) -> None:
    mean = hdf5.new_group(
        entry, "mean", "NXdata", fixed=False, signal="eyy", axes=["time_s"], title="Strains of the region",
        auxiliary_signals=["exx", "exy"],
        load_axis=np.array("x" if info.axis == "x" else "y", "S1"),
        load_angle_deg=np.float64(math.nan),
    )  # fmt: skip
    hdf5.new_datasets(mean, layout.mean(info.gauges, info.extras), fixed=False)
    for name in STRAINS:
        mean[f"{name}{layout.ERRORS}"] = mean[f"sigma_{name}"]
    for name in ("time_s", "force_N", "frame", "last_frame", "n_frames", "noise_GL", "lost"):
        entry[f"strain/{name}"] = mean[name]


def _add_gauges(entry: Any, info: ResultsInfo) -> None:
    """The columns of the virtual gauges by their names, with the description of each."""
    if not info.gauges:
        return
    first = next(iter(info.gauges))
    group = hdf5.new_group(
        entry, "gauges", "NXdata", fixed=False, signal=first, axes=["time_s"], title="Virtual gauges"
    )
    group["time_s"] = entry["mean/time_s"]
    for name in info.gauges:
        column, sigma, _ = gauge_columns(name)
        group[name], group[f"sigma_{name}"] = entry["mean"][column], entry["mean"][sigma]
        group[f"{name}{layout.ERRORS}"] = entry["mean"][sigma]


def _add_camera(entry: Any, info: ResultsInfo) -> None:
    camera = hdf5.new_group(entry, "camera", "NXdetector", fixed=False)
    if info.camera is None:
        return
    camera["description"] = hdf5.storable(info.camera.name)
    names = ("address", "width", "height", "bits", "fps", "exposure_s", "pixel_format", "clock")
    known = {name: value for name in names if (value := getattr(info.camera, name)) is not None}
    hdf5.set_attributes(
        camera, fixed=False, **known, controls=json.dumps(dict(info.camera.controls), default=str)
    )
