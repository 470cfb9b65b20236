"""A finished test with its figures: what summary, page, report and figures.json say of it comes from here."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.events import Event, EventKind
from acquire.text import Message
from analysis.evaluate import (
    Curve,
    Figure,
    GaugeValue,
    LoadAxis,
    TensileFigures,
    Track,
    evaluate_test,
)
from analysis.evaluate.programme import Creep
from live.config.sections import SpecimenConfig
from live.pipeline.measurement import AXIAL, TimeStep, mean_width
from live.pipeline.run_state import RunState
from live.results.figures import lag_of, tensile_options
from live.results.finished.cycles import Cycles, creep_lines
from live.results.run_folder import RunFolder
from live.results.stored_fields import Readings

NO_VALUE = Message("no ZOI has a value in the last burst")
_NO_READINGS = Message("no readings of a load cell are there")
REGION = ("exx", "eyy", "exy")


@dataclass(frozen=True, slots=True, eq=False)
class FinishedTest:
    """A finished test.

    Attributes
    ----------
    curve : Curve
        Stress in Pa, or force in N where the section is not known.
    figures : TensileFigures
        In the same unit.
    specimen : SpecimenConfig
    axis : LoadAxis
    gauge : mapping of str to value
        The gauge ``axial`` as configured; empty where there is none.
    samples : Readings, s and N
        Readings of the load cell or of the file; the forces of the bursts where no reading is recorded.
    lag : Figure, s
        Of the load behind the frames, as found from the test; ``corrected_s`` is taken off already.
    corrected_s : float, s
    reference_N : float, N
        Force at the reference; NaN where it is not known.
    at_end : mapping of str to GaugeValue
        Strains of the region (``REGION``) and of the gauges (``gauge NAME``) in the last burst.
    cycles : Cycles
        None where the test is not cyclic.
    creep : Creep or None
        Where the force is held.
    response : tuple of str
        What was found of the response of the places, in words; empty where none was wanted.
    measure : str
        Of the strain.
    """

    curve: Curve
    figures: TensileFigures
    specimen: SpecimenConfig
    axis: LoadAxis
    samples: Readings
    lag: Figure
    corrected_s: float = 0.0
    reference_N: float = math.nan
    gauge: Mapping[str, Any] = field(default_factory=dict)
    at_end: Mapping[str, GaugeValue] = field(default_factory=dict)
    cycles: Cycles = field(default_factory=Cycles.none)
    creep: Creep | None = None
    response: tuple[str, ...] = ()
    measure: str = "engineering"

    @classmethod
    def of_run(
        cls,
        run_state: RunState,
        specimen: SpecimenConfig,
        gauges: Mapping[str, Mapping[str, Any]],
        reference_N: float,
        start_t: float = 0.0,
    ) -> FinishedTest:
        """A run or replay that has just ended.

        ``gauges`` as configured, ``reference_N`` the force at the reference, ``start_t`` (s) the zero of times.
        """
        history, loads = run_state.history, run_state.loads
        curve = history.curve(specimen.load(history.forces(loads)), specimen.axis)
        zero_of = float(curve.t[0]) if len(curve.t) else None
        one_zero = Readings.of_log(loads, zero_of=zero_of, late_s=loads.lag_s)
        strain, width = history.along(specimen.axis)[0], history.column("width_s")
        return cls(
            curve,
            evaluate_test(curve, tensile_options(specimen)),
            specimen,
            history.axis(specimen.axis),
            Readings.of_log(loads),
            lag_of(history, loads, specimen),
            loads.lag_s,
            reference_N,
            gauges.get(AXIAL, {}),
            strains_at_end(history.time_steps[-1]) if len(history.time_steps) else {},
            Cycles.of(curve, strain, width, one_zero, specimen.area_m2, start_t),
            Creep.of(replace(curve, t=curve.t - start_t), specimen.test),
        )

    @classmethod
    def of_folder(cls, run: RunFolder) -> FinishedTest:
        """A finished run, from its files."""
        t, corrected = run.strain.time_s, run.section("load").get("lag_s")
        samples, t = run.readings, np.asarray(t, np.float64)
        recorded = samples.count > 0
        lag_s = float(corrected) if isinstance(corrected, int | float) else 0.0
        width = mean_width(run.strain.values["duration_s"], run.strain.values["n_frames"])
        one_zero = _one_zero(samples, run, lag_s) if recorded else Readings.of(t, run.force_one_zero)
        return cls(
            run.curve,
            evaluate_test(run.curve, tensile_options(run.specimen)),
            run.specimen,
            run.load_axis,
            samples if recorded else Readings.of(t, run.force),
            samples.lag_behind(Track(t, run.axial_strain)) if recorded else Figure.none(_NO_READINGS),
            lag_s,
            reference_force(run.events),
            run.gauges[AXIAL].described if AXIAL in run.gauges else {},
            _stored_at_end(run),
            Cycles.of(run.curve, run.axial_strain, width, one_zero, run.specimen.area_m2),
            Creep.of(run.curve, run.specimen.test),
        )

    @property
    def force(self) -> NDArray[np.float64]:
        """Force at each instant, (T,) N."""
        return self.curve.stress * (self.specimen.area_m2 or 1.0)

    @property
    def longer(self) -> list[str]:
        """What a person reads of its cycles or its creep, and of the response of its places."""
        creep = creep_lines(self.creep, stresses=self.specimen.area_m2 is not None)
        return [*self.cycles.lines(), *creep, *self.response]

    @property
    def has_force(self) -> bool:
        """Whether any force is known at a measured instant."""
        return bool(np.isfinite(self.curve.stress).any())


def strains_at_end(last: TimeStep) -> dict[str, GaugeValue]:
    """The strains of region and gauges in the burst ``last``, with sigma, or why there is none."""
    found = {}
    for name in REGION:
        value, sigma = getattr(last, name), getattr(last, f"sigma_{name}")
        found[name] = GaugeValue(value, sigma, "" if math.isfinite(value) else last.apart or NO_VALUE)
    return found | {f"gauge {name}": value for name, value in last.gauges.items()}


def reference_force(events: list[Event]) -> float:
    """The force at the first reference, N; NaN where no event has it."""
    forces = [event.data.get("force_N") for event in events if event.kind is EventKind.REFERENCE]
    return float(forces[0]) if forces and forces[0] is not None else math.nan


def _one_zero(samples: Readings, run: RunFolder, lag_s: float) -> Readings:
    """The readings on the clock of the pictures, as if the zero of the first instant had held."""
    zero = np.asarray(run.strain.values.get("zero_N", np.zeros(run.strain.n)), np.float64)

    def zeroed(piece: Track) -> Track:
        t = piece.t - lag_s
        at = np.clip(np.searchsorted(run.strain.time_s, t, side="right") - 1, 0, None)
        return Track(t, piece.values + zero[at] - zero[0])

    return Readings(lambda: map(zeroed, samples.pieces()))


def _stored_at_end(run: RunFolder) -> dict[str, GaugeValue]:
    values, found = run.strain.values, {}
    for name in REGION:
        value, sigma = float(values[name][-1]), float(values[f"sigma_{name}"][-1])
        found[name] = GaugeValue(value, sigma, "" if math.isfinite(value) else NO_VALUE)
    for name, gauge in run.gauges.items():
        value, sigma = float(gauge.value[-1]), float(gauge.sigma[-1])
        reason = "" if math.isfinite(value) else Message("the gauge has no value in the last burst")
        found[f"gauge {name}"] = GaugeValue(value, sigma, reason)
    return found
