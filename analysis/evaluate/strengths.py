"""Strengths and extensions of a loaded curve: Rp, ReH, ReL, Rm, Agt, At, after ISO 6892-1:2019.

The interval of a highest stress holds the noise of one value and what may lie between two samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquire.text import Amount, Message
from analysis.evaluate.curve import ENOUGH, Curve, Floats, Loading, first_crossing, noise, reading, smoothed
from analysis.evaluate.elastic import FittedLine
from analysis.evaluate.figure import Figure, quantile

Indices = NDArray[np.intp]

ENDED = Message("the test ended before the stress fell")
# Annex A: a yield point falls by 0.5 % and is not passed again for 0.05 % strain
_DROP, _RANGE = 0.005, 0.0005
# Strain after ReH: its undershoot, and where ReL is looked for (clause 12)
_TRANSIENT, _PLATEAU = 0.0005, 0.0025
_BEGINS = 0.002  # plastic strain before which flow begins
_FINE = 2.5e-4  # strain that the means may reach over where the stress waves
_ABOUT = 0.25  # of a proof strain: the part of the curve that its stress is read from
_PULLED = 0.5  # of the plastic strain there: the strain must grow by as much, or it is a hold
_LEAP = 0.5  # of the plastic strain, between two measurements: the course of the material is not seen
_BEFORE = 5  # samples whose rise bounds what may lie between two of them
_SURE = 4.0  # standard deviations that a fall must exceed
_EQUAL = 0.1  # of the readings equal to the one before: their noise is below their resolution


@dataclass(frozen=True, slots=True)
class Yield:
    """Upper and lower yield strength (Pa), and the place of the upper one, -1 where there is none."""

    upper: Figure
    lower: Figure
    at: int = -1


def proof_strength(loading: Loading, line: FittedLine, offset: float) -> Figure:
    """Rp: the stress at which ``offset`` plastic strain is reached, parallel to ``line`` (3.10.3), Pa."""
    plastic = loading.strain - line.strain_at(loading.stress)
    course = smoothed(plastic, loading.half)
    at = first_crossing(course, offset, line.first)
    if math.isnan(at):
        most = float(course[line.first :].max())
        return Figure.none(
            Message(
                "the plastic strain reaches {most:.2g} %, {offset:g} % is needed", 100 * most, 100 * offset
            )
        )
    first, last = _around(course, at, (1 - _ABOUT) * offset, (1 + _ABOUT) * offset)
    strain = reading(plastic, at, first, last, noise(plastic[line.first : last]))
    stress = reading(loading.stress, at, first, last, loading.noise_stress)
    place = (offset - strain.value) / strain.slope if strain.slope > 0 else 0.0
    hardening = abs(stress.slope / strain.slope) if strain.slope > 0 else 0.0
    if loading.course[last - 1] - loading.course[first] < _PULLED * (course[last - 1] - course[first]):
        return Figure.none(
            Message(
                "{offset:g} % plastic strain is reached while the stress falls and the strain rests",
                100 * offset,
            )
        )
    value = stress.value + stress.slope * float(np.clip(place, -2, 2))
    doubt = math.hypot(strain.sigma, line.sigma_at(value))
    found = Figure.about(value, math.hypot(stress.sigma, hardening * doubt), max(last - first - 3, 4))
    if last - first >= ENOUGH:
        between = _waves(loading, at, stress.value, np.arange(first, last))
    else:
        between = _bend(loading.stress, at) + hardening * _bend(plastic, at)
    leap = float(np.diff(plastic[line.first : last + 1]).max())
    if leap > max(_LEAP * offset, _SURE * math.sqrt(2) * noise(plastic[line.first : last])):
        found = found.remarked(
            Message("the strain leaps by {leap} between two measurements before", Amount("strain", leap))
        )
    return replace(found, low=found.low - between, high=found.high + between)


def yield_point(loading: Loading, line: FittedLine) -> Yield:
    """ReH and ReL (3.10.2, annex A), or why the curve has none."""
    highest = np.maximum.accumulate(loading.stress)
    fallen = (loading.level < highest * (1 - _DROP)) & (
        highest - loading.stress > _SURE * loading.noise_stress
    )
    for k in np.flatnonzero(fallen & (np.arange(loading.n) > line.last)):
        at = int(np.argmax(loading.stress[: k + 1]))
        end = _passed(loading, at)
        lasts = loading.course[end] - loading.course[at] >= (_RANGE if end < loading.n - 1 else _PLATEAU)
        if lasts and loading.course[at] - line.strain_at(loading.level[at]) < _BEGINS:
            upper = highest_stress(loading, at)
            return Yield(upper, _lower(loading, at, end, upper), at)
    why = Message("no yield point: nowhere does the stress fall by 0.5 % for 0.05 % strain where flow begins")
    return Yield(Figure.none(why), Figure.none(why))


def tensile_strength(curve: Curve) -> Figure:
    """Rm: the highest stress up to the break (3.10.1), whether strain is known there or not, Pa.

    A bound where the test ended before the stress fell.
    """
    loading = Loading.of(replace(curve, strain=np.zeros_like(curve.stress)))
    if not loading.n:
        return Figure.none(Message("no stress is known"))
    if loading.stress[loading.top] <= 0:
        return Figure.none(Message("no tensile stress is known"))
    found = highest_stress(loading, loading.top)
    if found.low <= 0:
        return Figure.none(Message("no tensile stress beyond its noise is known"))
    rises = not loading.broke and loading.level[-1] >= loading.level.max() - 3 * loading.noise_stress
    return found.remarked(ENDED).at_least() if rises else found


def highest_stress(loading: Loading, at: int) -> Figure:
    """The measured peak at ``at``, with what noise and the distance of the samples leave open, Pa."""
    stress, sigma = loading.stress, loading.noise_stress
    near = int(np.count_nonzero(stress >= stress[at] - 3 * sigma))
    lifted = max(quantile(), math.sqrt(2 * math.log(max(near, 1))) + 1) * sigma
    before = max(at - _BEFORE, 0)
    rise = max(float(stress[at] - stress[before]), 0.0) / max(at - before, 1)
    value = float(stress[at])
    # Where samples lie farther apart from here on, more may lie between them.
    steps = np.diff(loading.strain[before : at + 2])
    if at > before and at + 1 < loading.n and steps[-1] > 2 * (usual := float(steps[:-1].mean())) > 0:
        rise *= float(steps[-1]) / usual
    rounded = _rounding(stress, sigma)
    return Figure(value, value - lifted - rounded, value + quantile() * sigma + rise + rounded)


def _rounding(stress: Floats, sigma: float) -> float:
    """Half the resolution of the readings where it is coarser than their noise, so that neighbours are equal."""
    steps = np.abs(np.diff(stress))
    if not steps.any() or np.mean(steps == 0) < _EQUAL:
        return 0.0
    step = float(steps[steps > 0].min())
    return step / 2 if step / math.sqrt(12) > sigma else 0.0


def strain_at_top(loading: Loading) -> Figure:
    """Agt without its zero: the strain at the highest stress; on a flat top, its middle (3.6.4)."""
    doubt = _doubt(loading)
    flat = np.flatnonzero(loading.level >= loading.level.max() - doubt)
    first, last = int(flat[0]), int(flat[-1])
    if last == loading.n - 1 and not loading.broke:
        return Figure.none(ENDED)
    low, high = float(loading.course[first]), float(loading.course[last])
    # A neck beside the gauge lets that shorten: the highest stress may have more strain than the end of the flat top.
    high = max(high, float(loading.strain[loading.top])) if first <= loading.top <= last else high
    half = quantile() * loading.noise_strain + max(_step(loading, k) for k in (last, loading.top))
    return Figure((low + high) / 2, low - half, high + half)


def strain_at_break(loading: Loading) -> Figure:
    """At without its zero: the last strain before the break."""
    if not loading.broke:
        return Figure.none(Message("no break was seen: the stress did not fall below 2 % of the highest"))
    value, half = float(loading.strain[-1]), quantile() * loading.noise_strain
    return Figure(value, value - half, value + half + 2 * _step(loading, loading.n - 1))


def _passed(loading: Loading, at: int) -> int:
    """Where the peak at ``at`` is passed again for good; the end where it never is."""
    again = np.flatnonzero(loading.level[at + 1 :] > loading.stress[at])
    return at + 1 + int(again[0]) if len(again) else loading.n - 1


def _lower(loading: Loading, at: int, passed: int, upper: Figure) -> Figure:
    """The lowest stress between the transient and 0.25 % after the upper yield strength.

    The interval reaches down to the lowest of the whole plateau, which is the other reading of the definition (3.10.2.2
    and clause 12), and of what may lie between two samples.
    """
    after = loading.course - loading.course[at]
    plateau = np.flatnonzero(
        (np.arange(loading.n) > at) & (np.arange(loading.n) <= passed) & (after >= _TRANSIENT)
    )
    part = plateau[after[plateau] <= _PLATEAU]
    if not len(part):
        return Figure.none(Message("the plateau is too short to tell the lower yield strength"))
    half, level = _fine(loading, part)
    doubt = _SURE * loading.noise_stress / math.sqrt(2 * half + 1)
    value = float(level[part].min())
    least = min(value, float((level - _hidden_bottom(level, max(half, 1), doubt))[plateau].min()))
    return Figure(min(value, upper.value), least - doubt, min(value + doubt, upper.high))


def _hidden_bottom(level: Floats, reach: int, doubt: float) -> Floats:
    """How far a bottom may lie below each value: lifted by means, or between two samples, (N,)."""
    bend = np.zeros(len(level))
    bend[reach:-reach] = level[: -2 * reach] - 2 * level[reach:-reach] + level[2 * reach :]
    return np.where(bend > 2 * doubt, bend / 2, 0.0)


def _doubt(loading: Loading) -> float:
    """How far the lowest or highest of the running means may be from the truth, Pa."""
    return _SURE * loading.noise_stress / math.sqrt(2 * loading.half + 1)


def _step(loading: Loading, k: int) -> float:
    """The strain from one sample to the next, about there."""
    return max(float(loading.course[k] - loading.course[max(k - 1, 0)]), 0.0)


def _bend(values: Floats, at: float) -> float:
    """How far a course may be from the straight line between the two samples at ``at``: where it has a kink there.

    A kink turns by what second differences on both sides have together; a smooth bend departs by a quarter of that.
    Without a sample farther on either side, all that it changes by.
    """
    before = math.floor(at)
    near = values[max(before - 1, 0) : before + 3]
    if before < 1 or len(near) < 4:
        return abs(float(values[before + 1] - values[before]))
    return float(np.abs(np.diff(near, 2)).sum()) / 4


def _fine(loading: Loading, part: Indices) -> tuple[int, Floats]:
    """Running means of the stress over no more than a part of a wave, and half the width of them, samples."""
    a_sample = float(np.diff(loading.course[part]).max(initial=0.0))
    half = min(loading.half, round(_FINE / max(a_sample, 1e-12) / 2))
    return half, loading.level if half == loading.half else smoothed(loading.stress, half)


def _waves(loading: Loading, at: float, value: float, part: Indices) -> float:
    """How far the stress at ``at`` may be from a parabola over ``part``: where it waves, beyond noise."""
    half, level = _fine(loading, part)
    off = abs(float(np.interp(at, np.arange(loading.n), level)) - value)
    return 1.25 * off if off > _SURE * loading.noise_stress / math.sqrt(2 * half + 1) else 0.0


def _around(course: Floats, at: float, low: float, high: float) -> tuple[int, int]:
    """The samples next to ``at`` whose course stays between ``low`` and ``high``."""
    first, last = math.floor(at), math.floor(at) + 1
    while first > 0 and low <= course[first - 1]:
        first -= 1
    while last < len(course) and course[last] <= high:
        last += 1
    return first, last
