"""Other DIC programs, where they are installed: pyvale and SUN-DIC, on pictures in memory.

Both run as in their own examples, with a subset of 33 px every 8 px; their files go to a temporary folder. Neither
is a dependency: ``installed`` has those that can be imported. ``pyvale`` and ``sun_dic`` return the map of u,
``pyvale_points`` and ``sun_dic_points`` the positions as well.
"""

from __future__ import annotations

import contextlib
import io
import os
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2

Floats = NDArray[np.float64]
Program = Callable[[Any, Any], Floats]
SUBSET, STEP, RIM = 33, 8, 32
"""px; the pictures are measured but for a rim."""
OF_WORKERS = {"NUMBA_NUM_THREADS": "1", "RAY_USAGE_STATS_ENABLED": "0"}
"""Of Ray's processes: one thread of Numba each, and no usage reports."""


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Centres of a program's subsets in the reference and u there, (R, C) px; NaN where it found nothing."""

    x: Floats
    y: Floats
    u: Floats


def pyvale(reference: Any, deformed: Any) -> Floats:
    """Map of u, px, NaN where not found: pyvale, affine, B-spline, its own defaults (filter included)."""
    return _inner(pyvale_points(reference, deformed).u)


def pyvale_points(reference: Any, deformed: Any, cores: int | None = None) -> Points:
    """pyvale, affine, B-spline, its own defaults (filter included), with so many threads, or as many as it takes."""
    mask = np.zeros(reference.shape, bool)
    mask[RIM:-RIM, RIM:-RIM] = True
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        from pyvale import dic  # opens a log file in the current folder when imported

        dic.calculate_2d(
            reference, deformed[None], mask,
            seed=[reference.shape[1] // 2, reference.shape[0] // 2],
            subset_size=SUBSET, subset_step=STEP, max_displacement=8, num_threads=cores,
            output_basepath=folder, print_level=0,
        )  # fmt: skip
        found = dic.import_2d(
            data=Path(folder) / "dic_results_*", delimiter=",", layout="matrix", print_level=0
        )
    x, y, u = (np.squeeze(np.asarray(a, float)) for a in (found.ss_x, found.ss_y, found.u_px))
    return Points(x, y, u)


def sun_dic(reference: Any, deformed: Any) -> Floats:
    """Map of u, px, NaN where not found: SUN-DIC, affine, its defaults with splines of order 5, one process."""
    return _inner(sun_dic_points(reference, deformed).u)


def sun_dic_points(reference: Any, deformed: Any, rim: int = RIM, cores: int = 1) -> Points:
    """SUN-DIC, affine, its defaults with splines of order 5; no centre of a subset lies in the outer ``rim`` px.

    With more ``cores`` than one it starts Ray, which takes some seconds and leaves its log in the folder of temporary
    files, and each process is limited to one thread; by default each starts one a core.
    """
    cv2 = load_cv2()
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
        settings.CPUCount = cores
        height, width = reference.shape
        settings.ROI = [rim, rim, width - 2 * rim, height - 2 * rim]
        with patch.dict(os.environ, OF_WORKERS) if cores > 1 else _one_thread():
            program.planarDICLocal(settings, str(Path(folder) / "results.sdic"))
        values, rows, columns = results.getDisplacements(str(Path(folder) / "results.sdic"), 0)
    x, y, u = (values[:, c].reshape(rows, columns, order="F") for c in (0, 1, 3))
    return Points(x, y, u)


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    """Loops of Numba on one thread: its parallel loops over one subset at a time cost more than they save."""
    import numba

    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        yield
    finally:
        numba.set_num_threads(before)


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
