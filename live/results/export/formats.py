"""The formats of an export, and the export itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from acquire.errors import ConfigError
from live.pipeline.consumer import Screen
from live.results.export.job import USUAL, ExportJob, ExportOptions, chosen_fields
from live.results.export.maps import write_gif, write_mp4, write_png, write_tiff, write_vtk
from live.results.export.tables import write_csv, write_mat, write_npz, write_r3xa
from live.results.quantities import Display
from live.results.run_folder import RunFolder

FOLDER = "export"  # in the folder of the run


@dataclass(frozen=True, slots=True)
class ExportFormat:
    """One way to write a run.

    Attributes
    ----------
    write : callable
        Takes the job and the path.
    name : str
        Of the file or folder by default; {map} is the name of the one map.
    one_map : bool
        Takes a single map, by default the strain along the load.
    """

    write: Callable[[ExportJob, Path], None]
    name: str
    one_map: bool = False


FORMATS = {
    "csv": ExportFormat(write_csv, "strain.csv"),
    "npz": ExportFormat(write_npz, "strain.npz"),
    "mat": ExportFormat(write_mat, "strain.mat"),
    "vtk": ExportFormat(write_vtk, "vtk"),
    "tiff": ExportFormat(write_tiff, "{map}.tif", one_map=True),
    "png": ExportFormat(write_png, "{map}_png", one_map=True),
    "mp4": ExportFormat(write_mp4, "{map}.mp4", one_map=True),
    "gif": ExportFormat(write_gif, "{map}.gif", one_map=True),
    "r3xa": ExportFormat(write_r3xa, "r3xa"),
}


@dataclass(frozen=True, slots=True)
class ExportRequest:
    """What to export.

    Attributes
    ----------
    format : str
        A key of ``FORMATS``.
    out : Path or None
        File or folder; None: in ``export`` in the run's folder.
    fields : str or None
        Names of maps between commas, "all", "response" (of the whole test), or None for the usual ones.
    start_s, end_s : float or None, s
        Range of time since the start of the test.
    display : Display
    options : ExportOptions
    """

    format: str
    out: Path | None = None
    fields: str | None = None
    start_s: float | None = None
    end_s: float | None = None
    display: Display = field(default_factory=Display)
    options: ExportOptions = field(default_factory=ExportOptions)


def export(run: RunFolder, request: ExportRequest, screen: Screen) -> Path:
    """Export ``run``; returns the new file or folder.

    Raises
    ------
    ConfigError
        No such map, no instant in the range, a file that exists, a library that is missing.
    DataError
        The run's files cannot be read, or the new ones not be written.
    """
    kind = FORMATS[request.format]
    usual = (run.axial,) if kind.one_map else USUAL
    fields = chosen_fields(run.strain, request.fields, usual)
    if kind.one_map and len(fields) != 1:
        raise ConfigError("--to {format} takes one map at a time; give one with --fields", request.format)
    if not fields:
        raise ConfigError("{path}: holds none of the usual maps; name some with --fields", run.strain.path)
    rows = run.strain.rows_between(request.start_s, request.end_s, "--from, --until")
    if {*fields} <= {*run.strain.whole_names}:
        rows = rows[-1:]  # they are the same at each instant
    job = ExportJob(run, fields, rows, request.display, screen, request.options)
    path = request.out or run.path / FOLDER / _name(kind, request, fields[0])
    if request.format == "mp4" and not path.suffix:
        path = path.with_name(f"{path.name}.mp4")  # the encoder takes the format from the name
    kind.write(job, path)
    return path


def _name(kind: ExportFormat, request: ExportRequest, first: str) -> str:
    if request.format == "csv" and request.options.layout != "long":
        return {"means": "means.csv", "wide": "wide"}[request.options.layout]
    return kind.name.format(map=first)
