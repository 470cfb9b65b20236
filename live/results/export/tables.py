"""Maps and means as tables (``csv``), as arrays (``npz``, and ``mat`` of MATLAB and Octave), and a folder (``r3xa``).

A table has one line a ZOI and instant, or one line an instant. Its first lines begin with ``#`` and define the
columns (``pandas.read_csv(..., comment="#")``, ``numpy.genfromtxt`` and MATLAB's ``readtable(...,
CommentStyle="#")`` skip them); then come the names with their units, and the numbers.

R3XA (photomechanics) is JSON with the settings, data sources and data sets of an experiment, of version 2026.9.24 of
its schema, and the files that it names. What was not recorded is left out. Its tables have no comments, since R3XA
counts rows.
"""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from live.config.new_files import new_file, new_folder
from live.results.export.job import ExportJob
from live.results.quantities import mean_name, quantity_of
from live.results.run_folder import RunFolder

FIRST = ("time_s", "force_N", "stress_Pa", "exx", "eyy", "exy", "sigma_exx", "sigma_eyy", "sigma_exy")
_OF_AN_INSTANT = ("time_s", "force_N")
_POSITION = ("row", "column", "x", "y")
_AVERAGED = ("u_px", "v_px", "exx", "eyy", "exy")

VERSION = "2026.9.24"
_FIELDS = "fields"
Json = dict[str, Any]


def write_csv(job: ExportJob, path: Path) -> None:
    """A table in the layout of ``job.options``; the wide one is a folder with a file a map."""
    if job.options.layout == "wide":
        with new_folder(path) as folder:
            _wide(job, folder)
        return
    with new_file(path) as part, part.open("x", encoding="utf-8", newline="\n") as file:
        if job.options.layout == "means":
            means(job, file)
        else:
            heads = ["instant", *_OF_AN_INSTANT, *_POSITION, *job.fields]
            _comment(file, [*job.notes(), *(job.display.definition(name) for name in heads)])
            _line(file, [job.display.column(name) for name in heads])
            places = _positions(job)
            for _, number in job.steps():
                same = [np.full(len(places[0]), value) for value in (number, *_time_step(job, number))]
                _rows(file, [*same, *places, *_values(job, number)])


def means(job: ExportJob, file: TextIO, notes: bool = True) -> None:
    """One line an instant: the means over the valid ZOIs, and the other columns of the results."""
    values = job.strain.values
    names = [name for name in FIRST if name in values]
    names += [name for name in values if name not in names]
    if notes:
        _comment(file, [*job.notes(), *(_mean_words(job, name) for name in names)])
    _line(file, [job.display.column(name) for name in names])
    _rows(file, [job.column(name) for name in names])


def _mean_words(job: ExportJob, name: str) -> str:
    if name in _AVERAGED:
        return job.display.definition(name) + ", mean over the valid ZOIs"
    if "gauge_" in name:
        return job.display.definition(name) + _gauge_words(job, name)
    if name.startswith("sigma_"):
        return f"{job.display.definition(name)}, of that mean, with the overlap of ZOIs"
    return job.display.definition(name)


def _gauge_words(job: ExportJob, name: str) -> str:
    gauge = job.run.gauges.get(name.removeprefix("gauge_"))
    described = gauge.described if gauge is not None else {}
    keys = (f"{key} {value}" for key, value in described.items())
    return f" ({', '.join(keys)}; positions in px, y down)" if described else ""


def field_table(job: ExportJob, number: int, file: TextIO) -> None:
    """One instant, a line a ZOI, no notes."""
    _line(file, [job.display.column(name) for name in (*_POSITION, *job.fields)])
    _rows(file, [*_positions(job), *_values(job, number)])


def load_table(run: RunFolder, file: TextIO) -> None:
    """All readings of the load cell, seconds since the start of the test."""
    _line(file, ["time_s", "force_N"])
    for piece in run.readings.pieces():
        _rows(file, [piece.t, piece.values])


