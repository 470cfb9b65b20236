"""What the data of a test say against their figures: mistakes of a set-up that can be seen afterwards.

Each finding is one sentence that says what was found, in figures, and what to type. The order is that of how much a
mistake changes the figures; summary and report show the first ``SHOWN``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from acquire.text import Amount, Message
from analysis.evaluate import CONFIDENCE, Figure, Track
from analysis.evaluate.curve import noise
from analysis.evaluate.seen import LEAPS_NEED, fall, leap, leap_alike, renewal_s, without_stopped
from live.results.figures import LAG_MATTERS_S, figure_text
from live.results.finished.finished_test import FinishedTest

NO_FORCE = Message("no force is known")
SHOWN = 3
"""Findings at the top of summary and report."""
Outcome = Literal["good", "doubt", "not checked"]

# Of a strain or stress that has changed: in its noise; and a strain at least
_CLEAR, _CLEAR_STRAIN = 10.0, 1e-4
_FOLLOWS = 0.5  # correlation of stress and strain from which on one follows the other
_MODULUS_GPa = (1e-6, 1000.0)  # of solids, from gels to diamond
_STIFF_GPa, _SOFT_STRAIN = 0.1, 0.005  # what is softer is elastic beyond this strain, a metal is not
_MODULUS_OFF = 0.2
_SIGMAS = 3.0
_AT_REST, _REST_STRAIN, _DRIFT = 8, 1e-5, 0.01  # instants; strain that ends a rest; share of E that counts
_UNCOVERED_S, _UNCOVERED = 2.0, 5.0  # that forces and pictures may differ by at an end: seconds, bursts
_OFF_AXIS = math.radians(10)
_STEP = 0.001  # of the highest force: half of what it changes by from one value to the next
_PRELOAD = 0.002  # of the highest force, below which a force at the reference is the zero of a load cell

_WITHOUT_FORCE = ("alignment", "leaps of the strain")


@dataclass(frozen=True, slots=True)
class DataCheck:
    """The outcome of one check of the data.

    Attributes
    ----------
    name : str
    outcome : "good", "doubt" or "not checked"
    text : str
        What is odd, and what to type; of "not checked" why; empty where the check is good.
    """

    name: str
    outcome: Outcome
    text: str = ""


def findings(test: FinishedTest) -> list[DataCheck]:
    """All checks of a finished test, in the order in which they are shown."""
    return [_finding(name, test) for name in _CHECKS]


def doubts(found: Sequence[DataCheck]) -> list[str]:
    """The sentences to show first: at most ``SHOWN``."""
    return [one.text for one in found if one.outcome == "doubt"][:SHOWN]


def _finding(name: str, test: FinishedTest) -> DataCheck:
    if name not in _WITHOUT_FORCE and not test.has_force:
        return DataCheck(name, "not checked", NO_FORCE)
    text = _CHECKS[name](test)
    if text is None:
        return DataCheck(name, "not checked", Message("the test does not show it"))
    return DataCheck(name, "doubt" if text else "good", text)


def _sign_of_force(test: FinishedTest) -> str | None:
    """Stress and strain must have one sign; a test that is pressed is named."""
    strain, stress = _both_known(test)
    if not (changes(strain, _CLEAR_STRAIN) and changes(stress, 0.0)):
        return None
    follows = float(np.corrcoef(strain, stress)[0, 1])
    longest = strain[np.argmax(np.abs(strain))]
    if follows < -_FOLLOWS:
        way = Message("longer") if longest > 0 else Message("shorter")
        is_negative = np.median(stress[np.abs(stress) > np.abs(stress).max() / 2]) < 0
        sign = Message("negative") if is_negative else Message("positive")
        return Message(
            "the force is {sign} where the specimen gets {way} along {axis}: give --load-sign -1, or --axis "
            "where that is not the axis of the load",
            sign,
            way,
            test.axis.axis,
        )
    if follows > _FOLLOWS and longest < 0 and stress[np.argmax(np.abs(stress))] < 0:
        return Message(
            "the test is in compression: force and strain are negative, and the strengths of tension do not "
            "apply; if it was tension, give --load-sign -1"
        )
    return ""


def _modulus(test: FinishedTest) -> str | None:
    """E, or where it is not known stress over strain, in the range of solids; and E near what was expected.

    What is softer than 0.1 GPa (rubber, foam) has an elastic line beyond 0.5 %; a metal with a wrong section has not.
    """
    if test.specimen.area_m2 is None:
        return None
    e, expected, span = test.figures.E.value * 1e-9, test.specimen.modulus_GPa, test.figures.span
    ask = Message(
        "is the section of {section} that of the specimen and the force in N (--section, --load-unit)?",
        test.specimen.section_text,
    )
    low, high = _MODULUS_GPa
    if not test.figures.E.known or span is None:
        strain, stress = _both_known(test)
        if not (changes(strain, _CLEAR_STRAIN) and changes(stress, 0.0)):
            return None
        most = int(np.argmax(np.abs(stress)))
        over = abs(stress[most]) > high * 1e9 * np.abs(strain).max()
        return (
            Message(
                "a stress of {stress} at a strain of {strain} is not that of a solid: {ask}",
                Amount.rough("stress", float(stress[most]), 3),
                Amount.rough("strain", float(strain[most]), 3),
                ask,
            )
            if over
            else None
        )
    if expected is not None:
        off = abs(e / expected - 1) > _MODULUS_OFF
        return (
            Message("E = {e:.3g} GPa where specimen.modulus_GPa is {expected:g}: {ask}", e, expected, ask)
            if off
            else ""
        )
    text = Amount.rough("stress", e * 1e9, 3)
    if not low <= e <= high:
        return Message("E = {e} is not that of a solid: {ask}", text, ask)
    if e < _STIFF_GPa and span.strain[1] < _SOFT_STRAIN:
        return Message(
            "E = {e} is soft for a line that ends at {strain}: {ask}",
            text,
            Amount.rough("strain", span.strain[1], 2),
            ask,
        )
    return ""


def _coverage(test: FinishedTest) -> str | None:
    """Forces over the whole time of the pictures, and not beyond."""
    samples, t = test.samples.curve.known(), test.curve.t
    if not len(samples.t) or len(t) < 2:
        return None
    limit = max(_UNCOVERED_S, _UNCOVERED * float(np.median(np.diff(t))))
    known = Message(
        "{count_nonzero} of {count} bursts have a force",
        np.count_nonzero(np.isfinite(test.curve.stress)),
        len(t),
    )
    if (late := float(samples.t[0] - t[0])) > limit:
        return Message(
            "the forces begin {late:.1f} s after the pictures ({known}): give forces for all pictures",
            late,
            known,
        )
    if (early := float(t[-1] - samples.t[-1])) > limit:
        return Message(
            "the forces end {early:.1f} s before the pictures ({known}): give forces for all pictures",
            early,
            known,
        )
    beyond = float(samples.t[-1] - t[-1])
    seen = np.abs(samples.values[samples.t <= t[-1]])
    if beyond > limit and len(seen) and np.abs(samples.values).max() > 1.01 * seen.max():
        most = samples.values[np.argmax(np.abs(samples.values))]
        return Message(
            "the pictures end {beyond:.1f} s before the forces, which go on to {most}; no picture shows that",
            beyond,
            Amount.rough("force", float(most), 4),
        )
    return ""


def _leaps(test: FinishedTest) -> str | None:
    """No leap of the force to another level that the strain does not follow; without an elastic line only falls.

    Where the pictures are too few for one, a rise of the force may be the elastic part.
    """
    span = test.figures.span
    found = leap(test.curve) or (fall(test.curve, span.strain[1]) if span is not None else None)
    if not test.figures.E.known and (found is None or found[1] > 0):
        return None
    if found is None:
        return _drift_at_rest(test) or ("" if len(test.curve.t) >= LEAPS_NEED else None)
    return Message(
        "the force leaps by {force} at {t:.4g} s and the strain does not: did zero, range or unit of the load cell "
        "change? All later forces are wrong by it",
        Amount.rough("force", found[1] * (test.specimen.area_m2 or 1.0), 3),
        found[0] - test.curve.t[0],
    )


def _renewal(test: FinishedTest) -> str | None:
    """No value of the force that many lines repeat while the specimen is pulled on."""
    samples = test.samples.first()
    if len(samples.known().t) < 2:
        return None
    every, change = renewal_s(samples, Track(test.curve.t, test.curve.strain))
    if every / 2 < LAG_MATTERS_S or change / 2 < _STEP * float(np.nanmax(np.abs(samples.values))):
        return ""
    return Message(
        "the load cell sends each value again and again, a new one every {every:.2g} s: forces are of up to {change} "
        "before; raise its rate of measuring, or lower its filter",
        every,
        Amount.rough("force", change, 2),
    )


def _drift_at_rest(test: FinishedTest) -> str:
    """A force that changes before the strain does, and what it makes of E if it goes on.

    A force on the specimen would strain it; where less than half of that is seen, it is the zero that drifts.
    """
    curve, line, e = test.curve, test.figures.span, test.figures.E.value
    known = np.isfinite(curve.strain) & np.isfinite(curve.stress)
    t, strain, stress = curve.t[known], curve.strain[known], curve.stress[known]
    moved = np.abs(strain - np.median(strain[:_AT_REST])) > max(5 * noise(strain), _REST_STRAIN)
    n = int(np.argmax(moved)) * 3 // 4  # well before the pull
    if line is None or n < _AT_REST:
        return ""
    x = t[:n] - t[:n].mean()
    (slope, level), pulled = np.polyfit(x, stress[:n], 1), float(np.polyfit(x, strain[:n], 1)[0])
    sigma = float(np.std(stress[:n] - level - slope * x, ddof=2)) / math.sqrt(float(x @ x))
    start, end = (t[np.argmax(strain >= limit)] for limit in line.strain)
    added = float(slope * (end - start))
    share = added / (line.stress[1] - line.stress[0] - added)
    if abs(slope) < 5 * sigma or abs(share) < _DRIFT or abs(pulled * e) > abs(slope) / 2:
        return ""
    area = test.specimen.area_m2 or 1.0
    return Message(
        "the force drifts by {force} in {time:.3g} s of rest at first, and the strain does not: going on, this zero of "
        "the load cell changes E by {share:.0%}. Let it warm up, and tare",
        Amount.rough("force", float(slope * area * np.ptp(x)), 2),
        float(np.ptp(x)),
        share,
    )


def _leaps_of_strain(test: FinishedTest) -> str | None:
    """No leap of the strains along and across the load the same way."""
    found = leap_alike(test.curve)
    if found is None:
        return "" if test.curve.transverse is not None and len(test.curve.t) >= LEAPS_NEED else None
    return Message(
        "the strain leaps by {along} along and {across} across the load at {t:.4g} s: camera, focus or specimen moved "
        "along the line of sight; later strains are wrong by it",
        Amount("strain", found[1]),
        Amount("strain", found[2]),
        found[0] - test.curve.t[0],
    )


def _lag(test: FinishedTest) -> str | None:
    """Force and strain at one time; a force that leaps, stands still or falls out looks like a lag."""
    lag = test.lag
    if not lag.known or _leaps(test) or without_stopped(test.curve)[1]:
        return None
    if abs(lag.value) < max(LAG_MATTERS_S, _SIGMAS * lag.sigma):
        return ""
    way = Message("behind") if lag.value > 0 else Message("ahead of")
    total = lag.value + test.corrected_s
    text = figure_text(
        Figure(abs(lag.value), abs(lag.value) - lag.half, abs(lag.value) + lag.half), 1e-3, "ms"
    )
    return Message(
        "the force comes {text} ({CONFIDENCE:.0%}) {way} the pictures: --lag {total} corrects it",
        text,
        CONFIDENCE,
        way,
        f"{total:.3f}",
    )


def _alignment(test: FinishedTest) -> str | None:
    """The strain of E along the principal strain: that of the gauge ``axial``, else along the axis of the load."""
    angle = test.axis.angle
    if not angle.known:
        return None
    start, end = test.gauge.get("start"), test.gauge.get("end")
    if start and end:
        along = math.atan2(end[1] - start[1], end[0] - start[0]) - (
            math.pi / 2 if test.axis.axis == "y" else 0.0
        )
        off = math.remainder(along - angle.value, math.pi)
        what, mend = Message("the gauge axial"), Message("place it along the load")
    else:
        off, what, mend = (
            angle.value,
            Message("the axis {axis}", test.axis.axis),
            Message("turn the camera, or draw a gauge axial along the load"),
        )
    if abs(off) <= _OFF_AXIS + _SIGMAS * angle.sigma:
        return ""
    return Message(
        "{what} is {size:.0f} degrees off the largest strain, and so are E and nu: {mend}",
        what,
        abs(math.degrees(off)),
        mend,
    )


def _out_of_plane(test: FinishedTest) -> str | None:
    """Poisson's ratio between 0 and 0.5: beyond, motion towards the camera adds the same to both strains."""
    nu = test.figures.nu
    if not nu.known:
        return None
    margin = _SIGMAS * nu.sigma
    if -margin <= nu.value <= 0.5 + margin:
        return ""
    text = figure_text(nu)
    return Message(
        "nu = {text} is beyond 0 to 0.5: the specimen moves towards the camera or bends; see docs/optics.md, "
        "plates",
        text,
    )


