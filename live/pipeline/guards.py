"""Guards: they look at each measurement, and warn where it is not valid as it stands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from acquire.events import Event, EventKind, EventSink, Level
from acquire.text import Amount, Message
from analysis.field import Blur
from analysis.field.uncertainty import LIMIT, PictureError
from analysis.optics import alike, keystones
from live.pipeline.measurement import TimeStep
from live.pipeline.reference import repetition_text

if TYPE_CHECKING:
    from analysis import PhaseKernel
    from analysis.field import Measure, StrainField

MAX_ELASTIC, FALSE_STRAIN, NU_DOUBT = 1e-3, 2e-5, 0.02
"""Of the check by Poisson's ratio: largest strain, smallest false strain, and doubt about nu, which adds to it."""
MAX_ROTATION, MAX_STRAIN = math.radians(0.5), 0.02
"""Limits of small strains, rad and 1: the error is then 40 um/m by the rotation and 200 um/m by the strain."""
MAX_BLUR_PX, CERTAIN, CALM = 0.5, 3.0, 0.8
"""A blur beyond this gives an event, by so many of its sigmas; below this share of it the picture is well again."""


class Guard(Protocol):
    """Looks at every measurement."""

    def check(self, field: StrainField, step: TimeStep) -> None:
        """Check a field and its means; an event where it is not valid as it stands."""


class StartGuard:
    """Warns at the first field of what is so from the start.

    Parameters
    ----------
    source : str
        Of the events.
    texts : sequence of str
        Empty ones say nothing.
    on_event : callable taking an Event
    """

    def __init__(self, source: str, texts: Sequence[str], on_event: EventSink) -> None:
        self._source, self._texts, self._on_event = source, [text for text in texts if text], on_event

    def check(self, field: StrainField, step: TimeStep) -> None:
        """Warn once, at the time of ``step``."""
        for text in self._texts:
            self._on_event(Event(step.t, EventKind.MEASUREMENT, self._source, text, "warning"))
        self._texts = []


class PartsGuard:
    """Warns where the region has come apart, and says when it is whole again.

    Parameters
    ----------
    on_event : callable taking an Event
    """

    def __init__(self, on_event: EventSink) -> None:
        self._on_event, self._apart = on_event, False

    def check(self, field: StrainField, step: TimeStep) -> None:
        """Check one time step; one without a valid ZOI changes nothing."""
        if not step.n_valid or bool(step.apart) == self._apart:
            return
        self._apart = bool(step.apart)
        text = Message("the region is whole again")
        if self._apart:
            text = Message(
                "{apart}: it has no strain from here on; gauges within a part have, and the extension",
                step.apart,
            )
        level: Level = "warning" if self._apart else "info"
        self._on_event(Event(step.t, EventKind.MEASUREMENT, "region", text, level, {"parts": step.n_parts}))


class StrainGuard:
    """Checks each field of small strains, and warns where another measure is more exact, again where twice as much.

    A rotation by r changes small strains by r^2/2 (3 degrees: 1400 µm/m); they differ from the other measures
    by about e^2/2 at a strain e.

    Parameters
    ----------
    measure : str
        Measure of the reported strains; only small strains are checked.
    on_event : callable taking an Event
    """

    def __init__(self, measure: Measure, on_event: EventSink) -> None:
        self._on_event, self._told = on_event, 0.0 if measure == "small" else math.inf

    def check(self, field: StrainField, step: TimeStep) -> None:
        """Check the strains and rotations of a field."""
        if self._told == math.inf or not field.ok.any():
            return
        turned = abs(float(np.nanmedian(field.rotation)))
        strained = max(abs(float(np.nanmedian(values))) for values in (field.du_dx, field.dv_dy))
        off = (turned**2 + strained**2) / 2
        if (turned > MAX_ROTATION or strained > MAX_STRAIN) and off > 2 * self._told:
            self._told = off
            text = Message(
                "turned by {degrees:.1f} degrees, strained by {strained:.1%}: small strains are off by about "
                "{off}; measure with --strain engineering",
                math.degrees(turned),
                strained,
                Amount("strain", off),
            )
            data = {"rotation": turned, "strain": strained}
            self._on_event(Event(step.t, EventKind.MEASUREMENT, "strain", text, "warning", data))