def _positions(job: ExportJob) -> list[NDArray[Any]]:
    """Row, column, x and y of each active ZOI, (N,) each."""
    grid = job.strain.grid
    rows, columns = np.nonzero(grid.active)
    return [rows, columns, job.display.x(grid)[columns], job.display.y(grid)[rows]]


def _values(job: ExportJob, number: int) -> list[NDArray[Any]]:
    return [job.map(name, number)[job.strain.grid.active] for name in job.fields]


def _wide(job: ExportJob, folder: Path) -> None:
    grid, display = job.strain.grid, job.display
    _, _, x, y = _positions(job)
    unit = display.unit("x")
    heads = [*_OF_AN_INSTANT, *(f"x{a:.6g}_y{b:.6g}" for a, b in zip(x, y, strict=True))]
    for name in job.fields:
        with (folder / f"{display.column(name)}.csv").open("x", encoding="utf-8", newline="\n") as file:
            _comment(
                file,
                [*job.notes(), display.definition(name), f"one column a ZOI, named by its centre in {unit}"],
            )
            _line(file, heads)
            for _, number in job.steps():
                _rows(
                    file,
                    [[value] for value in (*_time_step(job, number), *job.map(name, number)[grid.active])],
                )


def _time_step(job: ExportJob, number: int) -> list[float]:
    return [float(job.strain.values[name][number]) for name in _OF_AN_INSTANT]


def _comment(file: TextIO, lines: Iterable[str]) -> None:
    file.writelines(f"# {' '.join(line.split())}\n" for line in lines)


def _line(file: TextIO, words: Sequence[str]) -> None:
    file.write(",".join(words) + "\n")


def _rows(file: TextIO, columns: Sequence[NDArray[Any] | Sequence[Any]]) -> None:
    """Columns of equal length as lines, with the digits of single precision."""
    arrays = [np.asarray(column) for column in columns]
    form = ",".join(_form(array) for array in arrays) + "\n"
    file.writelines(form % values for values in zip(*(array.tolist() for array in arrays), strict=True))


def _form(array: NDArray[Any]) -> str:
    if array.dtype.kind in "iub":
        return "%d"
    return "%.9g" if array.dtype == np.float32 else "%.10g"


def write_npz(job: ExportJob, path: Path) -> None:
    """Maps (T, R, C), columns (T,), ``x`` (C,), ``y`` (R,); ``about`` is JSON text."""
    with new_file(path) as part, zipfile.ZipFile(part, "x", zipfile.ZIP_DEFLATED) as archive:
        for name, values in _columns_and_axes(job).items():
            _put(archive, name, values)
        _put(archive, "about", np.array(json.dumps(_about(job), ensure_ascii=False)))
        for name in job.fields:
            _put(archive, name, _stack(job, name))


def write_mat(job: ExportJob, path: Path) -> None:
    """MATLAB 5: maps are (R, C, T), ``mean`` holds the columns (T, 1), ``about`` the definitions."""
    from scipy.io import savemat
    from scipy.io.matlab import MatWriteError

    columns, about = _columns_and_axes(job), _about(job)
    about["notes"] = np.array(about["notes"], object)  # a cell array
    places = {name: columns.pop(name) for name in ("x", "y", "active")}
    with new_file(path) as part, part.open("xb") as file:
        try:
            savemat(file, {**places, "mean": {k: v[:, None] for k, v in columns.items()}, "about": about})  # type: ignore[arg-type]
            for name in job.fields:
                stack = {name: np.moveaxis(_stack(job, name), 0, -1)}
                savemat(file, stack, do_compression=True)  # type: ignore[arg-type]
        except MatWriteError as error:
            raise DataError(
                "{path}: too large for this format ({why}); give --from and --until, or --to npz", path, error
            ) from error


def _columns_and_axes(job: ExportJob) -> dict[str, NDArray[Any]]:
    """Everything but the maps."""
    grid = job.strain.grid
    places = {"x": job.display.x(grid), "y": job.display.y(grid), "active": grid.active}
    return {**places, **{mean_name(name): job.column(name) for name in job.strain.values}}


