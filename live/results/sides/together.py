"""Front and back of the specimen put together: mean and bending of each strain, and the figures of the mean.

The two sides come from two finished runs of one test, or from a test that still runs.
"""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TextIO

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from acquire.text import Message
from acquire.text.message import joined
from analysis.evaluate import (
    CONFIDENCE,
    Course,
    Curve,
    TensileFigures,
    TensileOptions,
    TwoSides,
    evaluate_test,
)
from live.config.cameras import BACK, FRONT, SIDES
from live.config.sections import SpecimenConfig
from live.pipeline.measurement import AXIAL, TRANSVERSE, strains_along
from live.pipeline.run_state import RunState
from live.pipeline.snapshot import BURST
from live.results.figures import beyond_scatter, headline, tensile_options
from live.results.run_folder import RunFolder
from live.results.sides.folder import shift_s

LONGEST_GAP = 5.0  # times the usual distance of the instants of the back
_RECENT = 12  # time steps of each side that the newest instant of both is found in


@dataclass(frozen=True, slots=True, eq=False)
class SideOfTest:
    """One side.

    Attributes
    ----------
    courses : mapping of str to Course
        Strain along and across the load, and each gauge.
    curve : Curve
        Both on one clock for front and back.
    force : (N,) float64, N
    """

    courses: dict[str, Course]
    curve: Curve
    force: NDArray[np.float64]

    @classmethod
    def of_folder(cls, run: RunFolder, shift_s: float = 0.0) -> SideOfTest:
        """Of a finished run, ``shift_s`` later."""
        t = np.asarray(run.strain.time_s, np.float64) + shift_s

        def course(column: str) -> Course:
            value, sigma = (
                np.asarray(run.strain.values[one], np.float64) for one in (column, f"sigma_{column}")
            )
            return Course(t, value, sigma)

        region = {AXIAL: course(run.axial), TRANSVERSE: course(run.transverse)}
        gauges = {name: Course(t, track.value, track.sigma) for name, track in run.gauges.items()}
        return cls(region | gauges, replace(run.curve, t=t), run.force)

    @classmethod
    def of_state(cls, state: RunState, specimen: SpecimenConfig) -> SideOfTest:
        """Of a test so far; its time is that of the machine."""
        history, force = state.history, state.history.forces(state.loads)
        t, steps = history.column("t"), history.time_steps
        names = dict(zip((AXIAL, TRANSVERSE), strains_along((), history.current_axis), strict=True))
        courses = {
            name: Course(t, history.column(column), history.column(f"sigma_{column}"))
            for name, column in names.items()
        }
        for name in steps.gauges:
            value, sigma = steps.gauge(name), steps.gauge_sigma(name)
            if value is not None and sigma is not None:
                courses[name] = Course(t, value[: len(t)], sigma[: len(t)])
        curve = history.curve(specimen.load(force), history.current_axis)
        return cls(courses, curve, force)


@dataclass(frozen=True, slots=True, eq=False)
class SidesOfTest:
    """Front and back of a test.

    Attributes
    ----------
    courses : mapping of str to TwoSides
        Strain along and across the load, and each gauge that both have, at the instants of the front.
    force : (N,) float64, N
    curve : Curve
        Of the mean strain.
    figures : mapping of str to TensileFigures
        By the mean ("both"), by the strain of the front and by that of the back; all with the force of the front.
    """

    courses: dict[str, TwoSides]
    force: NDArray[np.float64]
    curve: Curve
    figures: dict[str, TensileFigures]

    @classmethod
    def of(cls, front: SideOfTest, back: SideOfTest, options: TensileOptions) -> SidesOfTest:
        """Both sides put together; NaN where they have no instant in common."""
        gap = longest_gap(back.curve.t)
        moved = _at_the_front(front.curve, back.curve, gap)
        mean = _mean_of(front.curve, moved)
        curves = {"both": mean, FRONT: front.curve, BACK: moved}
        figures = {name: evaluate_test(curve, options) for name, curve in curves.items()}
        return cls(two_sides(front.courses, back.courses, gap), front.force, mean, figures)

    @classmethod
    def of_folders(cls, front: RunFolder, back: RunFolder) -> SidesOfTest:
        """Two finished runs.

        Raises
        ------
        DataError
            They have no clock or no time in common.
        """
        sides = SideOfTest.of_folder(front), SideOfTest.of_folder(back, shift_s(front, back))
        found = cls.of(*sides, tensile_options(front.specimen))
        if not np.isfinite(found.courses[AXIAL].mean).any():
            raise DataError(
                "{front} and {back} have no instant in common; they are not of one test",
                front.path,
                back.path,
            )
        return found

    def figure_lines(self, *, stresses: bool) -> Iterator[str]:
        """E, nu and strengths by the mean, by the front and by the back; ``stresses``: the section is known."""
        for where, figures in self.figures.items():
            rows = (row for row in headline(figures, stresses=stresses) if row.figure.known)
            known = joined("  ", [Message("{name} = {text}", row.name, row.text) for row in rows])
            yield Message("{where:<7}{known}", f"{where}:", known or Message("no figure is known"))
        if held := beyond_scatter(self.figures["both"]):
            yield Message("±: {CONFIDENCE:.0%} interval, of E with {held}", CONFIDENCE, held)


