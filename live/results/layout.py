"""A row of the results (maps and means of one measurement), what the files hold besides, the layout of ``strain.h5``.

The layout is data: the writer makes the file of it, the reader refuses any other, the documents list it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from acquire.hdf5 import COMPRESSED, Declared
from analysis.evaluate import AreaStrain
from analysis.field import PAIR_INDEX, Status, Sums, blur_maps
from live.config.figures import FIGURES, attributes, columns
from live.pipeline.measurement import AXIAL, extension_along, strains_along
from live.results.quantities import quantity_of

if TYPE_CHECKING:
    from acquire.frame import CameraInfo
    from analysis.field import StrainField
    from live.pipeline.measurement import Measurement

StrainMeasure = Literal["small", "engineering", "green", "hencky"]
STRAINS = ("exx", "eyy", "exy")
BLUR = ("blur", "sigma_blur")
LENS = columns(["lens"])
"""Columns of a test whose lens is corrected: the strain that was removed, and its standard uncertainty."""
_OF_STEP, _OF_BURST = attributes("step"), attributes("burst")
GRADIENTS = ("du_dx", "du_dy", "dv_dx", "dv_dy")

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


@dataclass(frozen=True, slots=True, eq=False)
class ResultsInfo:
    """What the files of a test hold besides the rows.

    Attributes
    ----------
    start_monotonic : float, s
        Zero of ``time_s``.
    start_utc : str
        The same instant, ISO 8601.
    config, metadata, versions : mapping to JSON values
        The configuration in force, free text of the user, versions of the programs.
    camera : CameraInfo or None
    strain_measure : "small" | "engineering" | "green" | "hencky"
    area_m2 : float or None, m^2
        Cross-section of the specimen; with it the rows have a stress.
    gauges : mapping of name to JSON values
        The virtual gauges, each as it was described.
    axis : "x", "y" or "auto"
        Of the load; auto: found from the means, y until then.
    plates : bool
        Plates correct the strains; rows have the strains as measured and the motion of the plates too.
    lens : bool
        A lens is corrected; rows have the strain that it made too.
    lagged : bool
        The force is corrected for a lag of the load; rows have the force as stamped too.
    response : str
        What the response of each place will be over; empty: none.
    """

    start_monotonic: float
    start_utc: str
    config: Mapping[str, Any]
    metadata: Mapping[str, Any]
    versions: Mapping[str, Any]
    camera: CameraInfo | None
    strain_measure: StrainMeasure = "small"
    area_m2: float | None = None
    gauges: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    axis: str = "y"
    lagged: bool = False
    plates: bool = False
    lens: bool = False
    response: str = ""

    @property
    def extras(self) -> tuple[str, ...]:
        """The columns that only some tests have, without those of gauges."""
        has = {
            "section": self.area_m2 is not None,
            "lag": self.lagged,
            "lens": self.lens,
            "plates": self.plates,
        }
        return columns(name for name, there in has.items() if there)


@dataclass(frozen=True, slots=True, eq=False)
class StrainRow:
    """What is written of one measurement.

    Attributes
    ----------
    maps : mapping of name to (R, C) array
        u, v (px), gradients and strains (dimensionless), sigma_* of each, residual, status,
        iterations; blur and its sigma (px).
    values : mapping of name to number
        One a row, in the order of the columns of ``strain.csv``.
    pattern : Sums or None
        Of the reference, by which areas weigh their ZOIs.
    noise : (float, (R, C) array) or None
        Share of the variance of strains that is not of the reference, and correlation of the noises of exx and eyy;
        where a response is wanted.
    """

    maps: dict[str, NDArray[Any]]
    values: dict[str, float | int]
    pattern: Sums | None = None
    noise: tuple[float, NDArray[np.float64]] | None = None

    @classmethod
    def of(cls, measurement: Measurement, info: ResultsInfo, axis: str = "y") -> StrainRow:
        """The row of ``measurement``, strains in the measure of ``info``; ``axis`` is that of the load."""
        maps = maps_of(measurement.field, info.strain_measure)
        noise = _noise(measurement.field) if info.response else None
        return cls(maps, _values(measurement, maps, info, axis), measurement.field.sums, noise)


def gauge_columns(name: str) -> tuple[str, str, str]:
    """The names that value, standard uncertainty and share of the area of a virtual gauge have in files."""
    return f"gauge_{name}", f"sigma_gauge_{name}", f"share_gauge_{name}"


def maps_of(field: StrainField, measure: StrainMeasure) -> dict[str, NDArray[Any]]:
    """The (R, C) arrays of a field by the names they have in files; strains in ``measure``."""
    plain, strain = ("u", "v", *GRADIENTS), field.strain(measure)
    maps = {name: getattr(field, name) for name in plain}
    maps |= {name: getattr(strain, name) for name in STRAINS}
    maps |= {f"sigma_{name}": getattr(field, f"sigma_{name}") for name in (*plain, *STRAINS)}
    maps |= {name: getattr(field, name) for name in ("residual", "status", "iterations")}
    maps |= dict(zip(BLUR, blur_maps(field), strict=True))
    return maps


def _noise(field: StrainField) -> tuple[float, NDArray[np.float64]]:
    """As ``StrainRow.noise``, the share of a typical ZOI; the correlation is 0 where it is not known."""
    x, y = field.sigma("exx"), field.sigma("eyy")
    known = field.ok & (x > 0) & (y > 0)
    both = np.zeros(known.shape)
    np.divide(field.covariance[PAIR_INDEX[1, 5]], x * y, out=both, where=known)  # of du_dx and dv_dy
    return field.own_share("eyy"), both


def _values(
    measurement: Measurement, maps: dict[str, NDArray[Any]], info: ResultsInfo, axis: str
) -> dict[str, float | int]:
    burst, time_step = measurement.burst, measurement.time_step
    values: dict[str, float | int] = {name: getattr(time_step, of) for name, of in _OF_STEP.items()}
    values |= {name: getattr(burst, of) for name, of in _OF_BURST.items()}
    values |= {"time_s": burst.t - info.start_monotonic, "kernel_s": time_step.measure_s or math.nan}
    values |= _strains(measurement, info.strain_measure)
    for name, gauge in time_step.gauges.items():
        values |= dict(zip(gauge_columns(name), (gauge.value, gauge.sigma, gauge.share), strict=True))
    if info.area_m2 is not None:
        values["stress_Pa"] = stress = time_step.force / info.area_m2
        stretch = _stretch(measurement, info.strain_measure, axis)
        values |= {"true_strain": math.log(stretch), "true_stress_Pa": stress * stretch}
    if info.lens:
        values |= dict(zip(LENS, measurement.lens or [math.nan] * len(LENS), strict=True))
    if info.plates:
        values |= _plates(measurement)
    return values


def _plates(measurement: Measurement) -> dict[str, float]:
    read, names = measurement.plates, columns(["plates"])
    if read is None:
        return dict.fromkeys(names, math.nan)
    values = [*(read.raw_strain(name) for name in STRAINS), float(read.corrected)]
    values += [*read.motion.parameters.tolist(), read.sigma_scale]
    return dict(zip(names, values, strict=True))


def _strains(measurement: Measurement, measure: StrainMeasure) -> dict[str, float]:
    """Strains of the region, in ``measure``: those of the time step, where its field has that measure."""
    if measurement.field.measure == measure:
        return {name: getattr(measurement.time_step, name) for name in STRAINS}
    area = AreaStrain.of(replace(measurement.field, measure=measure))
    return {name: math.nan if area is None else area.value(name) for name in STRAINS}


def _stretch(measurement: Measurement, measure: StrainMeasure, axis: str) -> float:
    """Length over first length along the load: of the gauge ``axial``, between strips, or of the region."""
    time_step = measurement.time_step
    name, extension = strains_along(time_step.gauges, axis)[0], extension_along(time_step.gauges, axis)
    strain = time_step.gauges[AXIAL].value if name == AXIAL else getattr(time_step, extension)
    stretch = 1 + strain if math.isfinite(strain) else _stretched(getattr(time_step, name), measure)
    return stretch if stretch > 0 else math.nan


def _stretched(strain: float, measure: StrainMeasure) -> float:
    if measure == "hencky":
        return math.exp(strain)
    return math.sqrt(max(1 + 2 * strain, 0.0)) if measure == "green" else 1 + strain


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
