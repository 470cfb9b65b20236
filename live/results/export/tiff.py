"""``tiff``: one map at all instants as a stack of 32-bit floats, with the units that ImageJ reads.

tifffile writes the TIFF of ImageJ: units and notes in its description, and time and force as the label of each slice
in private tags. For other readers the pages are plain; a ZOI without a value is NaN.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError
from live.config.new_files import new_file
from live.results.export.job import ExportJob

_MAX_BYTES = 2**32 - 2**20


def write_tiff(job: ExportJob, path: Path) -> None:
    """The stack of ``job.fields[0]``.

    Raises
    ------
    ConfigError
        tifffile is not installed, or more than the 4 GB that ImageJ's format can address.
    """
    try:
        import tifffile
    except ImportError:
        raise ConfigError("--to tiff needs tifffile: pip install 'phasedic[export]'") from None
    (name,) = job.fields
    height, width = job.strain.grid.shape
    n = len(job.rows)
    if n * (4 * height * width + 256) > _MAX_BYTES:
        raise ConfigError(
            "--to tiff: {n} maps of {width} x {height} are more than 4 GB; give --from and --until",
            n,
            width,
            height,
        )
    per_unit = 1 / job.display.step(job.strain.grid)  # pixels of the map, which are ZOIs
    with new_file(path) as part, part.open("xb") as file:
        tifffile.imwrite(
            file,
            _maps(job, name),
            shape=(n, height, width),
            dtype=np.float32,
            imagej=True,
            resolution=(per_unit, per_unit),
            metadata=_metadata(job, name),
        )


def _maps(job: ExportJob, name: str) -> Iterator[NDArray[np.float32]]:
    for _, row in job.steps():
        yield np.asarray(job.map(name, row), np.float32)


def _metadata(job: ExportJob, name: str) -> dict[str, Any]:
    """The keys that ImageJ reads, then the notes."""
    unit = job.display.unit("x").replace("px", "pixel")
    times = job.strain.time_s[list(job.rows)]
    interval = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    step = job.display.step(job.strain.grid)
    notes = [*job.notes(), job.display.definition(name)]
    return {
        "axes": "TYX", "unit": unit, "finterval": f"{interval:.9g}", "loop": False,
        "xorigin": f"{-job.display.x(job.strain.grid)[0] / step:.9g}",
        "yorigin": f"{-job.display.y(job.strain.grid)[0] / step:.9g}",
        "vunit": job.display.unit(name) or "1", "Labels": _labels(job),
        **{f"note{k}": _plain(note) for k, note in enumerate(notes)},
    }  # fmt: skip


def _plain(text: str) -> str:
    """One line of ASCII, which the description of a TIFF must be."""
    return " ".join(text.split()).encode("ascii", "replace").decode()


def _labels(job: ExportJob) -> list[str]:
    forces = job.strain.values["force_N"]
    return [
        f"{job.strain.time_s[row]:.4f} s" + (f", {forces[row]:.2f} N" if np.isfinite(forces[row]) else "")
        for row in job.rows
    ]