def _reference_load(test: FinishedTest) -> str | None:
    """No force at the reference: strains count from there."""
    force, samples = test.reference_N, test.samples.curve.known()
    if not math.isfinite(force) or not len(samples.t):
        return None
    sigma = noise(test.samples.first().values) if len(samples.t) > 3 else 0.0
    if abs(force) <= max(_SIGMAS * sigma, _PRELOAD * float(np.abs(samples.values).max())):
        return ""
    return Message(
        "the reference was taken under load: strains count from {force}; take it before the load, or tare",
        Amount("force", force),
    )


_CHECKS: dict[str, Callable[[FinishedTest], str | None]] = {
    "sign of the force": _sign_of_force,
    "modulus": _modulus,
    "forces and pictures": _coverage,
    "renewal of the force": _renewal,
    "leaps of the force": _leaps,
    "leaps of the strain": _leaps_of_strain,
    "lag": _lag,
    "alignment": _alignment,
    "out of plane": _out_of_plane,
    "reference under load": _reference_load,
}


def _both_known(test: FinishedTest) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    known = np.isfinite(test.curve.strain) & np.isfinite(test.curve.stress)
    return test.curve.strain[known], test.curve.stress[known]


def changes(values: NDArray[np.float64], least: float) -> bool:
    """Whether values leave their noise, and change by more than ``least``."""
    return len(values) > 3 and float(np.ptp(values)) > max(_CLEAR * noise(values), least)
