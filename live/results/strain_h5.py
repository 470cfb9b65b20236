"""``strain.h5``: the strain maps of a test, crash-safe and readable by NeXus viewers.

Every dataset and attribute is made before SWMR mode is switched on, and rows are flushed soon: after a kill they are
in the file (open it with ``swmr=True``, as ``Strain.open`` does).
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from acquire.hdf5 import (
    COMPRESSED,
    FlushTimer,
    GrowingDataset,
    PictureStack,
    RowTable,
    abandon_file,
    create_file,
    reason,
    storable,
)
from acquire.text import Message
from acquire.text.printable import counted
from analysis.evaluate import load_axis
from live.results import layout
from live.results.quantities import quantity_of
from live.results.response.stored import CORRELATION, CURRENT, GROUP, add_group
from live.results.row import STRAINS, StrainRow, gauge_columns

if TYPE_CHECKING:
    from analysis.field import Sums, ZoiGrid
    from live.results.row import ResultsInfo

VALUE_BITS, SIGMA_BITS = 9, 9
"""Binary digits kept: of a value below its standard uncertainty; of an uncertainty."""
FLUSH_S = 0.25  # a row of a live test waits for its flush no longer than this
_WORDS = {
    "u": "displacement along x (right)",
    "v": "displacement along y (down)",
    "du_dx": "du/dx",
    "du_dy": "du/dy",
    "dv_dx": "dv/dx",
    "dv_dy": "dv/dy",
    "exx": "strain xx",
    "eyy": "strain yy",
    "exy": "strain xy (tensor component, gamma/2)",
    "residual": "residual chi^2 (about 1 when all is well)",
    "status": "status of the ZOI (0 = ok)",
    "iterations": "iterations",
    "blur": "blur since the reference, negative: sharper",
}
_MAPS = (*layout.MAPS, *layout.ADDED_MAPS)


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
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._path, self.failed, self._axis = path, False, info.axis
        self._flushed = 0  # rows
        self._timer = FlushTimer(flush_s, now)
        self._file = self._guard(lambda: create_file(path, lambda file: _declare(file, grid, info)))
        entry = self._file["entry"]
        self._maps = {n: PictureStack(entry["strain"][n]) for n in _MAPS}
        self._values = RowTable(entry["mean"], _value_names(info))
        references = entry[layout.REFERENCES]
        self._normal, self._first_row = PictureStack(references[layout.NORMAL]), references[layout.FIRST_ROW]
        of_response = (CURRENT, CORRELATION) if info.response else ()
        self._noise = [GrowingDataset(entry[GROUP][name]) for name in of_response]
        self._grid = grid
        self._pattern: Sums | None = None

    def write(self, row: StrainRow) -> None:
        """Append one row."""
        self._guard(lambda: self._append(row))
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
            self._guard(self._flush)
        return self._timer.left_s()

    def close(self) -> None:
        """Close the file; after a failed write, leave it as it is on the disk."""
        if self.failed:
            abandon_file(self._file)
        else:
            self._guard(self._flush)
            self._guard(self._write_default_slice)
            self._guard(self._write_axis)
            self._guard(self._file.close)

    def _append(self, row: StrainRow) -> None:
        values = self._values.row(row.values)
        if row.pattern is not None and row.pattern is not self._pattern:
            self._pattern = row.pattern
            self._append_normal(normal_matrices(row.pattern, self._grid))
            if row.noise is not None:
                self._noise[1].append(row.noise[1][None].astype(np.float32))
        for name, stored in rounded(row.maps).items():
            self._maps[name].append(stored)
        if row.noise is not None:
            self._noise[0].append(np.array([row.noise[0]], np.float32))
        self._values.hold(values)

    def _append_normal(self, normal: NDArray[np.float32]) -> None:
        self._normal.append(normal)
        self._first_row.resize((self._normal.length,))
        self._first_row[-1] = next(iter(self._maps.values())).length

    def _flush(self) -> None:
        self._timer.began()
        self._values.write()
        self._file.flush()
        self._timer.done()
        self._flushed = self._values.length

    def _write_default_slice(self) -> None:
        """Viewers begin with the last instant; with the first, where the file was never closed."""
        shown = _slice_of(max(self._values.length - 1, 0))
        self._file["entry/strain"].attrs.modify("default_slice", shown)

    def _write_axis(self) -> None:
        """The axis of the load, and the angle from it to the largest strain, found from all means."""
        mean = self._file["entry/mean"]
        exx, eyy, exy, s_xx, s_yy = (
            np.asarray(mean[name], np.float64) for name in (*STRAINS, "sigma_exx", "sigma_eyy")
        )
        load = load_axis(exx, eyy, exy, self._axis, np.fmax(s_xx, s_yy))
        mean.attrs.modify("load_axis", np.array(load.axis, "S1"))
        mean.attrs.modify("load_angle_deg", np.float64(math.degrees(load.angle.value)))

    def _guard(self, action: Callable[[], Any]) -> Any:
        try:
            return action()
        except (OSError, RuntimeError) as error:  # HDF5 reports a full disk as a RuntimeError
            self.failed = True
            raise self._trouble(error) from error

    def _trouble(self, error: Exception) -> DataError:
        kept = Message("; {rows} before can be read", counted(self._flushed, "row")) if self._flushed else ""
        return DataError(
            "{path}: cannot be written ({why}){kept}; make room on the disk or choose another --out",
            self._path,
            reason(error),
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


def _value_names(info: ResultsInfo) -> tuple[str, ...]:
    return layout.column_names(info.gauges, info.extras)


def _declare(file: Any, grid: ZoiGrid, info: ResultsInfo) -> None:
    """Everything but the rows."""
    file.attrs.update(
        NX_class="NXroot",
        default="entry",
        format=layout.FORMAT,
        format_version=layout.FORMAT_VERSION,
        creator="phasedic",
        start_time=info.start_utc,
    )
    entry = _group(file, "entry", "NXentry", default="strain")
    entry["start_time"] = info.start_utc
    entry["start_monotonic_s"] = info.start_monotonic
    entry["start_monotonic_s"].attrs["units"] = "s"
    entry["title"] = storable(str(info.metadata.get("specimen", "") or "phasedic"))
    _add_strain(entry, grid, info)
    _add_references(entry, grid.shape)
    if info.response:
        add_group(entry, info.response, grid.shape)
    _add_mean(entry, info)
    _add_gauges(entry, info)
    _add_notes(entry, info)


def _slice_of(row: int) -> Any:
    """The map that viewers show first (NeXus default_slice), of fixed length: it is changed in place."""
    return np.array([str(row), ".", "."], "S12")


def _group(parent: Any, name: str, nx_class: str, **attrs: Any) -> Any:
    group = parent.create_group(name)
    group.attrs.update(NX_class=nx_class, **attrs)
    return group


def _add_mean(entry: Any, info: ResultsInfo) -> None:
    mean = _group(entry, "mean", "NXdata", signal="eyy", axes=["time_s"], title="Strains of the region")
    mean.attrs["auxiliary_signals"] = ["exx", "exy"]
    mean.attrs["load_axis"] = np.array("x" if info.axis == "x" else "y", "S1")
    mean.attrs["load_angle_deg"] = np.float64(math.nan)
    for name in _value_names(info):
        kind = layout.column_declared(name).dtype
        dataset = mean.create_dataset(name, (0,), kind, maxshape=(None,), chunks=(256,), fletcher32=True)
        dataset.attrs["units"] = quantity_of(name).unit
        if name in STRAINS:
            dataset.attrs["uncertainties"] = f"sigma_{name}"
    for name in STRAINS:
        mean[f"{name}{layout.ERRORS}"] = mean[f"sigma_{name}"]
    entry["strain/time_s"] = mean["time_s"]
    for name in ("force_N", "frame", "last_frame", "n_frames", "noise_GL", "lost"):
        entry[f"strain/{name}"] = mean[name]


def _add_gauges(entry: Any, info: ResultsInfo) -> None:
    """The columns of the virtual gauges by their names, with the description of each."""
    if not info.gauges:
        return
    first = next(iter(info.gauges))
    group = _group(entry, "gauges", "NXdata", signal=first, axes=["time_s"], title="Virtual gauges")
    group["time_s"] = entry["mean/time_s"]
    for name, described in info.gauges.items():
        column, sigma, _ = gauge_columns(name)
        group[name], group[f"sigma_{name}"] = entry["mean"][column], entry["mean"][sigma]
        group[f"{name}{layout.ERRORS}"] = entry["mean"][sigma]
        entry["mean"][column].attrs.update(uncertainties=sigma, gauge=json.dumps(described))


def _add_strain(entry: Any, grid: ZoiGrid, info: ResultsInfo) -> None:
    strain = _group(entry, "strain", "NXdata", signal="eyy", axes=["time_s", "y", "x"])
    strain.attrs.update(
        strain_measure=info.strain_measure,
        grid=json.dumps(grid.to_dict()),
        frame_of_reference="fields lie on the reference picture; x right, y down, px",
        auxiliary_signals=["exx", "exy"],
        title=f"Strain maps, {info.strain_measure} strain",
        default_slice=_slice_of(0),
    )
    for name in _MAPS:
        _add_map(strain, name, grid.shape)
    for name in (*layout.PLAIN_MAPS, "blur"):
        strain[f"{name}{layout.ERRORS}"] = strain[f"sigma_{name}"]
    for name, values in (("x", grid.x), ("y", grid.y)):
        strain[name] = np.asarray(values, np.float64)
        strain[name].attrs.update(units="px", long_name=f"{name} of the centre of the ZOI (px)")
    strain["active"] = np.asarray(grid.active, np.uint8)
    strain["active"].attrs["units"] = ""
    for name, value in (("size", grid.size), ("step", grid.step)):
        strain[name] = int(value)
        strain[name].attrs["units"] = "px"


def _add_map(strain: Any, name: str, shape: tuple[int, int]) -> None:
    kind = layout.map_declared(name, shape).dtype
    dataset = strain.create_dataset(
        name, (0, *shape), kind, maxshape=(None, *shape), chunks=(1, *shape), fillvalue=_fill(kind),
        fletcher32=True, **COMPRESSED,
    )  # fmt: skip
    plain = name.removeprefix("sigma_")
    unit = quantity_of(plain).unit
    words = _WORDS[plain] if plain == name else f"standard uncertainty of {_WORDS[plain]}"
    dataset.attrs.update(units=unit, long_name=f"{words} ({unit})" if unit else words, interpretation="image")
    if name == "status":
        dataset.attrs["meaning"] = json.dumps(_status_words())


def _add_references(entry: Any, shape: tuple[int, int]) -> None:
    group = _group(entry, layout.REFERENCES, "NXcollection")
    normal = group.create_dataset(
        layout.NORMAL, (0, layout.N_PAIRS, *shape), "f4", maxshape=(None, layout.N_PAIRS, *shape),
        chunks=(1, layout.N_PAIRS, *shape), fletcher32=True, **COMPRESSED,
    )  # fmt: skip
    normal.attrs["long_name"] = "normal matrices of u, du/dx, du/dy, v, dv/dx, dv/dy: upper triangles"
    row = group.create_dataset(layout.FIRST_ROW, (0,), "i8", maxshape=(None,), chunks=(64,), fletcher32=True)
    row.attrs["long_name"] = "row of the maps from which on it holds"


def _fill(kind: str) -> float:
    return np.nan if kind == "f4" else 255


def _status_words() -> dict[str, str]:
    from analysis.field import Status

    return {str(int(status)): f"{status.name}: {status.text}" for status in Status}


def _add_notes(entry: Any, info: ResultsInfo) -> None:
    for name in ("config", "metadata", "versions"):
        entry[name] = json.dumps(getattr(info, name), default=str, indent=1)
        entry[name].attrs["format"] = "JSON"
    camera = _group(entry, "camera", "NXdetector")
    if info.camera is None:
        return
    camera["description"] = storable(info.camera.name)
    for key in ("address", "width", "height", "bits", "fps", "exposure_s", "pixel_format", "clock"):
        value = getattr(info.camera, key)
        if value is not None:
            camera.attrs[key] = storable(value) if isinstance(value, str) else value
    camera.attrs["controls"] = json.dumps(dict(info.camera.controls), default=str)
