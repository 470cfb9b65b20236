"""Two runs of one test, of the front and of the back of the specimen, put together on the clock of the machine."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import datetime
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from analysis.evaluate import Course, Curve, TensileFigures, TwoSides, evaluate_test
from live.pipeline.measurement import AXIAL, TRANSVERSE
from live.results.figures import tensile_options
from live.results.run_folder import RunFolder

LONGEST_GAP = 5.0  # times the usual distance of the instants of the back
CLOCKS_AGREE_S = 2.0  # the clock of the day may have been set in between


@dataclass(frozen=True, slots=True, eq=False)
class SidesOfTest:
    """Front and back of a test.

    Attributes
    ----------
    courses : mapping of str to TwoSides
        Strain along and across the load, and each gauge that both have, at the instants of the front.
    force : (N,) float64, N
    front, back, both : TensileFigures
        By the strain of one side, and by the mean of both; all with the force of the front.
    """

    courses: dict[str, TwoSides]
    force: NDArray[np.float64]
    front: TensileFigures
    back: TensileFigures
    both: TensileFigures

    @classmethod
    def of(cls, front: RunFolder, back: RunFolder) -> SidesOfTest:
        """Both runs put together.

        Raises
        ------
        DataError
            They have no clock or no time in common.
        """
        shift = shift_s(front, back)
        gap = LONGEST_GAP * float(np.median(np.diff(back.strain.time_s))) if back.strain.n > 1 else 0.0
        others = dict(_courses(back, shift))
        courses = {
            name: TwoSides.of(one, others[name], gap) for name, one in _courses(front) if name in others
        }
        if not np.isfinite(courses[AXIAL].mean).any():
            raise DataError(
                f"{front.path} and {back.path} have no instant in common; they are not of one test"
            )
        options = tensile_options(front.specimen)
        curves = front.curve, _curve_of_back(front, back, shift, gap)
        figures = (evaluate_test(curve, options) for curve in (*curves, _mean_of(*curves)))
        return cls(courses, front.force, *figures)


def shift_s(front: RunFolder, back: RunFolder) -> float:
    """What to add to times of the back for times of the front, s.

    Raises
    ------
    DataError
        A recording is missing, or they are of different machines: the two clocks of each disagree.
    """
    for run in (front, back):
        if run.session is None:
            raise DataError(f"{run.path}: no recording, whose clock is needed; give the folders of two runs")
    by_machine = back.start_monotonic - front.start_monotonic
    begun = (datetime.fromisoformat(run.strain.start_utc) for run in (back, front))
    by_day = (next(begun) - next(begun)).total_seconds()
    if abs(by_machine - by_day) > CLOCKS_AGREE_S:
        raise DataError(
            f"{front.path} and {back.path}: their clocks are {abs(by_machine - by_day):.0f} s apart; record both on one"
            " machine, without a restart in between"
        )
    return by_machine


def _courses(run: RunFolder, shift: float = 0.0) -> Iterator[tuple[str, Course]]:
    t = np.asarray(run.strain.time_s, np.float64) + shift
    region = {AXIAL: run.axial, TRANSVERSE: run.transverse}
    for name, column in region.items():
        value, sigma = (np.asarray(run.strain.values[one], np.float64) for one in (column, f"sigma_{column}"))
        yield name, Course(t, value, sigma)
    for name, track in run.gauges.items():
        yield name, Course(t, track.value, track.sigma)


def _curve_of_back(front: RunFolder, back: RunFolder, shift: float, gap: float) -> Curve:
    """The strains of the back over the stress of the front, at its instants."""
    stress, curve = front.curve.stress, back.curve
    t = np.asarray(front.strain.time_s, np.float64)

    def moved(values: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
        return None if values is None else Course(curve.t + shift, values, values).at(t, gap).value

    strain = moved(curve.strain)
    assert strain is not None
    return replace(
        curve, t=t, strain=strain, stress=stress, transverse=moved(curve.transverse),
        elastic=moved(curve.elastic), uneven=moved(curve.uneven), misfit=moved(curve.misfit),
    )  # fmt: skip


def _mean_of(front: Curve, back: Curve) -> Curve:
    """The mean of two curves; what only one of them has is left out."""

    def mean(
        one: NDArray[np.float64] | None, other: NDArray[np.float64] | None
    ) -> NDArray[np.float64] | None:
        return None if one is None or other is None else (one + other) / 2

    strain = (front.strain + back.strain) / 2
    transverse, elastic = mean(front.transverse, back.transverse), mean(front.elastic, back.elastic)
    return Curve(
        front.t, strain, front.stress, transverse, elastic,
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