def longest_gap(t: NDArray[np.float64]) -> float:
    """The longest time between instants ``t`` (N,) that is no gap, s."""
    return LONGEST_GAP * float(np.median(np.diff(t))) if len(t) > 1 else 0.0


def two_sides(front: dict[str, Course], back: dict[str, Course], max_gap_s: float) -> dict[str, TwoSides]:
    """Mean and bending of every strain that both have."""
    return {name: TwoSides.of(one, back[name], max_gap_s) for name, one in front.items() if name in back}


class JointStrain(NamedTuple):
    """A strain of both sides at one instant: mean, bending, the sigma of either, and the time, s."""

    mean: float
    bending: float
    sigma: float
    t: float


def newest(states: Mapping[str, RunState], now: float | None = None) -> dict[str, JointStrain]:
    """The axial strain and each gauge at the newest instant that both sides have.

    None without sides, once a camera has failed, and where the bursts of a side are not live at ``now`` (s, monotonic;
    None: this moment).
    """
    if FRONT not in states or any(state.health.camera_failed for state in states.values()):
        return {}
    now = time.monotonic() if now is None else now
    if not all(state.snapshot(now).figure(BURST).known for state in states.values()):
        return {}
    one, other = (_recent(states[side]) for side in SIDES)
    if not one or not other:
        return {}
    return at_end(two_sides(one, other, longest_gap(other[AXIAL].t)))


def at_end(courses: Mapping[str, TwoSides]) -> dict[str, JointStrain]:
    """The last instant of each strain that both sides have."""
    found = {}
    for name, both in courses.items():
        known = np.flatnonzero(np.isfinite(both.mean))
        if len(known):
            k = known[-1]
            values = both.mean[k], both.bending[k], both.sigma[k], both.t[k]
            found[name] = JointStrain(*map(float, values))
    return found


def _recent(state: RunState) -> dict[str, Course]:
    """The axial strain and the gauges of the last time steps."""
    steps, axis = state.history.time_steps[-_RECENT:], state.history.current_axis
    if not steps:
        return {}
    t = np.array([step.t for step in steps])
    pairs = {AXIAL: [step.axial(axis) for step in steps]}
    for name in steps[-1].gauges:
        values = [step.gauges.get(name) for step in steps]
        pairs[name] = [(math.nan, math.nan) if one is None else (one.value, one.sigma) for one in values]
    return {name: Course(t, *np.array(values, np.float64).T) for name, values in pairs.items()}


def _at_the_front(front: Curve, back: Curve, gap: float) -> Curve:
    """The strains of the back over the stress of the front, at its instants."""

    names = "strain", "transverse", "elastic", "uneven", "misfit", "narrowing", "lens", "blur"
    known = {name: values for name in names if (values := getattr(back, name)) is not None}
    moved: dict[str, Any] = {
        name: Course(back.t, values, values).at(front.t, gap).value for name, values in known.items()
    }
    return replace(back, t=front.t, stress=front.stress, **moved)


def _mean_of(front: Curve, back: Curve) -> Curve:
    """The mean of two curves; what only one of them has is left out."""

    def of(name: str) -> list[NDArray[np.float64]]:
        return [values for one in (front, back) if (values := getattr(one, name)) is not None]

    pairs = {name: of(name) for name in ("strain", "transverse", "elastic", "narrowing")}
    mean = {name: (pair[0] + pair[1]) / 2 for name, pair in pairs.items() if len(pair) == 2}
    lens, blurs = of("lens"), of("blur")
    # Errors of the two cameras by their blur are not alike: as variances of independent errors.
    blur = np.sqrt(np.hypot.reduce([one**2 for one in blurs]) / 2) if len(blurs) == 2 else None
    return Curve(
        front.t, stress=front.stress, lens=np.hypot.reduce(lens) / 2 if lens else None, blur=blur, **mean,
        source=f"mean of both sides: {front.source}", elastic_source=front.elastic_source,
    )  # fmt: skip


def write_sides(sides: SidesOfTest, file: TextIO) -> None:
    """A CSV: time and force, then mean, bending and sigma of each strain; empty where it is not known."""
    writer = csv.writer(file)
    parts = [f"{part}_{name}" for name in sides.courses for part in ("mean", "bending", "sigma")]
    writer.writerow(["time_s", "force_N", *parts])
    columns = [values for one in sides.courses.values() for values in (one.mean, one.bending, one.sigma)]
    for row in zip(sides.courses[AXIAL].t, sides.force, *columns, strict=True):
        writer.writerow("" if math.isnan(value) else f"{value:.9g}" for value in row)
