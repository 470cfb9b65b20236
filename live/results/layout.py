"""The layout of ``strain.h5``: the writer makes it, the reader refuses any other."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain

from acquire.hdf5 import Declared
from live.config.figures import FIGURES, columns
from live.results.row import BLUR, GRADIENTS, STRAINS, gauge_columns
from live.results.strain_csv import COLUMNS

FORMAT, FORMAT_VERSION = "phasedic-strain", 1
PLAIN_MAPS = ("u", "v", *GRADIENTS, *STRAINS)
MAPS = (*PLAIN_MAPS, *(f"sigma_{name}" for name in PLAIN_MAPS), "residual", "status", "iterations")
ADDED_MAPS = BLUR  # that files of earlier versions do not have
BYTES = {"status", "iterations"}  # maps of whole numbers; the others are float32
WHOLE = {figure.name for figure in FIGURES if figure.column and figure.kind == "count"}
"""Columns of whole numbers; the others are float64."""
ANY_COLUMN = Declared("number", (None,))  # of a gauge, or added by another version
# The columns that every file of this version has, and those that it may have.
REQUIRED = {*COLUMNS[: COLUMNS.index("latency_s")]}
KNOWN = {*COLUMNS, *columns(["section", "lag"])}
ERRORS = "_errors"  # NeXus: the uncertainty of NAME is also called NAME_errors
# Of each reference, from the row of its first measurement on: upper triangles of the normal matrices of all ZOIs.
REFERENCES, NORMAL, FIRST_ROW, N_PAIRS = "references", "normal", "first_row", 21
MAX_SIDE_PX = 65_535

ROOT = {"format": Declared("text"), "format_version": Declared("int", (), 1), "start_time": Declared("text")}
STRAIN = {"strain_measure": Declared("text"), "grid": Declared("text")}
TEXTS = dict.fromkeys(("config", "metadata", "versions"), Declared("text"))


def map_declared(name: str, shape: tuple[int, int]) -> Declared:
    """The maps of one name, (T, R, C)."""
    return Declared("u1" if name in BYTES else "f4", (None, *shape))


def normal_declared(shape: tuple[int, int]) -> dict[str, Declared]:
    """The normal matrices of the references, which files of earlier versions do not have."""
    return {NORMAL: Declared("f4", (None, N_PAIRS, *shape)), FIRST_ROW: Declared("i8", (None,), 0)}


def column_declared(name: str) -> Declared:
    """A column of ``mean``, (T,)."""
    kind = "i8" if name in WHOLE else "f8"
    return Declared(kind, (None,))


def column_names(gauges: Iterable[str] = (), extras: Iterable[str] = ()) -> tuple[str, ...]:
    """The columns in the order in which they are written: time_s is last, so a row with a time is complete."""
    names = tuple(name for name in COLUMNS if name != "time_s")
    return (*names, *extras, *chain.from_iterable(map(gauge_columns, gauges)), "time_s")