class DilatationGuard:
    """Checks the strains of a uniaxial elastic test for motion off the plane, and warns once.

    Motion along the optical axis adds the same strain d to both: across + nu axial = (1 + nu) d. Only below
    ``MAX_ELASTIC``, since plastic flow changes the ratio.

    Parameters
    ----------
    nu : float or None
        Poisson's ratio; None: nothing is checked.
    stand_off_mm : float or None, mm
        For the message.
    on_event : callable taking an Event
    """

    def __init__(self, nu: float | None, stand_off_mm: float | None, on_event: EventSink) -> None:
        self._nu, self._stand_off_mm, self._on_event = nu, stand_off_mm, on_event
        self._warned = False

    def check(self, field: StrainField, step: TimeStep) -> None:
        """Check the strains of the region at one time."""
        if self._warned or self._nu is None:
            return
        strains = (step.exx, step.sigma_exx), (step.eyy, step.sigma_eyy)
        (across, sigma_across), (axial, sigma_axial) = sorted(strains, key=lambda one: abs(one[0]))
        if not abs(axial) < MAX_ELASTIC:
            return
        false = (across + self._nu * axial) / (1 + self._nu)
        sigma = math.hypot(sigma_across, self._nu * sigma_axial) / (1 + self._nu)
        if abs(false) > FALSE_STRAIN + NU_DOUBT * abs(axial) + 4 * sigma:
            self._warned = True
            data = {"strain": false, "sigma": sigma}
            text = self._text(false, self._nu)
            self._on_event(Event(step.t, EventKind.MEASUREMENT, "strain", text, "warning", data))

    def _text(self, false: float, nu: float) -> str:
        way = Message("towards") if false > 0 else Message("away from")
        far = (
            ""
            if self._stand_off_mm is None
            else Message(" by {size:.2f} mm", abs(false) * self._stand_off_mm)
        )
        return Message(
            "the strains along and across do not fit nu = {nu:g}: {false} in both is as from "
            "motion{far} {way} the camera, and no strain; E is off too (docs/optics.md)",
            nu,
            Amount("strain", false),
            far,
            way,
        )


class TiltGuard:
    """Checks small strains for what motion off the plane shows without plates and without nu, and warns once of each.

    Strains alike in x and y are those of motion along the axis, also where they rise evenly over the region: of a tilt
    (``analysis.optics.keystones``). A load along one axis makes neither.

    Parameters
    ----------
    focal_px : float or None, px
        Distance of the camera over the size of a pixel, for the messages.
    dilatation : bool
        Whether to check for motion along the axis too; ``DilatationGuard`` does it better where nu is known.
    on_event : callable taking an Event
    """

    def __init__(self, focal_px: float | None, on_event: EventSink, *, dilatation: bool = True) -> None:
        self._focal_px, self._on_event = focal_px, on_event
        self._seeks_dilatation, self._seeks_tilt = dilatation, True

    def check(self, field: StrainField, step: TimeStep) -> None:
        """Check one field with its time step."""
        if self._seeks_dilatation:  # of any size: of two pictures the second may show much
            noise = FALSE_STRAIN + CERTAIN * max(step.sigma_exx, step.sigma_eyy)
            false = alike(step.exx, step.eyy, noise)
            if false:
                self._seeks_dilatation = False
                text = Message(
                    "exx and eyy are alike, {false}: as from motion by {size:.1e} of the stand-off or from "
                    "temperature, not from a load along one axis (docs/optics.md)",
                    Amount("strain", false),
                    abs(false),
                )
                self._emit(step, text, false)
        if self._seeks_tilt and max(abs(step.exx), abs(step.eyy)) < MAX_ELASTIC:
            self._check_tilt(field, step)

    def _check_tilt(self, field: StrainField, step: TimeStep) -> None:
        for way, found in zip(
            (Message("from left to right"), Message("from top to bottom")), keystones(field), strict=True
        ):
            # A load makes exx and eyy differ, and an uneven specimen may then show anything.
            load = abs(step.exx - step.eyy)
            if not abs(found.rise) > max(FALSE_STRAIN + CERTAIN * found.sigma, load):
                continue
            self._seeks_tilt = False
            angle = ""
            if self._focal_px is not None:
                angle = Message(" by {size:.2g} degrees", abs(math.degrees(found.tilt(self._focal_px))))
            text = Message(
                "strain rises by {rise} {way}, in x and y alike: as from a tilt{angle}, or from a shift "
                "behind a lens that is not corrected (docs/optics.md)",
                Amount("strain", found.rise),
                way,
                angle,
            )
            self._emit(step, text, found.rise)
            return

    def _emit(self, step: TimeStep, text: str, strain: float) -> None:
        self._on_event(Event(step.t, EventKind.MEASUREMENT, "strain", text, "warning", {"strain": strain}))


