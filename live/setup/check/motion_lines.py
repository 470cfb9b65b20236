"""Lines of a check on what moves: drift, distance, tilt, vibration."""

from __future__ import annotations

import math
from collections.abc import Iterator

from acquire.text import Message
from acquire.text.quantity import Amount
from analysis.quality.steadiness import Steadiness, mains_of, strain_drifts
from live.setup.check.check_line import CheckLine, not_measured
from live.setup.check.check_list import CheckFigures
from live.setup.check.stillness import PictureStillness

MAX_DILATATION = 5e-5  # common drift of exx and eyy


def motion_lines(f: CheckFigures, max_px: float) -> Iterator[CheckLine]:
    """Drift and vibration, and what exx and eyy do alike; motion above ``max_px`` is bad."""
    if f.lens:
        yield CheckLine("lens", f.lens)
    s = f.still
    if f.stack.few:
        yield from (not_measured(f, what) for what in ("drift", "vibration"))
        return
    if not math.isfinite(s.drift_px):
        yield CheckLine(
            "drift", Message("not measured"), f.zois.without_pattern < 1, "no ZOI can be followed"
        )
        return
    pulled = [one for one in (s.exx, s.eyy) if strain_drifts(one.drift, one.sigma_drift)]
    strain = max(pulled or (s.exx, s.eyy), key=lambda one: abs(one.drift))
    words = Message("keep specimen and camera still")
    if pulled:
        words = Message(
            "strain changes: stop the machine, take the load off, let the specimen rest, then check again"
        )
    yield CheckLine(
        "drift",
        Message(
            "{drift_px:.4f} px and {drift} in {seconds:.3g} s",
            s.drift_px,
            Amount("strain", strain.drift),
            s.u.seconds,
        ),
        s.drift_px <= max_px and not pulled,
        words,
    )
    yield from _common(s)
    shake = s.worse
    yield CheckLine(
        "vibration",
        Message(
            "{vibration}, {vibration2}",
            _vibration(shake, 1, "px", 4),
            _vibration(s.worse_strain, 1e6, "µm/m", 0),
        ),
        shake.vibration <= max_px,
        "a stiffer tripod, a quiet floor, no fan on the bench",
    )


def _common(s: PictureStillness) -> Iterator[CheckLine]:
    """What exx and eyy do alike: a change of the distance, a tilt."""
    steady = "clamp grips and tripod, warm up the camera, or hang plates (docs/optics.md)"
    if s.dilatation:
        words = Message(
            "exx and eyy drift alike, {dilatation}: it changes by {size:.1e} of the stand-off",
            Amount("strain", s.dilatation),
            abs(s.dilatation),
        )
        warm = "warm up the camera, clamp grips and tripod, or hang plates (docs/optics.md)"
        yield CheckLine("distance", words, abs(s.dilatation) < MAX_DILATATION, warm)
    across, down = s.keystone
    if across:
        drift = Amount("strain", across)
        words = Message("strain drifts by {across} from left to right, in x and y alike", drift)
        yield CheckLine("tilt", words, abs(across) < MAX_DILATATION, steady)
    if down:
        drift = Amount("strain", down)
        words = Message("strain drifts by {down} from top to bottom, in x and y alike", drift)
        yield CheckLine("tilt", words, abs(down) < MAX_DILATATION, steady)


def _vibration(s: Steadiness, unit: float, name: str, digits: int) -> str:
    """A vibration with its frequency, or its upper limit by the noise."""
    if not s.vibration > s.noise / 2:
        return Message("less than {noise} {name}", format(s.noise * unit, f".{digits}f"), name)
    text = Message("{vibration} {name} rms", format(s.vibration * unit, f".{digits}f"), name)
    if s.frequency is None:
        return text
    mains = mains_of(s, 1)
    cause = Message(", as from {mains:.0f} Hz mains", mains) if mains is not None else ""
    return Message("{text}, mainly at {frequency:.1f} Hz{cause}", text, s.frequency, cause)
