"""``r3xa``: a folder with the test described by R3XA metadata and the files that it names.

R3XA (photomechanics) is JSON with the settings, data sources and data sets of an experiment; this is version
2026.9.24 of its schema. What was not recorded is left out. The tables are plain CSV without comments, since
R3XA counts rows.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from live.config.new_files import new_folder
from live.results.export.job import ExportJob
from live.results.export.tables import field_table, load_table, means
from live.results.run_folder import RunFolder

VERSION = "2026.9.24"
_FIELDS = "fields"
Json = dict[str, Any]


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
