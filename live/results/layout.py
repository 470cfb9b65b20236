"""The layout of ``strain.h5``, as data: the writer makes it, the reader refuses any other, the documents list it."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from itertools import chain
from typing import Any

import numpy as np

from acquire.hdf5 import COMPRESSED, Declared
from analysis.field import Status
from live.config.figures import FIGURES, columns
from live.results.quantities import quantity_of
from live.results.row import BLUR, GRADIENTS, STRAINS, gauge_columns

FORMAT, FORMAT_VERSION = "phasedic-strain", 1
PLAIN_MAPS = ("u", "v", *GRADIENTS, *STRAINS)
MAPS = (*PLAIN_MAPS, *(f"sigma_{name}" for name in PLAIN_MAPS), "residual", "status", "iterations")
BYTES = {"status", "iterations"}  # maps of whole numbers; the others are float32
WHOLE = {figure.name for figure in FIGURES if figure.column and figure.kind == "count"}
"""Columns of whole numbers; the others are float64."""
ANY_COLUMN = Declared("number", (None,))  # of a gauge, or added by another version
COLUMNS = columns()
"""Of all valid ZOIs; strains are dimensionless. Then come those of ``ResultsInfo.extras``, and value,
sigma and share of each virtual gauge."""
# The columns that every file of this version has, and those that it may have.
REQUIRED = {*COLUMNS[: COLUMNS.index("latency_s")]}
KNOWN = {*COLUMNS, *columns(["section", "lag"])}
ERRORS = "_errors"  # NeXus: the uncertainty of NAME is also called NAME_errors
# Of each reference, from the row of its first measurement on: upper triangles of the normal matrices of all ZOIs.
REFERENCES, NORMAL, FIRST_ROW, N_PAIRS = "references", "normal", "first_row", 21
MAX_SIDE_PX = 65_535

ROOT = {"format": Declared("text"), "format_version": Declared("int", (), 1), "start_time": Declared("text")}
STRAIN = {"strain_measure": Declared("text"), "grid": Declared("text")}
"""Attributes of the root and of ``strain``."""
TEXTS = dict.fromkeys(("config", "metadata", "versions"), Declared("text", more={"format": "JSON"}))
ENTRY = {
    "start_time": Declared("text"), "start_monotonic_s": Declared("f8", unit="s"), "title": Declared("text"), **TEXTS,
}  # fmt: skip
GRID = {
    "x": Declared("f8", (None,), unit="px", long_name="x of the centre of the ZOI (px)"),
    "y": Declared("f8", (None,), unit="px", long_name="y of the centre of the ZOI (px)"),
    "active": Declared("u1", (None, None), 0, 1, ""),  # 0 where the mask leaves the ZOI out
    "size": Declared("int", unit="px"),
    "step": Declared("int", unit="px"),
}


def maps(shape: tuple[int, int]) -> dict[str, Declared]:
    """The maps, (T, R, C) each; files of earlier versions have no ``BLUR``."""
    return {name: _map(name, shape) for name in (*MAPS, *BLUR)}


def _map(name: str, shape: tuple[int, int]) -> Declared:
    about, whole = quantity_of(name), name in BYTES
    label = f"{about.label} ({about.unit})" if about.unit else about.label
    more = {"interpretation": "image"}
    if name == "status":
        more["meaning"] = json.dumps({str(int(one)): f"{one.name}: {one.text}" for one in Status})
    return Declared(
        "u1" if whole else "f4", (None, *shape), unit=about.unit, long_name=label, words=about.words,
        missing=255 if whole else np.nan, later=name in BLUR, rows=1, packed=COMPRESSED, more=more,
    )  # fmt: skip


def references(shape: tuple[int, int]) -> dict[str, Declared]:
    """The normal matrices of the references, which files of earlier versions do not have."""
    of_matrices = "normal matrices of u, du/dx, du/dy, v, dv/dx, dv/dy: upper triangles"
    of_rows = "row of the maps from which on it holds"
    size = (None, N_PAIRS, *shape)
    return {
        NORMAL: Declared("f4", size, long_name=of_matrices, rows=1, packed=COMPRESSED),
        FIRST_ROW: Declared("i8", (None,), 0, long_name=of_rows, rows=64),
    }


def column(name: str, more: Mapping[str, Any] | None = None) -> Declared:
    """A column of ``mean``, (T,)."""
    about, kind = quantity_of(name), "i8" if name in WHOLE else "f8"
    more = {"uncertainties": f"sigma_{name}"} if name in STRAINS else more or {}
    return Declared(kind, (None,), unit=about.unit, words=about.words, rows=256, more=more)


def mean(gauges: Mapping[str, Any], extras: Iterable[str] = ()) -> dict[str, Declared]:
    """The columns in the order in which they are written: time_s is last, so a row with a time is complete."""
    names = [name for name in (*COLUMNS, *extras) if name != "time_s"]
    more: dict[str, dict[str, Any]] = {}
    for name, described in gauges.items():
        value, sigma, _ = gauge_columns(name)
        more[value] = {"uncertainties": sigma, "gauge": json.dumps(described)}
    return {
        name: column(name, more.get(name)) for name in (*names, *chain(*map(gauge_columns, gauges)), "time_s")
    }