def _about(job: ExportJob) -> dict[str, Any]:
    names = {mean_name(name): name for name in job.strain.values}
    units = {name: job.display.unit(name) or "1" for name in ("x", "y", *job.fields)}
    units |= {shown: job.display.unit(name) or "1" for shown, name in names.items()}
    words = {name: str(quantity_of(name).words) for name in ("x", "y", *job.fields)}
    words |= {shown: str(quantity_of(name).words) for shown, name in names.items()}
    return {"notes": job.notes(), "units": units, "definitions": words}


def _stack(job: ExportJob, name: str) -> NDArray[Any]:
    """(T, R, C) of the chosen instants."""
    return np.stack([job.map(name, row) for _, row in job.steps()])


def _put(archive: zipfile.ZipFile, name: str, values: NDArray[Any]) -> None:
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        np.lib.format.write_array(member, np.asanyarray(values), allow_pickle=False)


def write_r3xa(job: ExportJob, path: Path) -> None:
    """``r3xa.json``, ``means.csv``, ``load.csv`` and a table an instant in ``fields``."""
    with new_folder(path) as folder:
        with (folder / "means.csv").open("x", encoding="utf-8", newline="\n") as file:
            means(job, file, notes=False)
        loaded = job.run.readings.count > 0
        if loaded:
            with (folder / "load.csv").open("x", encoding="utf-8", newline="\n") as file:
                load_table(job.run, file)
        (folder / _FIELDS).mkdir()
        for k, row in job.steps():
            with (folder / _FIELDS / _table(k)).open("x", encoding="utf-8", newline="\n") as file:
                field_table(job, row, file)
        text = json.dumps(describe(job, path, loaded), indent=1, ensure_ascii=False)
        (folder / "r3xa.json").write_text(text + "\n", encoding="utf-8")


def describe(job: ExportJob, path: Path, loaded: bool) -> Json:
    """The metadata, paths relative to the folder ``path``."""
    run = job.run
    about = run.strain.metadata
    return {
        "title": run.title,
        "description": str(about.get("note") or "Displacement and strain fields measured by phasedic"),
        "version": VERSION,
        "authors": [{"name": str(about.get("operator") or "not recorded")}],
        "date": run.strain.start_utc[:10],
        "settings": [_specimen(run)],
        "data_sources": [
            _camera(run),
            *([_load_cell(run)] if loaded else []),
            _displacements(job),
            _strains(job),
        ],
        "data_sets": [
            *_recordings(run, path),
            *([_load_set()] if loaded else []),
            _mean_set(job),
            _field_set(job),
        ],
    }


def _unit(unit: str, value: float | None = None, title: str = "") -> Json:
    found: Json = {"kind": "unit", "unit": unit}
    return found | ({"value": value} if value is not None else {}) | ({"title": title} if title else {})


def _source(kind: str, name: str, title: str, dimension: str, units: list[Json]) -> Json:
    return {
        "id": f"src-{name}",
        "kind": f"data_sources/{kind}",
        "title": title,
        "output_components": len(units),
        "output_dimension": dimension,
        "output_units": units,
    }


def _specimen(run: RunFolder) -> Json:
    s = run.specimen
    sizes = [
        _unit("mm", value, title)
        for title, value in (("width", s.width_mm), ("thickness", s.thickness_mm))
        if value is not None
    ]
    return {"id": "stg-specimen", "kind": "settings/specimen", "title": run.title} | (
        {"sizes": sizes} if sizes else {}
    )


def _camera(run: RunFolder) -> Json:
    pictures = run.pictures
    found = _source("camera", "camera", run.camera_address or "camera", "surface", [_unit("GL")])
    if pictures is None:
        return found
    info = pictures.info
    found |= {"title": info.name, "image_size": [_unit("px", info.width), _unit("px", info.height)]}
    if info.exposure_s is not None:
        found["exposure"] = _unit("s", info.exposure_s)
    return found


