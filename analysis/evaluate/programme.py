"""What was done to a specimen: pulled until it breaks, pressed, cycled, or held at a strain or a stress; and its creep.

Strengths and extensions are figures of a tensile test (ISO 6892-1:2019): of a stress that still rises. The elastic
line of another test is read from its first rise.

The creep of a test whose force is held is its strain rate, and when it reached a strain. About an instant of the hold,
with t the time since it began, the strain is by least squares e = a + b ln t + c t: logarithmic and steady creep (ISO
204:2018 calls them primary and secondary). The standard uncertainties are of the scatter about that, of single bursts
or of means of a twelfth, whichever is more.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from acquire.text import Message
from analysis.evaluate.curve import Curve, Floats, broken_at, noise, smoothed
from analysis.evaluate.figure import Figure

Kind = Literal["tensile", "compression", "cyclic", "relaxation", "creep"]
KINDS: tuple[Kind, ...] = get_args(Kind)
_NAMES = {
    "tensile": Message("a tensile test"),
    "compression": Message("a test in compression"),
    "cyclic": Message("a cyclic test"),
    "relaxation": Message("a hold of strain (relaxation)"),
    "creep": Message("a hold of stress (creep)"),
}

_NEGATIVE = Message(
    ": the force is negative; where the specimen is pulled its sign is wrong (--load-sign -1)"
)
_FEWEST = 8  # points that a course is judged by
_SURE = 6.0  # standard deviations of the noise
_REVERSAL = 0.2  # of the range of the stress: a smaller fall and rise is none
_PRESSED = 0.2  # of the highest stress: compression that is no part of a tensile test
_TENSION = 0.2  # of the largest compression: less tension is a zero of the force that is off
_GROWTH = 0.1  # of the depths of all unloadings: the strain of a cyclic test grows by less
_LOADED = 0.05  # of the highest stress: the loading has begun
_HELD_TIME, HELD = 0.5, 0.03
"""Share of the time from there on, and of the range, within which a value is held."""
_STILL_LOADED, _RELAXED = 0.2, 0.01  # of the highest stress: what a hold keeps, and loses
_SLOW = 0.8  # of the strain rate of the loading: a creep is slower


_FEWEST_IN_FIT, _MOST = 12, 3  # bursts of a fit; strains to which the times are given
_CLEAR = 5.0  # standard uncertainties
_ABOUT = 1.4  # of the time at which a strain is reached: the fit goes from that part of it to that multiple


@dataclass(frozen=True, slots=True)
class KindOfTest:
    """The kind of a test and its first rise.

    Attributes
    ----------
    kind : str
        One of ``KINDS``.
    words : str
        The kind and how it is known, for a person.
    end : int or None
        Row of the curve after which it rises no longer; None: to the break.
    """

    kind: Kind
    words: str
    end: int | None = None

    @classmethod
    def of(cls, curve: Curve, given: str = "auto") -> KindOfTest:
        """As ``given``, or found from the course of ``curve``."""
        found, how, end = _found(curve)
        if given == "auto":
            return cls(found, _NAMES[found] + how, None if found == "tensile" else end)
        kind = next(one for one in KINDS if one == given)
        return cls(
            kind, Message("{NAMES}, as given", _NAMES[kind]), end if kind == found != "tensile" else None
        )

    @property
    def why(self) -> str:
        """Why figures of a tensile test do not apply; empty where they do."""
        return (
            ""
            if self.kind == "tensile"
            else Message("this is {words}; [specimen] test = 'tensile' if it is none", self.words)
        )

    def first_rise(self, curve: Curve) -> Curve:
        """``curve`` up to the end of its first rise: without stresses after it."""
        if self.end is None:
            return curve
        return replace(curve, stress=np.where(np.arange(len(curve.t)) <= self.end, curve.stress, math.nan))


def _found(curve: Curve) -> tuple[Kind, str, int | None]:
    """The kind, how it is seen, and the row at which the first rise ends."""
    force = curve.stress[np.isfinite(curve.stress)]
    sigma = _noise(curve)
    if len(force) < _FEWEST or np.ptp(force) <= _SURE * 2 * sigma:
        return "tensile", "", None
    if force.max() <= max(_SURE * sigma, -_TENSION * force.min()):
        return "compression", _NEGATIVE, None
    stop = broken_at(curve.stress, curve.strain)
    both = np.isfinite(curve.strain) & np.isfinite(curve.stress)
    known = np.flatnonzero(both[: len(both) if stop is None else stop + 1])
    if len(known) < _FEWEST:
        return "tensile", "", None
    t, strain, stress = (values[known] for values in (curve.t, curve.strain, curve.stress))
    turns = reversals(stress, max(_REVERSAL * float(np.ptp(stress)), _SURE * sigma))
    middle = float(stress[turns].mean()) if turns else 0.0
    peaks = [k for k in turns if stress[k] > 0 and stress[k] >= middle]
    if peaks and _is_cyclic(strain, stress, turns, peaks[0]):
        return "cyclic", Message(", whose stress turns round {count} times", len(turns)), int(known[peaks[0]])
    held = _hold(t, strain, stress)
    if held is None:
        return "tensile", "", None
    kind, since = held
    return kind, Message(" from {t:.4g} s on", t[since]), int(known[since])


def _noise(curve: Curve) -> float:
    """Noise of the stress, Pa: what follows the strain is none, of a few samples a cycle either."""
    both = np.isfinite(curve.strain) & np.isfinite(curve.stress)
    strain, stress = curve.strain[both], curve.stress[both]
    sigma = noise(curve.stress)
    if len(stress) < _FEWEST or not (np.ptp(strain) > 0 and np.ptp(stress) > 0):
        return sigma
    alone = math.sqrt(max(1 - float(np.corrcoef(strain, stress)[0, 1]) ** 2, 0.0))
    return min(sigma, alone * float(stress.std()))


def reversals(values: Floats, least: float) -> list[int]:
    """Where ``values`` turn round, each time to go back by at least ``least``: highest and lowest in turns."""
    found: list[int] = []
    start, sign = 0, 0
    while True:
        tried = (sign,) if sign else (1, -1)
        sides = [(end, side) for side in tried if (end := _turned(values, side, start, least))]
        if not sides:
            return found
        end, side = min(sides)
        if sign:
            k = end - int(np.argmax(side * values[start : end + 1][::-1]))
            found.append(k)
        start, sign = end, -side


def _turned(values: Floats, side: int, start: int, least: float) -> int:
    """Where ``side`` (1, -1) times ``values`` first falls by ``least`` from its highest since ``start``; 0: nowhere."""
    top, size = -math.inf, 64
    while start < len(values):
        part = side * values[start : start + size]
        highest = np.fmax(np.fmax.accumulate(part), top)
        fallen = np.flatnonzero(highest - part >= least)
        if len(fallen):
            return start + int(fallen[0])
        start, size, top = start + size, 2 * size, highest[-1]
    return 0


def _is_cyclic(strain: Floats, stress: Floats, turns: list[int], first: int) -> bool:
    """Whether the stress goes to compression, or the strain comes back to where it was, load for load.

    Unloadings of a tensile test are short beside the strain that comes after the first of them.
    """
    if stress[first:].min() < -_PRESSED * stress.max():
        return True
    depths = [strain[a] - strain[b] for a, b in itertools.pairwise(turns) if stress[a] > stress[b]]
    depths += [strain[turns[-1]] - strain[-1]] if stress[turns[-1]] > stress[-1] else []
    growth = float(strain[first:].max() - strain[first])
    return len(depths) > 1 and growth < _GROWTH * sum(depths)


def _hold(t: Floats, strain: Floats, stress: Floats) -> tuple[Kind, int] | None:
    """What is held until the unloading or the end, and since when; None where it is no hold, or a short one."""
    top = float(stress.max())
    start = int(np.argmax(stress >= _LOADED * top))
    for kind, whole, others in (("relaxation", strain, stress), ("creep", stress, strain)):
        tolerance = max(HELD * float(np.ptp(whole)), _SURE * noise(whole))
        end = _until(strain, stress, whole, tolerance, start)
        values, other = whole[:end], others[:end]
        off = np.flatnonzero(np.abs(values - float(np.median(values[-5:]))) > tolerance)
        since = min(int(off[-1]) + 1, end - 1) if len(off) else start
        held = float(t[end - 1] - t[since])
        if held < _HELD_TIME * (t[end - 1] - t[start]) or stress[end - 1] < _STILL_LOADED * top:
            continue
        level = smoothed(other, 2)
        gone, before = float(level[-1] - level[since]), float(level[since] - level[start])
        if kind == "relaxation" and level[since:].max() - level[-1] > max(
            _RELAXED * top, _SURE * noise(stress)
        ):
            return "relaxation", since
        slow = gone * (t[since] - t[start]) < _SLOW * before * held
        if kind == "creep" and slow:
            return "creep", since
    return None


def _until(strain: Floats, stress: Floats, held: Floats, tolerance: float, start: int) -> int:
    """The number of samples without an unloading that follows a hold: what was ``held`` most of the time is left."""
    loaded = np.flatnonzero(stress >= _STILL_LOADED * stress.max())
    usual = float(np.median(held[start : loaded[-1] + 1]))
    near = np.flatnonzero(np.abs(held - usual) <= tolerance)
    end = int(near[-1]) + 1 if len(near) else len(held)
    lower = all(values[end:].max(initial=-math.inf) < values[:end].max() for values in (strain, stress))
    return end if lower and end > start + 5 else len(held)


@dataclass(frozen=True, slots=True, eq=False)
class Creep:
    """A hold of the force.

    Attributes
    ----------
    since : float, s
        Its beginning, on the clock of the curve.
    load : float
        The force or stress that is held, in the unit of the curve: the median.
    t, strain : (K,) float64
        Time since then (s), and strain.
    rate : Figure, 1/s
        Mean over the last half of the hold.
    times : tuple of (float, Figure)
        Round strains that were passed, and when, s since the beginning of the hold.
    """

    since: float
    load: float
    t: Floats
    strain: Floats
    rate: Figure
    times: tuple[tuple[float, Figure], ...]

    @classmethod
    def of(cls, curve: Curve, test: str = "auto") -> Creep | None:
        """The creep of a test; None where its force is not held, or it is another ``test``."""
        kind = KindOfTest.of(curve, test)
        if kind.kind != "creep" or kind.end is None:
            return None
        load, t = curve.stress, curve.t - curve.t[kind.end]
        level = float(np.nanmedian(load[kind.end :]))
        rows = (np.abs(load - level) <= HELD * abs(level)) & np.isfinite(curve.strain) & (t > 0)
        t, strain = t[rows], curve.strain[rows]
        hold = _Hold(t, strain)
        return cls(float(curve.t[kind.end]), level, t, strain, hold.rate(), tuple(hold.times()))


class _Hold:
    """Times since the beginning of a hold, and its strains."""

    def __init__(self, t: Floats, strain: Floats) -> None:
        self.t, self.strain = t, strain

    def _fit(self, low: float, high: float) -> tuple[Floats, Floats] | None:
        """Coefficients over 1, ln t and t, t as a share of ``high``, and their covariance; None of a few bursts."""
        part = (self.t >= low) & (self.t <= high)
        if np.count_nonzero(part) < _FEWEST_IN_FIT:
            return None
        design, strain = _design(self.t[part] / high), self.strain[part]
        inverse = np.linalg.pinv(design.T @ design, hermitian=True)
        found = inverse @ design.T @ strain
        rest = strain - design @ found
        # What neighbours have in common, of a creep of another law or of a drift, averages out by its means alone.
        common = sum(part.sum() ** 2 / len(part) for part in np.array_split(rest, _FEWEST_IN_FIT)) / (
            _FEWEST_IN_FIT - 3
        )
        return found, inverse * max(np.sum(rest**2) / (len(strain) - 3), common)

    def rate(self) -> Figure:
        end = float(self.t[-1]) if len(self.t) else math.nan
        fit = self._fit(end / 2, end)
        if fit is None:
            return Figure.none(
                Message("{least} bursts in the last half of the hold are needed", _FEWEST_IN_FIT)
            )
        along = (_design(np.ones(1)) - _design(np.full(1, 0.5)))[0] / (end / 2)
        return Figure.about(float(along @ fit[0]), math.sqrt(along @ fit[1] @ along))

    def _moves(self) -> bool:
        """Whether the last tenth of the strains is clearly off the first."""
        n = len(self.strain) // 10
        if not n:
            return False
        return bool(
            abs(np.mean(self.strain[-n:]) - np.mean(self.strain[:n])) > _CLEAR * noise(self.strain) / n**0.5
        )

    def times(self) -> list[tuple[float, Figure]]:
        course = smoothed(self.strain, max(1, len(self.strain) // 200))
        found = []
        for mark in _round_between(float(course[0]), float(course[-1])) if self._moves() else ():
            above = course >= mark if course[-1] > course[0] else course <= mark
            at = float(self.t[np.argmax(above)])
            for _ in range(3):  # the fit moves with the instant that it gives
                fit = self._fit(at / _ABOUT, at * _ABOUT)
                if fit is None:
                    break
                here, unit = _design(np.array([1 / _ABOUT]))[0], at * _ABOUT
                slope = float(fit[0] @ [0.0, _ABOUT, 1.0]) / unit
                sigma = math.sqrt(here @ fit[1] @ here) / abs(slope) if slope else math.inf
                step = (mark - float(here @ fit[0])) / slope if slope else math.inf
                if not sigma + abs(step) < at / 4:  # the strain does not move clearly
                    break
                at += step
            else:
                found.append((mark, Figure.about(at, sigma)))
        return found


def _design(t: Floats) -> Floats:
    return np.stack([np.ones_like(t), np.log(t), t], axis=-1)


def _round_between(first: float, last: float) -> list[float]:
    """At most ``_MOST`` round strains between two."""
    low, high = sorted((first, last))
    if not high > low:
        return []
    size = 10 ** math.floor(math.log10((high - low) / _MOST))
    for step in (size, 2 * size, 5 * size, 10 * size):
        numbers = range(math.floor(low / step) + 1, math.ceil(high / step))
        if len(numbers) <= _MOST:
            return [float(f"{step * n:.6g}") for n in (numbers if last > first else reversed(numbers))]
    return []
