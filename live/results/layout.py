"""Where everything stands in ``strain.h5``: the writer makes it so, the reader takes nothing else."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain

from acquire.hdf5 import Declared
from live.results.row import GRADIENTS, STRAINS, gauge_columns
from live.results.strain_csv import COLUMNS

PLAIN_MAPS = ("u", "v", *GRADIENTS, *STRAINS)
MAPS = (*PLAIN_MAPS, *(f"sigma_{name}" for name in PLAIN_MAPS), "residual", "status", "iterations")
BYTES = {"status", "iterations"}  # maps of whole numbers; the others are float32
WHOLE = {"frame", "last_frame", "n_frames", "lost", "n_valid", "n_zoi"}  # columns; the others are float64
ANY_COLUMN = Declared("number", (None,))  # one of a gauge, or that another version has added
NEEDED = {
    *(
        "frame",
        "time_s",
        "force_N",
        "exx",
        "eyy",
        "exy",
        "sigma_exx",
        "sigma_eyy",
        "sigma_exy",
        "n_valid",
        "n_zoi",
    ),
    *("noise_GL", "n_frames", "last_frame", "lost", "duration_s", "u_px", "v_px"),
}  # columns that every file of this version has
KNOWN = {
    *COLUMNS,
    "stress_Pa",
    "true_strain",
    "true_stress_Pa",
    "force_raw_N",
}  # columns whose type is declared where they are there
ERRORS = "_errors"  # NeXus' second name of the uncertainty of what stands before it
MOST_PIXELS = 65_535

ROOT = {"format": Declared("text"), "format_version": Declared("int", (), 1), "start_time": Declared("text")}
STRAIN = {"strain_measure": Declared("text"), "grid": Declared("text")}
TEXTS = dict.fromkeys(("config", "metadata", "versions"), Declared("text"))


def map_declared(name: str, shape: tuple[int, int]) -> Declared:
    """The maps of one name, (T, R, C)."""
    return Declared("u1" if name in BYTES else "f4", (None, *shape))


def column_declared(name: str) -> Declared:
    """A column of ``mean``, (T,)."""
    kind = "i8" if name in WHOLE else "f8"
    return Declared(kind, (None,))


def column_names(gauges: Iterable[str] = (), extras: Iterable[str] = ()) -> tuple[str, ...]:
    """The columns in the order in which they are written: a reader that sees the time sees the whole row."""
    names = tuple(name for name in COLUMNS if name != "time_s")
    return (*names, *extras, *chain.from_iterable(map(gauge_columns, gauges)), "time_s")
