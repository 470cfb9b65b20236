"""The evaluation of a finished run: its curve with the tensile figures, the lag of the load, the instants to show.

Report, comparison and batch have the still phase at its start from here, with the noise floor measured in it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquire.text import Message, joined
from analysis.evaluate import (
    MIN_STILL_INSTANTS,
    NoiseFloor,
    TensileFigures,
    evaluate_test,
    evenly,
    neck,
    noise_floor,
    still_phase,
)
from live.results.figures import tensile_options
from live.results.reader import Strain
from live.results.run_folder import RunFolder

MAX_INSTANTS = 64
"""Still instants that are read; more do not improve the noise floor."""

_MEANS = ("exx", "eyy", "exy")
_DISPLACEMENTS = ("u", "v")

Array = NDArray[np.float64]
_BROKEN = 0.02  # of the highest force: below it there is no specimen any more


@dataclass(frozen=True, slots=True)
class StillPhase:
    """The beginning of a test, before anything moves.

    Attributes
    ----------
    time_steps : int
    floors : mapping of str to NoiseFloor
        Of u, v (px), exx, eyy and exy; empty with too few instants; a map with too few ZOIs is left out.
    """

    time_steps: int
    floors: dict[str, NoiseFloor]


def still_phase_of(strain: Strain, names: Sequence[str] = (*_DISPLACEMENTS, *_MEANS)) -> StillPhase:
    """The still phase of ``strain``, with the noise floors of the maps ``names``; raises DataError as ``maps``."""
    means = {name: (_column(strain, name), _column(strain, f"sigma_{name}")) for name in _MEANS}
    count = still_phase(strain.force_one_zero, means)
    if count < MIN_STILL_INSTANTS:
        return StillPhase(count, {})
    rows = evenly(count, MAX_INSTANTS).tolist()
    floors = {name: noise_floor(_maps(strain, name, rows), planes=name in _DISPLACEMENTS) for name in names}
    return StillPhase(count, {name: floor for name, floor in floors.items() if floor is not None})


def _column(strain: Strain, name: str) -> NDArray[np.float64]:
    return np.asarray(strain.values[name], np.float64)


def _maps(
    strain: Strain, name: str, rows: list[int]
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    for row in rows:
        values, sigma = (np.asarray(strain.maps(map_, row), np.float64) for map_ in (name, f"sigma_{name}"))
        yield values, sigma


@dataclass(frozen=True, slots=True, eq=False)
class EvaluatedCurve:
    """The curve of a test and its figures.

    Attributes
    ----------
    axial, transverse : (T,) float64
        Extension of the test, and the strain across: of the gauges of these names, else of the region.
    load : (T,) float64
        Stress, Pa, or force, N, where the section is not known; NaN where no force is known.
    is_stress : bool
    figures : TensileFigures
        In the unit of ``load``.
    intercept : float
        Of the elastic line, in the unit of ``load``; NaN where there is none.
    """

    axial: Array
    transverse: Array
    load: Array
    is_stress: bool
    figures: TensileFigures
    intercept: float

    @classmethod
    def of(cls, run: RunFolder) -> EvaluatedCurve:
        """The curve of ``run``."""
        measured, is_stress = run.curve, run.specimen.area_m2 is not None
        figures = evaluate_test(measured, tensile_options(run.specimen))
        axial, load = measured.strain, measured.stress
        return cls(axial, run.transverse_strain, load, is_stress, figures, intercept_of(axial, load, figures))

    @property
    def has_load(self) -> bool:
        """Whether any force is known."""
        return bool(np.isfinite(self.load).any())

    @property
    def elastic(self) -> NDArray[np.bool_]:
        """Instants of the elastic part, (T,)."""
        return _elastic(self.axial, self.load, self.figures)


def _elastic(axial: Array, load: Array, figures: TensileFigures) -> NDArray[np.bool_]:
    span = figures.span
    if span is None or not np.isfinite(load).any():
        return np.zeros(len(load), np.bool_)
    before = np.arange(len(load)) <= int(np.nanargmax(load))
    strain = axial - figures.zero.strain
    return np.asarray(before & (strain >= span.strain[0]) & (strain <= span.strain[1]), np.bool_)


def intercept_of(axial: Array, load: Array, figures: TensileFigures) -> float:
    """The load of the elastic line at no strain, in the unit of ``load``; NaN where there is no line."""
    part = _elastic(axial, load, figures) & np.isfinite(load)
    return float(np.mean(load[part]) - figures.E.value * np.mean(axial[part])) if part.any() else math.nan


def time_steps(run: RunFolder, curve: EvaluatedCurve) -> dict[int, str]:
    """Row -> name: first, elastic, yield, highest force, last; each row once, in order of time."""
    found = {0: [Message("first")]}

    def add(row: int, words: Message) -> None:
        found.setdefault(row, []).append(words)

    elastic = np.flatnonzero(curve.elastic)
    if len(elastic):
        add(int(elastic[len(elastic) // 2]), Message("elastic"))
    if curve.figures.Rp02.known:
        add(_yield_row(curve), Message("yield ({offset:g} %)", 0.2))
    if curve.has_load:
        add(int(np.nanargmax(curve.load)), Message("highest force"))
    elif np.isfinite(curve.axial).any():
        add(int(np.nanargmax(np.abs(curve.axial))), Message("largest strain"))
    add(run.strain.n - 1, Message("last"))
    return {row: joined(", ", words) for row, words in sorted(found.items())}


def _yield_row(curve: EvaluatedCurve) -> int:
    plastic = curve.axial - (curve.load - curve.intercept) / curve.figures.E.value
    beyond = np.flatnonzero((plastic >= 0.002) & (curve.load >= 0.98 * curve.figures.Rp02.value))
    return int(beyond[0]) if len(beyond) else int(np.nanargmax(curve.load))


def neck_line(run: RunFolder, curve: EvaluatedCurve) -> str:
    """Where the specimen necked, from the maps at the highest force and at the last instant before the break."""
    known = np.flatnonzero(np.isfinite(curve.load) & (np.asarray(run.strain.values["n_valid"]) > 0))
    if not len(known) or not curve.figures.Ag.known:
        return ""
    top = int(known[np.argmax(curve.load[known])])
    last = int(known[curve.load[known] > _BROKEN * curve.load[top]][-1])
    found = neck(run.field(top), run.field(last), run.load_axis.axis) if last > top else None
    if found is None:
        return ""
    scale, (begin, end) = run.mm_per_px, (run.strain.time_s[row] for row in (top, last))
    mm = Message(" ({x:.1f}, {y:.1f} mm)", found.x * scale, found.y * scale) if scale else ""
    return Message(
        "neck at x, y = {x:.0f}, {y:.0f} px{mm}: from {begin:.4g} s (highest force) to {end:.4g} s the strain grew "
        "there by {growth:.2g} %, elsewhere by {elsewhere:.2g} %",
        found.x, found.y, mm, begin, end, 100 * found.growth, 100 * found.elsewhere,
    )  # fmt: skip


def nearest_rows(run: RunFolder, times: Sequence[float]) -> dict[int, str]:
    """Row -> "chosen" of the instants nearest to ``times``, s."""
    t = run.strain.time_s
    return {int(np.argmin(np.abs(t - time))): Message("chosen") for time in sorted(times)}
