"""The measuring path: one plain generator for live and replay.

``measure`` takes bursts (and commands among them) and gives measurements. It uses no thread, file,
device or clock, so a replay of the same bursts is bit-equal to the live run. ``Tracker`` holds the kernel
and renews its reference; the guards warn where a measurement is not valid as it stands.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from acquire.burst import LIMIT_PX
from acquire.events import Event, EventKind, EventSink, Level, ignore_event
from acquire.frame import Burst
from acquire.load_cell import LoadLog
from analysis.field import Blur
from analysis.field.picture_error import LIMIT, PictureError
from live.pipeline.measurement import Measurement, TimeStep
from live.pipeline.reference import Correction, averaged, repetition_text, unchanged

if TYPE_CHECKING:
    from analysis import PhaseKernel
    from analysis.evaluate import Gauge
    from analysis.field import Measure, StrainField


MAX_ROTATION, MAX_STRAIN = math.radians(0.5), 0.02
"""Limits of small strains, rad and 1: the error is then 40 um/m by the rotation and 200 um/m by the strain."""
MAX_BLUR_PX, CERTAIN, CALM = 0.5, 3.0, 0.8
"""A blur beyond this gives an event, by so many of its sigmas; below this share of it the picture is well again."""


class Tracker:
    """The current kernel, the last field, and the renewal of the reference.

    All depend on the bursts only, so that a replay of the same bursts does the same.
    """

    def __init__(
        self, kernel: PhaseKernel, noise_GL: float | None, renew_at: float, on_event: EventSink
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
            text = f"the reference was not renewed: {error}"
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
    why = "since the pattern had changed too much" if automatic else "as asked"
    text = f"the reference was renewed {why}; results stay composed on the first one"
    level: Level = "warning" if automatic else "info"
    return Event(burst.t, EventKind.REFERENCE, "measurement", text, level, data | {"renewed": True})


class SmearGuard:
    """Checks the motion during each measured burst; an event when smear begins and when it ends.

    Motion v during T multiplies the contrast at wave number k by |sinc(k v T / 2)|: negligible up to
    0.05 px. The motion is estimated with each burst (``acquire.burst.accumulate``).

    Parameters
    ----------
    on_event : callable taking an Event
    limit_px : float, px
    """

    def __init__(self, on_event: EventSink, limit_px: float = LIMIT_PX) -> None:
        self._on_event, self._limit = on_event, limit_px
        self._smeared = False

    def check(self, burst: Burst) -> None:
        """Check a burst; one whose motion is not known changes nothing."""
        smeared = burst.motion_px > self._limit
        # Hysteresis: a motion near the limit does not repeat the events.
        calm = burst.motion_px < 0.8 * self._limit
        if smeared and not self._smeared:
            text = (
                f"the picture moves {burst.motion_px:.2f} px during a burst of {burst.n}; take shorter bursts"
            )
            self._emit(burst, text, "warning")
        elif calm and self._smeared:
            self._emit(burst, "the picture stands still enough again during a burst", "info")
        self._smeared = smeared or (self._smeared and not calm)

    def _emit(self, burst: Burst, text: str, level: Level) -> None:
        data = {"motion_px": burst.motion_px, "n": burst.n}
        self._on_event(Event(burst.t, EventKind.MEASUREMENT, "burst", text, level, data))


class StrainGuard:
    """Checks each field of small strains, and warns once where another measure is more exact.

    A rotation by r changes small strains by r^2/2 (3 degrees: 1400 µm/m); they differ from the other measures
    by about e^2/2 at a strain e.

    Parameters
    ----------
    measure : str
        Measure of the reported strains; only small strains are checked.
    on_event : callable taking an Event
    """

    def __init__(self, measure: Measure, on_event: EventSink) -> None:
        self._on_event, self._warned = on_event, measure != "small"

    def check(self, field: StrainField, t: float) -> None:
        """Check a field, measured at ``t`` (s)."""
        if self._warned or not field.ok.any():
            return
        turned = abs(float(np.nanmedian(field.rotation)))
        strained = max(abs(float(np.nanmedian(values))) for values in (field.du_dx, field.dv_dy))
        if turned > MAX_ROTATION or strained > MAX_STRAIN:
            self._warned = True
            text = (
                f"turned by {math.degrees(turned):.1f} degrees, strained by {strained:.1%}: small strains are off by"
                f" about {(turned**2 + strained**2) / 2 * 1e6:.0f} µm/m; measure with --strain engineering"
            )
            data = {"rotation": turned, "strain": strained}
            self._on_event(Event(t, EventKind.MEASUREMENT, "strain", text, "warning", data))


CAUSES = {
    "noise": "more noise than the reference or --noise has; more light",
    "compression": "the blocks of a compressed picture; record uncompressed",
    "bands": "bands or lines; a steady lamp, or an exposure of whole periods of the mains",
    "blur": "another sharpness than the reference; focus, motion, distance",
    "filter": "the filters of a camera (denoising, sharpening) or of a format; switch them off",
}
"""What an error of the picture looks like (``PictureError.cause``), and what to do."""


class PictureGuard:
    """Checks what each picture leaves beyond its noise; an event when it exceeds the limit, and when that ends.

    Parameters
    ----------
    on_event : callable taking an Event
    """

    def __init__(self, on_event: EventSink) -> None:
        self._on_event, self._cause = on_event, ""

    def check(self, field: StrainField, t: float) -> None:
        """Check a field, measured at ``t`` (s); one of too few ZOIs changes nothing."""
        error = field.picture
        if error is None or not field.ok.any():
            return
        if error.cause and not self._cause:
            self._emit(t, picture_words(field), "warning", error)
            self._cause = error.cause
        elif self._cause and not error.cause and error.factor < 0.85 * LIMIT:
            self._emit(t, "the picture leaves what its noise explains again", "info", error)
            self._cause = ""

    def _emit(self, t: float, text: str, level: Level, error: PictureError) -> None:
        data = {"cause": error.cause, "factor": error.factor, "over_noise": error.over_noise}
        self._on_event(Event(t, EventKind.MEASUREMENT, "picture", text, level, data))


def picture_words(field: StrainField) -> str:
    """What the picture of a field has become and what that costs, in words; "" where its noise explains it."""
    error = field.picture
    if error is None or not error.cause:
        return ""
    sigma = float(np.nanmedian(np.hypot(field.sigma_exx, field.sigma_eyy))) / math.sqrt(2) * 1e6
    text = f"the picture shows {CAUSES[error.cause]}: strain of a ZOI is uncertain by {sigma:.0f} µm/m"
    return f"{text} in place of {sigma / error.factor:.0f}" if error.factor > 1 else text


@dataclass(frozen=True, slots=True, eq=False)
class NewReference:
    """A command among the bursts: this burst becomes the reference; results stay composed."""

    burst: Burst


class BlurGuard:
    """Checks the sharpness of each measurement; an event when the limit is passed, either way, and when it ends.

    Parameters
    ----------
    on_event : callable taking an Event
    limit_px : float, px
    """

    def __init__(self, on_event: EventSink, limit_px: float = MAX_BLUR_PX) -> None:
        self._on_event, self._limit = on_event, limit_px
        self._changed = False

    def check(self, step: TimeStep) -> None:
        """Check one time step; one whose blur is not known changes nothing."""
        blur, size = Blur(step.blur, step.sigma_blur), abs(step.blur)
        if not self._changed and size - CERTAIN * blur.sigma > self._limit:
            self._changed = True
            text = f"the picture is {blur.text} since the reference: look at focus, distance and exposure"
            self._emit(step, text, "warning")
        elif self._changed and size < CALM * self._limit:
            self._changed = False
            self._emit(step, "the picture is as sharp as the reference again", "info")

    def _emit(self, step: TimeStep, text: str, level: Level) -> None:
        data = {"blur_px": step.blur, "sigma_blur_px": step.sigma_blur}
        self._on_event(Event(step.t, EventKind.MEASUREMENT, "sharpness", text, level, data))


Timer = Callable[[], float]


def measure(
    bursts: Iterable[Burst | NewReference],
    kernel: PhaseKernel,
    loads: LoadLog,
    *,
    noise_GL: float | None = None,
    correct: Correction = unchanged,
    gauges: Sequence[Gauge] = (),
    renew_at: float = 1.0,
    strain: Measure = "small",
    on_event: EventSink = ignore_event,
    timer: Timer = lambda: 0.0,
) -> Iterator[Measurement]:
    """Measure one burst after the other.

    Parameters
    ----------
    bursts : iterable of Burst or NewReference
    kernel : PhaseKernel
        Prepared on the reference.
    loads : LoadLog
        Gives the force at the time of a burst.
    noise_GL : float or None, GL
        Noise of one frame (``frame_noise``); None: estimated by the kernel from the residual.
    correct : callable
        Removes the fixed pattern of the sensor from a burst.
    gauges : sequence of Gauge
        Read on every field.
    renew_at : float
        The reference is renewed when more than this share of the ZOIs is lost from one burst to
        the next, and renewing finds most of them again; 1 for never.
    strain : "small", "engineering", "green" or "hencky"
        The measure of strain of the fields and means.
    on_event : callable taking an Event
        Called when the reference is renewed, and where a guard warns.
    timer : callable
        Gives seconds; only for ``Measurement.measure_s``.

    Yields
    ------
    Measurement
        One for each burst, in order.
    """
    tracker = Tracker(kernel, noise_GL, renew_at, on_event)
    guards = StrainGuard(strain, on_event), PictureGuard(on_event)
    sharpness = BlurGuard(on_event)
    number, repeats = 0, repetition_text(kernel.period)
    for item in bursts:
        if isinstance(item, NewReference):
            tracker.renew_on_demand(correct(item.burst))
            continue
        if number == 0 and repeats:
            on_event(Event(item.t, EventKind.MEASUREMENT, "pattern", repeats, "warning"))
        began = timer()
        field = replace(tracker.measure(correct(item)), measure=strain)
        took = timer() - began
        for guard in guards:
            guard.check(field, item.t)
        measurement = Measurement.of(number, item, field, loads.force_at(item.t), took, gauges)
        sharpness.check(measurement.time_step)
        yield measurement
        number += 1
