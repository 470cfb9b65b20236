"""What of the force was seen: of a load cell that lives, confirmed by neighbours; gaps that may hide the highest.

A load cell may renew its value more slowly than it sends lines: each is the force of up to one renewal ago. A display
of a coarse last digit repeats values too, but then a change is of a digit or two, and the runs are as long as the force
is slow. A force that truly goes by steps moves the specimen with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquire.text import Message
from analysis.evaluate.curve import Curve, Floats, broken_at, noise
from analysis.evaluate.lag import Track

_USUAL, _STEEP = 75, 3.0  # percentile of the rises, and times those
_SURE = 8.0  # standard deviations of the noise
_PULLED = 2.5  # times the steepest rise over the strain
_BESIDE = 0.99  # of the highest stress: a gap before it is beside it
_RUN, _LONGEST, _SHARE = 3, 0.025, 0.1  # readings in a row, or share of all; and of all together
_PART = 0.01  # of the strain: over so much the steepest rise is read
_FEWEST = 12  # readings that know what is usual
_GAP, _FASTEST = 2.5, 95  # usual intervals; percentile of the rises
_EQUAL = 5  # readings in a row that may be those of a load cell that stands still
_BY_CHANCE = 1e-6  # how often so many may be equal in a living load cell
_LEVELS = 3  # values at which readings rest: as many are the resolution of a quiet load cell
_LOADED = 0.05  # of the highest stress
_AROUND, _SAME_RATE = 8, 0.5  # readings before and after a fall; how much strain rates of one motion differ
_FALLEN, _RISEN = 0.9, 0.95  # of the stress before: a fall that the load cell makes, and its end
_LEAP, _FLAT = 0.01, 1e-3  # of the highest stress: a leap, and what a straight part may leave
_LEAST_STRAIN = 5e-5  # a leap
LEAPS_NEED = 2 * _AROUND + _FEWEST
"""Instants of a test that shows leaps."""
_STEADY = 0.75  # of the usual modulus: a step that shows it
_YIELDS = 0.3  # of the stress: a fall by more is no yield point
_KINK = 1.75  # of a rate a reading: what a kink in it may look like beside a leap (1.61 at most over _AROUND)

_LINES, _VALUES = 3, 12  # of one value in a row; such runs
_DIGITS, _ROUNDING = 5.0, 1e-9  # of the last digit: a large change; of the highest force: none
_ALIKE, _LONG = 0.8, 0.1  # of the runs that are as long as usual, and by how much they differ
_FAST_S = 0.6  # what a display takes at most, without another sign
_MOVES = 0.3  # of the strain with a change of the force: what it moves by without one


def without_stopped(curve: Curve) -> tuple[Curve, tuple[str, ...]]:
    """The curve without the stresses of a load cell that stood still or fell out, and words that say so."""
    known = np.flatnonzero(np.isfinite(curve.stress) & np.isfinite(curve.strain))
    runs = _stuck(curve.stress[known], curve.strain[known])
    rows = np.array([row for a, b in runs for row in known[a + 1 : b]], np.intp)
    left, words = replace(curve, stress=curve.stress.copy()), []
    if len(rows):
        left.stress[rows] = math.nan
        words.append(
            Message(
                "forces left out: {n} the same to the last digit, from {t:.4g} s to {end:.4g} s, while the strain "
                "rises; does the load cell reach its limit, or stop?",
                len(rows),
                curve.t[rows[0] - 1] - curve.t[0],
                curve.t[rows[-1]] - curve.t[0],
            )
        )
    stop = broken_at(left.stress, left.strain)
    if stop is not None and _goes_on(left.strain, stop):
        left.stress[stop + 1 :] = math.nan
        words.append(
            Message(
                "forces left out: they fall to nothing at {t:.4g} s and the strain rises on as before; is the load "
                "cell connected, and within its range?",
                curve.t[stop] - curve.t[0],
            )
        )
    return (left, tuple(words)) if words else (curve, ())


def _stuck(stress: Floats, strain: Floats) -> list[tuple[int, int]]:
    """First and end of each run of equal stresses that noise cannot make, under load and while the strain moves on."""
    same = np.flatnonzero(np.diff(np.concatenate([[False], np.diff(stress) == 0, [False]])))
    runs = [(int(a), int(b) + 1) for a, b in same.reshape(-1, 2) if b + 1 - a >= _EQUAL]
    rest = np.delete(stress, [k for a, b in runs for k in range(a, b)])
    sigma, steps = noise(rest), np.abs(np.diff(rest))
    if not runs or len(rest) < _FEWEST or sigma == 0:
        return []
    by_step = float(steps[steps > 0].min()) / (2 * math.sqrt(math.pi) * sigma)
    chance = min(max(by_step, float(np.mean(steps == 0))), 1.0)
    least = _LOADED * float(np.abs(stress).max())
    found = [
        (a, b)
        for a, b in runs
        if len(stress) * chance ** (b - a - 1) < _BY_CHANCE
        and abs(stress[a]) > least
        and _pulled_on(strain, a, b)
    ]
    return found if len({float(stress[a]) for a, _ in runs}) < _LEVELS else []


def _pulled_on(strain: Floats, first: int, end: int) -> bool:
    """Whether the strain changes about as fast as before: not a hold, nor creep under a weight."""
    before = strain[max(2 * first - end, 0) : first]
    if len(before) < _EQUAL:
        return False
    moved = float(np.ptp(strain[first:end]))
    return bool(
        moved > 1.5 * _SURE * noise(strain)
        and moved / (end - first) > _SAME_RATE * np.ptp(before) / len(before)
    )


def _goes_on(strain: Floats, stop: int) -> bool:
    """Whether the strain rises through a break as if there were none: neither a leap nor another rate."""
    k = np.arange(-_AROUND, _AROUND)
    part = strain[stop + 1 - _AROUND : stop + 1 + _AROUND]
    if stop + 1 < _AROUND or len(part) < len(k) or not np.isfinite(part).all():
        return False
    before, after = (np.polyfit(k[side], part[side], 1) for side in (k < 0, k >= 0))
    sigma = max(noise(strain[: stop + 1]), noise(part))
    rise = float(before[0]) * _AROUND
    leap = abs(float(np.polyval(after, -0.5) - np.polyval(before, -0.5)))
    return bool(
        rise > _SURE * sigma and abs(after[0] / before[0] - 1) < _SAME_RATE and leap < 3 * sigma + 0.2 * rise
    )


def confirmed(curve: Curve) -> tuple[Curve, tuple[str, ...]]:
    """The curve without stresses that rise, or fall while the strain rises, in no time and come back; words for those.

    A stress is reached through its neighbours: it rises from one reading to the next by no more than a few times what
    is usual, and by what the strain that comes with it makes of it. A break falls and does not come back; a jump that
    stays is no single reading.
    """
    known = np.flatnonzero(np.isfinite(curve.stress))
    stress, strain = curve.stress[known], curve.strain[known]
    dips = _dips(stress, strain)
    alone = np.zeros(len(known), np.bool_)
    alone[~dips] = _alone(stress[~dips], strain[~dips])
    words, left = [], curve.stress.copy()
    left[known[alone | dips]] = math.nan
    if alone.any():
        highest = int(np.argmax(np.where(alone, stress, -math.inf)))
        words.append(
            Message(
                "forces left out because no neighbour confirms them: {count}, the highest, at {t:.4g} s, "
                "{stress:.3g} times the highest of the others",
                np.count_nonzero(alone),
                curve.t[known[highest]] - curve.t[0],
                stress[highest] / np.max(stress[~alone]),
            )
        )
    if dips.any():
        words.append(
            Message(
                "forces left out: {n} that fall and come back at once while the strain rises, the first at {t:.4g} s; "
                "does the load cell send zeros between its readings?",
                np.count_nonzero(dips),
                curve.t[known[np.argmax(dips)]] - curve.t[0],
            )
        )
    return (replace(curve, stress=left), tuple(words)) if words else (curve, ())


def _alone(stress: Floats, strain: Floats) -> NDArray[np.bool_]:
    """Which stresses lie far above those before them, and are followed by one that does not, (N,)."""
    n, alone = len(stress), np.zeros(len(stress), np.bool_)
    rises, pulls = np.diff(stress), np.diff(strain)
    if n < _FEWEST or not (rises > 0).any():
        return alone
    longest = max(_RUN, round(_LONGEST * n))
    level = running_median(stress, longest)
    usual = max(float(np.percentile(rises[rises > 0], _USUAL)), float(np.diff(level).max()))
    pulled = _PULLED * _stiffness(strain, level) * np.nan_to_num(np.maximum(pulls, 0.0))
    most = np.maximum(_STEEP * usual, pulled) + _SURE * noise(stress)
    k = 0
    while k < n - 1:
        if rises[k] <= most[k]:
            k += 1
            continue
        back = np.flatnonzero(stress[k + 1 : k + 2 + longest] <= stress[k] + most[k])
        if len(back) or k + 2 == n:
            alone[k + 1 : k + 1 + (int(back[0]) if len(back) else 1)] = True
        k += 1 + (int(back[0]) if len(back) else 0)
    return alone if alone.sum() <= _SHARE * n else np.zeros(n, np.bool_)


def _dips(stress: Floats, strain: Floats) -> NDArray[np.bool_]:
    """Which stresses under load fall and are back within a few readings in which the strain rises on, (N,)."""
    dips = np.zeros(len(stress), np.bool_)
    if len(stress) < _FEWEST:
        return dips
    loaded = stress[:-1] > max(_LOADED * stress.max(), 0.0)
    for k in np.flatnonzero((stress[1:] < _FALLEN * stress[:-1]) & loaded):
        back = np.flatnonzero(stress[k + 2 : k + 2 + _RUN] > _RISEN * stress[k])
        if len(back) and (np.diff(strain[k : k + 3 + back[0]]) > 0).all():
            dips[k + 1 : k + 2 + back[0]] = True
    return dips if dips.sum() <= _SHARE * len(stress) else np.zeros(len(stress), np.bool_)


def leap(curve: Curve) -> tuple[float, float] | None:
    """When the stress leaps most to another level, s, and by how much; None where the strain explains every step.

    Straight lines through the readings on either side of one miss each other there. The strain explains as much as the
    stiffest straight part makes of its own leap, or of a step that its rates do not make; a kink of a rate looks like a
    leap of less than ``_KINK`` of that rate. A yield point falls by less than ``_YIELDS``.
    """
    curve = confirmed(without_stopped(curve)[0])[0]
    stop = broken_at(curve.stress, curve.strain)
    known = np.isfinite(curve.stress) & np.isfinite(curve.strain)
    known &= np.arange(len(known)) <= (len(known) if stop is None else stop)
    t, strain, stress = curve.t[known], curve.strain[known], curve.stress[known]
    if len(stress) < LEAPS_NEED:
        return None
    (leaps, rates, left), (pulls, pulled, _) = _sides(stress), _sides(strain)
    top, sigma, unsure = float(np.abs(stress).max()), noise(stress), _SURE * noise(strain)
    straight = (left < max(3 * sigma, _FLAT * top)) & (np.abs(pulled) * _AROUND > unsure) & (pulled != 0)
    stiffest = float(np.max(rates[straight] / pulled[straight], initial=0.0))
    before, after, at = np.s_[: len(leaps)], np.s_[-len(leaps) :], np.s_[_AROUND - 1 : 1 - _AROUND]
    steps = np.abs(strain[2:] - strain[:-2])[at] - 2 * np.minimum(
        np.abs(pulled[before]), np.abs(pulled[after])
    )
    explained = _PULLED * stiffest * np.maximum(np.maximum(np.abs(pulls), steps), unsure / 2)
    explained += _KINK * np.maximum(np.abs(rates[before]), np.abs(rates[after]))
    least = np.where(
        leaps > 0, max(_SURE * sigma, _LEAP * top), _YIELDS * np.abs(stress[_AROUND - 1 :][before])
    )
    over = np.minimum(np.abs(leaps), np.abs(stress[2:] - stress[:-2])[at]) - explained - least
    k = int(np.argmax(over))
    return (float(t[k + _AROUND]), float(leaps[k])) if over[k] > 0 and stiffest > 0 else None


def fall(curve: Curve, until: float) -> tuple[float, float] | None:
    """When the stress most falls short of what the strain makes of it between two instants, s, and by how much.

    Up to the strain ``until``, the end of the elastic part: one step has less than half of the usual modulus, and its
    neighbours have it. None where there is none.
    """
    known = np.isfinite(curve.stress) & np.isfinite(curve.strain) & (np.cumsum(curve.strain > until) == 0)
    t, stress, strain = curve.t[known], curve.stress[known], curve.strain[known]
    pulls, unsure = np.diff(strain), _SURE * noise(strain)
    if len(pulls) < _EQUAL:
        return None
    slopes = np.diff(stress) / np.where(pulls > unsure, pulls, math.inf)  # 0 where the strain rests
    usual = float(np.median(slopes))
    short = (np.diff(stress) - usual * pulls)[1:-1]
    least = np.maximum(_SURE * noise(stress) + usual * unsure, (1 - _RISEN) * stress[1:-2])
    beside = np.minimum(slopes[:-2], slopes[2:]) > _STEADY * usual
    over = np.where(beside & (slopes[1:-1] < usual / 2) & (usual > 0), -short - least, 0.0)
    k = int(np.argmax(over))
    return (float(t[k + 2]), float(short[k])) if over[k] > 0 else None


def leap_alike(curve: Curve) -> tuple[float, float, float] | None:
    """When the strains along and across the load leap most the same way, s, and by how much; None where they do not.

    No force along one axis does that: the camera, its focus or the specimen moved.
    """
    if curve.transverse is None:
        return None
    stop = broken_at(curve.stress, curve.strain)
    known = np.isfinite(curve.strain) & np.isfinite(curve.transverse)
    known &= np.arange(len(known)) <= (len(known) if stop is None else stop)
    if np.count_nonzero(known) < LEAPS_NEED:
        return None
    leaps, over = [], []
    for values in (curve.strain[known], curve.transverse[known]):
        found, rates, _ = _sides(values)
        before, after = rates[: len(found)], rates[-len(found) :]
        raw = np.abs((values[2:] - values[:-2])[_AROUND - 1 : 1 - _AROUND] - before - after)
        least = _KINK * np.maximum(np.abs(before), np.abs(after)) + max(_SURE * noise(values), _LEAST_STRAIN)
        over.append(np.minimum(np.abs(found), raw) - least)
        leaps.append(found)
    clear = np.where(leaps[0] * leaps[1] > 0, np.minimum(*over), 0.0)
    k = int(np.argmax(clear))
    t = float(curve.t[known][k + _AROUND])
    return (t, float(leaps[0][k]), float(leaps[1][k])) if clear[k] > 0 else None


def _sides(values: Floats) -> tuple[Floats, Floats, Floats]:
    """By how much lines through ``_AROUND`` values before and after one miss each other; slopes and rms residuals."""
    windows, x = (
        np.lib.stride_tricks.sliding_window_view(values, _AROUND),
        np.arange(_AROUND) - (_AROUND - 1) / 2,
    )
    mean, slope = windows.mean(axis=1), windows @ x / (x @ x)
    left = np.sqrt(((windows - mean[:, None] - slope[:, None] * x) ** 2).mean(axis=1))
    reach = slope * (_AROUND + 1) / 2
    return (mean - reach)[_AROUND + 1 :] - (mean + reach)[: -_AROUND - 1], slope, left


def _stiffness(strain: Floats, level: Floats) -> float:
    """The steepest rise of the stress over the strain, Pa; 0 where strain is not known."""
    known = np.isfinite(strain)
    highest = np.maximum.accumulate(strain[known])
    if len(highest) < _FEWEST:
        return 0.0
    span = max(_PART * float(np.ptp(highest)), 20 * noise(strain))
    on = np.searchsorted(highest, highest + span)
    inside = on < len(highest)
    rise = level[known][np.minimum(on, len(highest) - 1)] - level[known]
    run = highest[np.minimum(on, len(highest) - 1)] - highest
    return float(np.max(rise[inside] / run[inside], initial=0.0)) if span > 0 else 0.0


def running_median(values: Floats, half: int) -> Floats:
    """Median over 2 ``half`` + 1 values, the ends repeated beyond them, (N,)."""
    from scipy.ndimage import median_filter

    return np.asarray(median_filter(values, 2 * half + 1, mode="nearest"))


@dataclass(frozen=True, slots=True)
class Unseen:
    """A gap in the force that may hide the highest stress.

    Attributes
    ----------
    before, after : int
        Rows of the curve with the last force before it and the first after it; ``after`` is -1 at the end.
    words : str
    """

    before: int
    after: int
    words: str


def unseen(curve: Curve, measured: Curve) -> Unseen | None:
    """The first gap up to the break in which the stress may have passed the highest that is known, or None.

    One after the highest stress counts where it is longer than the usual interval; one beside it, or of forces that
    ``measured`` has and ``curve`` has not, where the stress could pass the highest at the fastest rise of the test.
    """
    stop = broken_at(curve.stress, curve.strain)
    known = np.flatnonzero(np.isfinite(curve.stress[: len(curve.t) if stop is None else stop + 1]))
    if len(known) < 3:
        return None
    t, stress = curve.t[known], curve.stress[known]
    next_to = np.diff(known) == 1
    usual = float(np.median(np.diff(curve.t)))
    rises = (np.diff(stress) / np.maximum(np.diff(t), 1e-9))[next_to]
    fastest = float(np.percentile(rises, _FASTEST)) if len(rises) else math.inf
    ends = np.append(stress[1:], -math.inf if stop is None else 0.0)
    spans = np.append(np.diff(t), 0.0 if stop is not None else curve.t[-1] - t[-1])
    reached = np.where(np.isfinite(ends), (stress + ends + fastest * spans) / 2, stress + fastest * spans)
    top = int(np.argmax(stress))
    missing = np.append(~next_to, spans[-1] > _GAP * usual)
    left_out = np.cumsum(np.isfinite(measured.stress) & ~np.isfinite(curve.stress))[known]
    late = (
        (np.arange(len(known)) >= top)
        & (spans > _GAP * usual)
        & (np.diff(left_out, append=left_out[-1]) == 0)
    )
    beside = (reached > stress[top]) & (np.maximum(stress, ends) > _BESIDE * stress[top])
    hidden = np.flatnonzero(missing & (late | beside))
    if not len(hidden):
        return None
    k = int(hidden[0])
    after = int(known[k + 1]) if k + 1 < len(known) else -1
    until = Message("to {t:.4g} s", curve.t[after] - curve.t[0]) if after >= 0 else "on"
    return Unseen(
        int(known[k]), after, Message("no force is known from {t:.4g} s {until}", t[k] - curve.t[0], until)
    )


def renewal_s(force: Track, strain: Track) -> tuple[float, float]:
    """Usual time between two values of a force that is sent more often, s, and its change then (N); 0 where it is not.

    ``strain`` shows whether the specimen moves while the force is said to stand still; both on one clock.
    """
    force, strain = force.known(), strain.known()
    new = np.flatnonzero(np.diff(force.values)) + 1
    steps, lines = np.abs(force.values[new] - force.values[new - 1]), np.diff(new)
    apart = np.concatenate([np.diff(np.sort(one)) for one in (force.values, steps)])
    digits = apart[apart > _ROUNDING * np.abs(force.values).max(initial=0.0)]
    if len(new) <= _VALUES or not len(digits):
        return 0.0, 0.0
    large = steps > _DIGITS * digits.min()
    runs = lines[large[:-1] & large[1:]]
    if len(runs) < _VALUES:
        return 0.0, 0.0
    usual = float(np.median(runs))
    alike = np.mean(np.abs(runs - usual) <= max(1.0, _LONG * usual)) >= _ALIKE
    if usual < _LINES or not alike or not _moves(force, strain, new):
        return 0.0, 0.0
    return float(np.median(np.diff(force.t[new]))), float(np.median(steps[large]))


def _moves(force: Track, strain: Track, new: NDArray[np.intp]) -> bool:
    """Whether the strain goes the way of the force between instants that have the same value, too."""
    first, last = force.t[new[0]], force.t[new[-1]]
    inside = (strain.t >= first) & (strain.t <= last)
    t, moved = strain.t[inside], np.diff(strain.values[inside])
    way = np.sign(np.diff(np.interp(t, force.t[new], force.values[new])))
    changed = np.searchsorted(force.t[new - 1], t[1:]) > np.searchsorted(force.t[new], t[:-1])
    if changed.all():  # fewer pictures than values: a force seldom goes by so many steps so fast
        return bool((last - first) / len(new) < _FAST_S and len(np.unique(force.values)) > len(new) / 2)
    if not changed.any():
        return False
    return bool(np.mean((way * moved)[~changed]) > _MOVES * np.mean((way * moved)[changed]))
