"""The measuring path: one plain generator for live and replay.

``measure`` takes bursts (and commands among them) and gives measurements. It uses no thread, file,
device or clock, so a replay of the same bursts is bit-equal to the live run. ``Tracker`` holds the kernel
and renews its reference, ``Corrections`` the optics, and guards warn where a measurement is not valid as it stands.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

import numpy as np

from acquire.errors import DataError
from acquire.events import Event, EventKind, EventSink, Level, ignore_event
from acquire.frame import Burst
from acquire.load_cell import LoadLog
from acquire.text import Message
from analysis.evaluate import REGION, GaugeSet
from analysis.field import part_of
from analysis.optics import (
    ASSUMED_TILT,
    SCALE,
    BurstMotion,
    LensCorrection,
    PlateFit,
    ShutterCorrection,
    choose_model,
    trouble,
)
from live.pipeline.guards import Guard
from live.pipeline.measurement import Measurement, PlateReading
from live.pipeline.reference import Correction, averaged, blank_text, unchanged

if TYPE_CHECKING:
    from analysis import PhaseKernel
    from analysis.evaluate import Gauge
    from analysis.field import Measure, StrainField
    from analysis.optics import LensReading, Model


class Tracker:
    """The current kernel, the last field, and the renewal of the reference.

    All depend on the bursts only, so that a replay of the same bursts does the same.

    Parameters
    ----------
    kernel : PhaseKernel
        Prepared on the reference.
    noise_GL : float or None, GL
        Noise of one frame (``frame_noise``); None: estimated by the kernel from the residual.
    renew_at : float
        The reference is renewed when more than this share of the ZOIs is lost from one burst to
        the next, and renewing finds most of them again; 1 for never.
    on_event : callable taking an Event
        Called when the reference is renewed.
    """

    def __init__(
        self,
        kernel: PhaseKernel,
        noise_GL: float | None = None,
        renew_at: float = 1.0,
        on_event: EventSink = ignore_event,
    ) -> None:
        self._kernel, self._noise_GL, self._renew_at, self._on_event = kernel, noise_GL, renew_at, on_event
        self._field: StrainField | None = None
        self._burst: Burst | None = None

    def measure(self, burst: Burst) -> StrainField:
        """The field of ``burst``."""
        field = self._against(self._kernel, burst, self._field)
        if self._field is not None and self._burst is not None:
            lost = _share(self._field) - _share(field)
            if lost > self._renew_at:
                field = self._renewed_for(burst, field, lost, self._field, self._burst)
        self._field, self._burst = field, burst
        return field

    def renew_on_demand(self, burst: Burst) -> None:
        """Make ``burst`` the reference; an event reports where nothing connects it to the first one."""
        here = self._against(self._kernel, burst, self._field)
        try:
            self._kernel = self._kernel.renewed(burst.mean, here, noise=averaged(self._noise_GL, burst.n))
        except ValueError as error:
            text = Message("the reference was not renewed: {error}", error)
            self._on_event(Event(burst.t, EventKind.MEASUREMENT, "measurement", text, "warning"))
            return
        self._field = None
        self._on_event(_renewal(burst, automatic=False))

    def _renewed_for(
        self, burst: Burst, field: StrainField, lost: float, last: StrainField, last_burst: Burst
    ) -> StrainField:
        """Measure again with the last burst as the reference; kept if that recovers half of the lost ZOIs."""
        try:
            kernel = self._kernel.renewed(last_burst.mean, last, noise=averaged(self._noise_GL, last_burst.n))
        except ValueError:
            return field
        again = self._against(kernel, burst, None)
        if _share(again) - _share(field) < 0.5 * lost:
            return field
        self._kernel = kernel
        self._on_event(_renewal(last_burst, automatic=True))
        return again

    def _against(self, kernel: PhaseKernel, burst: Burst, start: StrainField | None) -> StrainField:
        clipped = burst.clipped if burst.clipped.any() else None
        return kernel.measure(
            burst.mean, start=start, noise=averaged(self._noise_GL, burst.n), clipped=clipped
        )


def _share(field: StrainField) -> float:
    """The share of the active ZOIs that could be measured."""
    return float(np.isfinite(field.u).sum() / max(int(field.grid.active.sum()), 1))


def _renewal(burst: Burst, *, automatic: bool) -> Event:
    data = {"first": burst.first_index, "last": burst.last_index, "n": burst.n, "automatic": automatic}
    why = Message("since the pattern had changed too much") if automatic else Message("as asked")
    text = Message("the reference was renewed {why}; results stay composed on the first one", why)
    level: Level = "warning" if automatic else "info"
    return Event(burst.t, EventKind.REFERENCE, "measurement", text, level, data | {"renewed": True})


class PlateCorrection:
    """Removes the apparent motion of plates from each field; an error event where that stops.

    The model is chosen at the first burst. Where a plate is lost the last motion is removed until it is found
    again; where a plate is not rigid, to the end.

    Parameters
    ----------
    fit : PlateFit
    focal_px : float, px
        Distance of the camera over the size of a pixel on the specimen.
    on_event : callable taking an Event
    """

    def __init__(self, fit: PlateFit, focal_px: float, on_event: EventSink) -> None:
        self._fit, self._focal_px, self._on_event = fit, focal_px, on_event
        self._model: Model | None = None
        self._last = fit.nothing()
        self._loaded, self._trouble = "", ""

    def apply(self, whole: StrainField, burst: Burst, measure: Measure) -> tuple[StrainField, PlateReading]:
        """The field of the specimen, corrected, and what the plates measured; ``whole`` has both."""
        words, not_rigid = trouble(self._fit, whole)
        self._loaded = self._loaded or (words if not_rigid else "")
        words = self._loaded or words
        self._report(words, burst)
        if not words:
            self._model = self._model or self._choose(whole, burst)
            self._last = self._fit.motion(whole, self._model)
        motion, covariance = self._last
        layout = self._fit.layout
        raw = replace(part_of(whole, layout.here, layout.specimen), measure=measure)
        field = replace(motion.removed_from(raw), common=self._fit.error(raw, covariance).beside(raw.common))
        sigma = math.sqrt(float(covariance[SCALE, SCALE]))
        return field, PlateReading(raw, motion, sigma, not words)

    def _choose(self, whole: StrainField, burst: Burst) -> Model:
        chosen = choose_model(self._fit, whole, self._focal_px)
        text = Message(
            "plates {listed}: {model} is corrected; that leaves {noise:.1f} µm/m of noise in the mean "
            "strain, and {unseen:.1f} µm/m by a tilt of {degrees:.1g} degrees",
            ", ".join(self._fit.layout.plates),
            chosen.model,
            chosen.noise * 1e6,
            chosen.unseen * 1e6,
            math.degrees(ASSUMED_TILT),
        )
        data = {"model": chosen.model, "noise": chosen.noise, "unseen": chosen.unseen}
        self._on_event(Event(burst.t, EventKind.MEASUREMENT, "plates", text, "info", data))
        return chosen.model

    def _report(self, words: str, burst: Burst) -> None:
        if bool(words) is bool(self._trouble):
            return
        text, level = Message("the plates are measured again, and the correction goes on"), "info"
        if words:
            level = "error"
            text = Message(
                "{words}; the correction by plates has stopped: motion off the plane reads as strain from here on",
                words,
            )
        self._trouble = words
        self._on_event(Event(burst.t, EventKind.MEASUREMENT, "plates", text, cast(Level, level)))


@dataclass(frozen=True, slots=True, eq=False)
class Corrections:
    """What is corrected, in this order; None where there is nothing to correct.

    Attributes
    ----------
    sensor : callable
        Removes the fixed pattern of the sensor from a burst.
    shutter : ShutterCorrection or None
    lens : LensCorrection or None
    plates : PlateCorrection or None
    """

    sensor: Correction = unchanged
    shutter: ShutterCorrection | None = None
    lens: LensCorrection | None = None
    plates: PlateCorrection | None = None

    def applied(
        self, whole: StrainField, burst: Burst, measure: Measure
    ) -> tuple[StrainField, PlateReading | None, LensReading | None]:
        """The field of the specimen, corrected, in a measure of strain, and what plates and lens made of it."""
        upright = whole if self.shutter is None else self.shutter.apply(whole, burst.t)
        straight, of_lens = (upright, None) if self.lens is None else self.lens.apply(upright)
        if self.plates is None:
            return replace(straight, measure=measure), None, of_lens
        field, of_plates = self.plates.apply(straight, burst, measure)
        return field, of_plates, of_lens


UNCORRECTED = Corrections()


@dataclass(frozen=True, slots=True, eq=False)
class NewReference:
    """A command among the bursts: this burst becomes the reference; results stay composed."""

    burst: Burst


Timer = Callable[[], float]
OnFailure = Callable[[int, Burst | NewReference, Exception], object]
"""Called with the number of a burst, the burst or the new reference before it, and what measuring it raised."""


def measure(
    bursts: Iterable[Burst | NewReference],
    tracker: Tracker,
    loads: LoadLog,
    *,
    corrections: Corrections = UNCORRECTED,
    gauges: Sequence[Gauge] = (),
    strain: Measure = "small",
    guards: Sequence[Guard] = (),
    timer: Timer = lambda: 0.0,
    on_failure: OnFailure | None = None,
) -> Iterator[Measurement]:
    """Measure one burst after the other.

    Parameters
    ----------
    bursts : iterable of Burst or NewReference
    tracker : Tracker
        With the kernel, prepared on the reference.
    loads : LoadLog
        Gives the force at the time of a burst.
    corrections : Corrections
        Of every burst and field; ``tracker`` measures the ZOIs of plates too where there are some.
    gauges : sequence of Gauge
        Read on every field.
    strain : "small", "engineering", "green" or "hencky"
        The measure of strain of the fields and means.
    guards : sequence of Guard
        Check every field (``standard_guards``).
    timer : callable
        Gives seconds; only for ``Measurement.measure_s``.
    on_failure : callable, optional
        Takes what a burst raises, and the next one is measured; without it the error ends the measurement.

    Yields
    ------
    Measurement
        One for each burst, in order, but for those that failed.
    """
    number, motion, sets = -1, BurstMotion(), (GaugeSet(gauges), GaugeSet(REGION))
    for item in bursts:
        number += isinstance(item, Burst)
        try:
            if why := blank_text(item if isinstance(item, Burst) else item.burst):
                raise DataError(why)
            if isinstance(item, NewReference):
                tracker.renew_on_demand(corrections.sensor(item.burst))
                continue
            began = timer()
            whole = tracker.measure(corrections.sensor(item))
            field, of_plates, of_lens = corrections.applied(whole, item, strain)
            field = motion.apply(field, item.t, item.duration)
            took = timer() - began
            force, (values, extensions) = loads.force_at(item.t), (one.read(field) for one in sets)
            measurement = Measurement.of(number, item, field, force, took, values, of_plates, extensions)
            measurement = replace(measurement.with_lens(of_lens), as_measured=whole)
            for guard in guards:
                guard.check(field, measurement.time_step)
        except Exception as error:
            if on_failure is None:
                raise
            on_failure(max(number, 0), item, error)
            continue
        yield measurement