def _load_cell(run: RunFolder) -> Json:
    found = _source("load_cell", "load", "load cell", "point", [_unit("N")])
    cell = run.session.load_cell if run.session is not None else None
    if cell is not None:
        found["title"] = cell.name
        if cell.capacity_N is not None:
            found["capacity"] = _unit("N", cell.capacity_N)
    return found


def _displacements(job: ExportJob) -> Json:
    unit, grid = job.display.unit("u"), job.strain.grid
    return _source(
        "dic_measurement", "dic", "phase-DIC", "surface", [_unit(unit, title=n) for n in ("u", "v")]
    ) | {
        "manufacturer": "phasedic",
        "model": str(job.strain.versions.get("phasedic", "")),
        "input_data_sets": ["set-images"],
        "subset_size": [_unit("px", grid.size), _unit("px", grid.size)],
        "step_size": _unit("px", grid.step),
        "interpolant": "B-spline of degree 5",
        "shape_function": "quadratic" if job.run.section("measure").get("order") == 2 else "affine",
        "matching_criterion": "weighted least squares on the Wiener-filtered reference, gain and offset free",
    }


def _strains(job: ExportJob) -> Json:
    unit, grid = job.display.unit("exx") or "1", job.strain.grid
    units = [_unit(unit, title=name) for name in ("exx", "eyy", "exy")]
    return _source("strain_computation", "strain", "strain from the fit of each ZOI", "surface", units) | {
        "description": f"{job.strain.strain_measure} strain, from the gradients that are fitted in each ZOI",
        "input_data_sets": ["set-images"],
        "virtual_strain_gauge_size": _unit("px", grid.size),
        "strain_filtering": "none",
    }


def _recordings(run: RunFolder, path: Path) -> list[Json]:
    """The HDF5 files, by their paths."""
    images = {
        "id": "set-images", "kind": "data_sets/generic", "title": "pictures and load as recorded",
        "data_type": "application/x-hdf5", "parent_data_sources": ["src-camera"],
    }  # fmt: skip
    session = run.session_path
    images["path"] = _relative(session, path) if session is not None else run.camera_address
    results = {
        "id": "set-results", "kind": "data_sets/generic", "title": "all maps with their uncertainty",
        "data_type": "application/x-hdf5", "parent_data_sources": ["src-dic", "src-strain"],
        "path": _relative(run.strain.path, path),
    }  # fmt: skip
    return [images, results]


def _relative(file: Path, folder: Path) -> str:
    return Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix()


def _column(name: str, column: str) -> Json:
    return {
        "kind": "data_set_file", "filename": name, "file_type": "text/csv", "delimiter": ",",
        "col": column, "rows": [0, None],
    }  # fmt: skip


def _load_set() -> Json:
    return {
        "id": "set-load", "kind": "data_sets/file", "title": "force", "path": ".", "data_type": "numbers",
        "parent_data_sources": ["src-load"], "time_reference": _unit("s", 0.0),
        "timestamps": _column("load.csv", "time_s"), "values": _column("load.csv", "force_N"),
    }  # fmt: skip


def _mean_set(job: ExportJob) -> Json:
    return {
        "id": "set-means", "kind": "data_sets/file", "title": "means over the valid ZOIs", "path": ".",
        "data_type": "numbers", "parent_data_sources": ["src-strain"], "time_reference": _unit("s", 0.0),
        "timestamps": _column("means.csv", "time_s"), "values": _column("means.csv", job.display.column(job.run.axial)),
    }  # fmt: skip


def _field_set(job: ExportJob) -> Json:
    return {
        "id": "set-fields", "kind": "data_sets/list", "title": "maps, a table an instant", "path": _FIELDS,
        "data_type": "text/csv", "parent_data_sources": ["src-dic", "src-strain"],
        "time_reference": _unit("s", 0.0),
        "timestamps": [float(job.strain.time_s[row]) for row in job.rows],
        "values": [_table(k) for k in range(len(job.rows))],
    }  # fmt: skip


def _table(k: int) -> str:
    return f"{k:05d}.csv"
