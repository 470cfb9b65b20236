"""Front and back of one specimen put together: mean and bending of each strain, and the figures of the mean.

The two sides come from two finished runs of one test, or from a test that still runs (``JointChannels``). The folder of
a test with several cameras holds one of each; the clocks of two runs are put on one.
"""

from __future__ import annotations

import csv
import itertools
import math
import time
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple, TextIO

import numpy as np
from numpy.typing import NDArray

from acquire.clock import Clock
from acquire.errors import DataError
from acquire.text import Message, joined, word
from analysis.evaluate import (
    CONFIDENCE,
    Course,
    Curve,
    TensileFigures,
    TensileOptions,
    TwoSides,
    evaluate_test,
)
from live.config.cameras import BACK, FIELDS, FRONT, SIDES
from live.config.sections import SpecimenConfig
from live.pipeline.measurement import AXIAL, TRANSVERSE, TimeStep, strains_along
from live.pipeline.run_state import RunState
from live.pipeline.snapshot import BURST
from live.pipeline.timed.figure import LACKING
from live.results.figures import beyond_scatter, headline, tensile_options
from live.results.run_folder import SESSION, STRAIN, RunFolder

LATE_S = 1.0
"""A side that is behind the other by more than this, and by more than a usual gap, gives no strains."""

CLOCKS_AGREE_S = 2.0  # the clock of the day may have been set in between

LONGEST_GAP = 5.0  # times the usual distance of the instants of the back
_RECENT = 12  # time steps of each side that the newest instant of both is found in


class JointChannels:
    """The channels of front and back together (``live.config.figures.JOINT_CHANNELS``); for any thread."""

    def __init__(self, clock: Clock = time.monotonic) -> None:
        self._clock = clock
        self._states: Mapping[str, RunState] = {}
        self._live = False
        self._last_t = -math.inf  # the newest instant of both so far

    def attach(self, states: Mapping[str, RunState], *, live: bool) -> None:
        """Both sides have begun; recorded pictures (not ``live``) may be read one side after the other."""
        self._states, self._live = states, live

    def read(self, start: float) -> dict[str, float]:
        """The channels at the newest instant of both; none where there is no such instant, or it is too old.

        ``start`` is time zero, s, monotonic.
        """
        if not self._states or self.lost:
            return {}
        strains = newest(self._states, self._clock())
        found = {"mean_time_s": strains[AXIAL].t - start} if AXIAL in strains else {}
        for name, one in strains.items():
            channel = name if name == AXIAL else f"gauge_{name}"
            found |= _channels(channel, one)
            if name in self._states[FRONT].history.time_steps.gauges:
                found |= _channels(f"gauge_{name}", one)
        return found

    @property
    def lost(self) -> str:
        """Why there is no mean of both any more; empty while there is, and before both have measured."""
        for side, state in self._states.items():
            if state.health.camera_failed:
                return Message("the camera of the {side} has failed", word(side))
            if state.snapshot(self._clock()).figure(BURST).state in LACKING:
                return Message("the {side} gives no strains", word(side))
        steps = {side: state.history.time_steps for side, state in self._states.items()}
        if not self._live or not all(steps.values()):
            return ""
        ends = {side: one[-1].t for side, one in steps.items()}
        late, ahead = sorted(ends, key=lambda side: ends[side])
        limit = max(LATE_S, *(longest_gap(np.array([s.t for s in one[-3:]])) for one in steps.values()))
        if _went_on(steps[ahead], ends[late]) > limit:
            return Message("the {late} gives no strains", word(late))
        joint = newest(self._states, self._clock())
        if AXIAL in joint:
            self._last_t = joint[AXIAL].t
        since = _went_on(steps[late], self._last_t)
        return Message("no strain of both for {since:.1f} s", since) if since > limit else ""


def _went_on(steps: Sequence[TimeStep], t: float) -> float:
    """How long ``steps`` go on after ``t``, s; a pause before their next is not counted."""
    first = bisect_right(steps, t, key=lambda step: step.t)
    return steps[-1].t - steps[first].t if first < len(steps) else 0.0


def _channels(name: str, one: JointStrain) -> dict[str, float]:
    return {f"mean_{name}": one.mean, f"bending_{name}": one.bending, f"sigma_mean_{name}": one.sigma}


def cameras_in(folder: Path) -> tuple[str, ...]:
    """The names of the cameras, where ``folder`` is that of a test with several; else none."""
    return () if (folder / STRAIN).exists() else _with(folder, STRAIN)


def recorded_cameras_in(folder: Path) -> tuple[str, ...]:
    """The names of the cameras, where ``folder`` has the recordings of several; else none."""
    return _with(folder, SESSION)


def _with(folder: Path, file: str) -> tuple[str, ...]:
    if all((folder / name / file).is_file() for name in SIDES):
        return SIDES
    found = tuple(itertools.takewhile(lambda name: (folder / name / file).is_file(), FIELDS))
    return found if len(found) > 1 else ()


def shift_s(front: RunFolder, back: RunFolder) -> float:
    """What to add to times of the back for times of the front, s; 0 where one run made both.

    Raises
    ------
    DataError
        A recording is missing, or they are of different machines: the two clocks of each disagree.
    """
    for run in (front, back):
        if run.session is None and front.strain.start_utc == back.strain.start_utc:
            return 0.0
        if run.session is None:
            raise DataError(
                "{path}: no recording, whose clock is needed; give the folders of two runs", run.path
            )
    by_machine = back.start_monotonic - front.start_monotonic
    begun = (datetime.fromisoformat(run.strain.start_utc) for run in (back, front))
    by_day = (next(begun) - next(begun)).total_seconds()
    if abs(by_machine - by_day) > CLOCKS_AGREE_S:
        raise DataError(
            "{front} and {back}: their clocks are {apart:.0f} s apart; record both on one machine, without a restart"
            " in between",
            front.path,
            back.path,
            abs(by_machine - by_day),
        )
    return by_machine


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
        """Side of a finished run, ``shift_s`` later."""
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
        """Side of a test so far; its time is that of the machine."""
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
            yield Message("{where:<8}{known}", word(f"{where}:"), known or Message("no figure is known"))
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
