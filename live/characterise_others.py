"""Other people's DIC programs, where they are installed: pyvale and SUN-DIC, on pictures in memory.

Both are called as their own examples call them, with a subset of 33 px every 8 px; they write files,
which go to a temporary folder. Neither is a dependency: ``installed`` says which are there.
"""

from __future__ import annotations

import contextlib
import io
import tempfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Program = Callable[[Any, Any], Floats]
SUBSET, STEP, RIM = 33, 8, 32
"""px; the pictures are measured but for a rim."""


def pyvale(reference: Any, deformed: Any) -> Floats:
    """Map of u, px, NaN where not found: pyvale, affine, B-spline, its own defaults (filter included)."""
    mask = np.zeros(reference.shape, bool)
    mask[RIM:-RIM, RIM:-RIM] = True
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        from pyvale import dic  # it opens a log file where it is imported

        dic.calculate_2d(
            reference, deformed[None], mask,
            seed=[reference.shape[1] // 2, reference.shape[0] // 2],
            subset_size=SUBSET, subset_step=STEP, max_displacement=8,
            output_basepath=folder, print_level=0,
        )  # fmt: skip
        found = dic.import_2d(
            data=Path(folder) / "dic_results_*", delimiter=",", layout="matrix", print_level=0
        )
    return _inner(np.squeeze(np.asarray(found.u_px, float)))


def sun_dic(reference: Any, deformed: Any) -> Floats:
    """Map of u, px, NaN where not found: SUN-DIC, affine, its defaults with splines of order 5, one process."""
    import cv2
    import sundic.post_process as results
    import sundic.settings as options
    import sundic.sundic as program

    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        images = Path(folder) / "images"
        images.mkdir()
        for name, picture in (("0.tif", reference), ("1.tif", deformed)):
            cv2.imwrite(str(images / name), picture)
        settings = options.Settings()
        settings.ImageFolder = str(images)
        settings.SubsetSize = settings.SubSetSize = SUBSET
        settings.StepSize, settings.InterpolationOrder = STEP, 5
        height, width = reference.shape
        settings.ROI = [RIM, RIM, width - 2 * RIM, height - 2 * RIM]
        program.planarDICLocal(settings, str(Path(folder) / "results.sdic"))
        values, rows, columns = results.getDisplacements(str(Path(folder) / "results.sdic"), 0)
    return _inner(values[:, 3].reshape(rows, columns, order="F"))


def _inner(u: Floats) -> Floats:
    """Without empty rows and columns around."""
    rows, columns = np.isfinite(u).any(axis=1), np.isfinite(u).any(axis=0)
    return u[np.ix_(rows, columns)]


PROGRAMS: dict[str, tuple[str, Program]] = {
    "pyvale, 33 px": ("pyvale", pyvale),
    "SUN-DIC, 33 px": ("sundic", sun_dic),
}


def installed() -> dict[str, Program]:
    """The programs that can be imported."""
    return {name: program for name, (module, program) in PROGRAMS.items() if find_spec(module) is not None}