CAUSES = {
    "noise": Message("more noise than the reference or --noise has; more light"),
    "compression": Message("the blocks of a compressed picture; record uncompressed"),
    "bands": Message("bands or lines; a steady lamp, or an exposure of whole periods of the mains"),
    "blur": Message("another sharpness than the reference; focus, motion, distance"),
    "filter": Message("the filters of a camera (denoising, sharpening) or of a format; switch them off"),
}
"""What an error of the picture looks like (``PictureError.cause``), and what to do."""


class PictureGuard:
    """Checks what each picture leaves beyond its noise; an event when it exceeds the limit, and when that ends.

    Blur is left to ``BlurGuard``, which names it once.

    Parameters
    ----------
    on_event : callable taking an Event
    """

    def __init__(self, on_event: EventSink) -> None:
        self._on_event, self._cause = on_event, ""

    def check(self, field: StrainField, step: TimeStep) -> None:
        """Check one field; one of too few ZOIs changes nothing."""
        error = field.picture
        if error is None or not field.ok.any():
            return
        if error.cause not in ("", "blur") and not self._cause:
            self._emit(step.t, picture_words(field), "warning", error)
            self._cause = error.cause
        elif self._cause and not error.cause and error.factor < 0.85 * LIMIT:
            self._emit(step.t, Message("the picture is as noisy as expected again"), "info", error)
            self._cause = ""

    def _emit(self, t: float, text: str, level: Level, error: PictureError) -> None:
        data = {"cause": error.cause, "factor": error.factor, "over_noise": error.over_noise}
        self._on_event(Event(t, EventKind.MEASUREMENT, "picture", text, level, data))


def picture_words(field: StrainField) -> str:
    """What the picture of a field has become and what that costs, in words; "" where its noise explains it."""
    error = field.picture
    if error is None or not error.cause:
        return ""
    sigma = _usual_sigma(field)
    shown = CAUSES[error.cause]
    if not error.factor > 1:
        return Message(
            "the picture shows {shown}: strain of a ZOI is uncertain by {sigma}",
            shown,
            Amount("strain", sigma),
        )
    usual = sigma / error.factor
    return Message(
        "the picture shows {shown}: strain of a ZOI is uncertain by {sigma}, usually {usual}",
        shown,
        Amount("strain", sigma),
        Amount("strain", usual),
    )


def _usual_sigma(field: StrainField) -> float:
    """Uncertainty of the strain of a ZOI: median of both directions."""
    return float(np.nanmedian(np.hypot(field.sigma_exx, field.sigma_eyy))) / math.sqrt(2)


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

    def check(self, field: StrainField, step: TimeStep) -> None:
        """Check one time step; one whose blur is not known changes nothing. ``field`` shows what the blur costs."""
        blur, size = Blur(step.blur, step.sigma_blur), abs(step.blur)
        if not self._changed and size - CERTAIN * blur.sigma > self._limit:
            self._changed = True
            self._emit(step, _blur_words(blur, field), "warning")
        elif self._changed and size < CALM * self._limit:
            self._changed = False
            self._emit(step, Message("the picture is as sharp as the reference again"), "info")

    def _emit(self, step: TimeStep, text: str, level: Level) -> None:
        data = {"blur_px": step.blur, "sigma_blur_px": step.sigma_blur}
        self._on_event(Event(step.t, EventKind.MEASUREMENT, "sharpness", text, level, data))


def _blur_words(blur: Blur, field: StrainField) -> str:
    error = field.picture
    if error is None or error.factor <= LIMIT:
        return Message(
            "the picture is {text} since the reference: look at focus, distance and exposure", blur.text
        )
    sigma = _usual_sigma(field)
    return Message(
        "the picture is {text} since the reference: look at focus, distance and exposure; strain of a ZOI is "
        "uncertain by {sigma}, usually {usual}",
        blur.text,
        Amount("strain", sigma),
        Amount("strain", sigma / error.factor),
    )


def standard_guards(kernel: PhaseKernel, strain: Measure, on_event: EventSink) -> list[Guard]:
    """Those of every measurement, whatever is known of specimen and camera."""
    return [
        StartGuard("pattern", [repetition_text(kernel.period)], on_event),
        PartsGuard(on_event),
        StrainGuard(strain, on_event),
        PictureGuard(on_event),
        BlurGuard(on_event),
    ]
