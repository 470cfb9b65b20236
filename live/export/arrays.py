"""Arrays for other programs: ``npz`` (numpy), ``mat`` (MATLAB, Octave), and xarray in memory."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from live.export.job import Job
from live.export.target import new_file
from live.finished import Display
from live.results import Strain, dataset, mean_name, quantity_of


def write_npz(job: Job, path: Path) -> None:
    """Maps (T, R, C) and the numbers of each instant (T,), ``x`` (C,), ``y`` (R,); ``about`` is JSON text."""
    with new_file(path) as part, zipfile.ZipFile(part, "x", zipfile.ZIP_DEFLATED) as archive:
        for name, values in _small(job).items():
            _put(archive, name, values)
        _put(archive, "about", np.array(json.dumps(_about(job), ensure_ascii=False)))
        for name in job.fields:
            _put(archive, name, _stack(job, name))


def write_mat(job: Job, path: Path) -> None:
    """MATLAB 5: maps are (R, C, T), ``mean`` holds the numbers of each instant (T, 1), ``about`` the words."""
    from scipy.io import savemat
    from scipy.io.matlab import MatWriteError

    small, about = _small(job), _about(job)
    about["notes"] = np.array(about["notes"], object)  # a cell array
    places = {name: small.pop(name) for name in ("x", "y", "active")}
    with new_file(path) as part, part.open("xb") as file:
        try:
            savemat(file, {**places, "mean": {k: v[:, None] for k, v in small.items()}, "about": about})  # type: ignore[arg-type]
            for name in job.fields:
                stack = {name: np.moveaxis(_stack(job, name), 0, -1)}
                savemat(file, stack, do_compression=True)  # type: ignore[arg-type]
        except MatWriteError as error:
            raise DataError(
                f"{path}: too large for this format ({error}); give --from and --until, or --to npz"
            ) from error


def to_xarray(strain: Strain, display: Display | None = None, fields: tuple[str, ...] | None = None) -> Any:
    """The maps and means as an ``xarray.Dataset`` with coordinates ``time``, ``y``, ``x`` and units.

    Parameters
    ----------
    strain : Strain
    display : Display, optional
        Units and axes; without, as they are stored (px, y down).
    fields : tuple of str, optional
        Maps; all without.

    Raises
    ------
    ConfigError
        xarray is not installed.
    """
    return dataset(strain, display or Display(), fields)


def _small(job: Job) -> dict[str, NDArray[Any]]:
    """Everything but the maps."""
    grid = job.strain.grid
    places = {"x": job.display.x(grid), "y": job.display.y(grid), "active": grid.active}
    return {**places, **{mean_name(name): job.column(name) for name in job.strain.values}}


def _about(job: Job) -> dict[str, Any]:
    names = {mean_name(name): name for name in job.strain.values}
    units = {name: job.display.unit(name) or "1" for name in ("x", "y", *job.fields)}
    units |= {shown: job.display.unit(name) or "1" for shown, name in names.items()}
    words = {name: quantity_of(name).words for name in ("x", "y", *job.fields)}
    words |= {shown: quantity_of(name).words for shown, name in names.items()}
    return {"notes": job.notes(), "units": units, "definitions": words}


def _stack(job: Job, name: str) -> NDArray[Any]:
    """(T, R, C) of the chosen instants."""
    return np.stack([job.map(name, row) for _, row in job.steps()])


def _put(archive: zipfile.ZipFile, name: str, values: NDArray[Any]) -> None:
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        np.lib.format.write_array(member, np.asanyarray(values), allow_pickle=False)
