"""The cycles of a load one after the other, and the loop that the strain makes in each.

A cycle of duration T lies about the middle t0 of its upper half. With theta = 2 pi (t - t0) / T, and s the load from -1
at its lowest to 1 at its highest, the strains of the bursts in it are, by least squares,

    e = a + d theta / (2 pi) + b s + c h + b2 s^2 + b3 s^3,    h = sqrt(1 - s^2), negative while the load rises,

square and cube with ``CURVED`` bursts or more. h is sin(theta) of a sine, and 0 while a load is held at its peak; where
less than a quarter of the bursts lie between the levels, the load jumps: there is no h, no area and no phase. d is the
drift over the cycle. Both sides are averaged over the time of a burst, so that a long one makes no modulus too high.
The strain is the noisier of the two and is therefore what is fitted: in a line of stress over strain the variance
sigma^2 of a strain would make the modulus too low by sigma^2 / var(e), 2 % at 50 um/m in a range of 1000. Between peak
and valley, s = 1 and -1, the strain changes by 2 (b + b3):

    secant modulus   E = (S_max - S_min) / (2 (b + b3)),
    area of the loop W = closed integral of S de = c times that of S dh,
    phase            delta = arg(S_1) - arg(e_1) of the first harmonics, positive where the strain comes later.

What is a function of s alone encloses no area. A load that comes late by tau beside the pictures is in delta as
-2 pi tau / T, and in W. Standard uncertainties are of the scatter about the fit, as half the interval of 68.3 %
(Student's t).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquire.text import Message
from analysis.evaluate.curve import noise
from analysis.evaluate.lag import Track

Floats = NDArray[np.float64]
MIN_BURSTS, CURVED = 6, 12
"""Bursts in a cycle that its figures need, and with which its loop may bend."""
MIN_READINGS = 16
"""Readings in a cycle: of a triangle they see at least nine tenths of the range, of a sine all."""
_GRID = 128  # places of a cycle
_U = np.arange(_GRID) / _GRID - 0.5
_COSINE, _SINE = (2 / _GRID * wave(2 * np.pi * _U) for wave in (np.cos, np.sin))
_LONGEST = 0.25  # of a cycle: a burst
_SEEN = 0.7  # of the range of the load: what the bursts see of it
_SURE, _WHOLE = 3.0, 0.98  # standard deviations of the noise; of its range: what is seen of a whole cycle
_HELD = _HIDDEN = 0.05  # of a cycle: equal highest readings; of its strains: those in that time
_BETWEEN, _FEWEST = 0.8, 4  # of the half range, and bursts within: those that a bend is seen by
_CLEAR = 3.0  # standard uncertainties of a strain that follows the load
_ONE_SIGMA = 0.8413447460685429  # of a normal distribution lies below 1


class BurstStrains(NamedTuple):
    """Strains of bursts, (N,) each: times (s), strains, and over which time each is a mean (s)."""

    t: Floats
    strain: Floats
    width: Floats

    def part(self, chosen: Any) -> BurstStrains:
        """Those that are chosen."""
        return BurstStrains(*(values[chosen] for values in self))


class Waves:
    """A channel in cycles, between its readings by a cubic spline.

    Parameters
    ----------
    track : Track
        Times increase.
    middle, duration : (K,) float64, s
        Of the cycles.
    sigma : float
        Noise of one reading.
    least : (K,) float64
        Range that a whole cycle has at least.

    Attributes
    ----------
    size : (K,) float64
        Range of the readings, with one beyond on either side.
    values : (K, 128) float64
        At even places of each cycle.
    peak, valley, sigma_range : (K,) float64
        NaN where the readings are too few.
    n : (K,) int
        Readings.
    sharp : (K,) float64
        Standard uncertainty of the range over it, of tips that lie between readings.
    held : (K,) float64
        Share of them that are equal to the highest: of a load cell at its limit, or of a load that is held.
    """

    def __init__(
        self, track: Track, middle: Floats, duration: Floats, sigma: float, least: Floats | float = 0.0
    ) -> None:
        from scipy.interpolate import CubicSpline

        t, first = np.unique(track.t, return_index=True)
        self.middle, self.duration, y = middle, duration, track.values[first]
        since, until = (np.searchsorted(t, middle + side * duration / 2) for side in (-1, 1))
        self.n, wider = until - since, (np.maximum(since - 1, 0), np.minimum(until + 1, len(t)))
        highest, lowest = (side * _highest(side * y, *wider) for side in (1, -1))
        gap = _highest(np.diff(t, prepend=t[0]), since, wider[1])
        self.size, self.least = np.maximum(highest - lowest, 1e-3 * np.asarray(least)), least + 0 * duration
        parts = zip(since, until, highest, strict=True)
        self.held = np.array([np.mean(y[a:b] == top) if b > a else 0.0 for a, b, top in parts])
        self._origin, self._end = t[0], t[-1]
        self._sum = CubicSpline(t - t[0], y).antiderivative()
        self.values = self.mean(np.arange(len(middle))[:, None], _U, 1 / _GRID)
        self._gap, self._seen = gap / duration, (highest - lowest + _SURE * sigma) / np.maximum(least, 1e-300)
        known = [not one for one in self.why]
        self.peak, self.valley = (
            np.where(known, one(self.values, axis=1), np.nan) for one in (np.max, np.min)
        )
        half, tips = (self.peak - self.valley) / 2, self._sharp(self.values) + self._sharp(-self.values)
        between = half * (1 - np.cos(np.pi / np.maximum(self.n, 1))) / math.sqrt(3)
        self.sigma_range = np.hypot(np.hypot(math.sqrt(2) * sigma, between), tips / 2)
        self.sharp = tips / (4 * half)

    def mean(self, k: Any, u: Floats, width: Floats | float) -> Floats:
        """Means over ``width`` about the places ``u`` of the cycles ``k``, both in cycles."""
        middle, duration, least = self.middle[k] - self._origin, self.duration[k], 1e-6
        last = self._end - self._origin
        low, high = (middle + duration * (u + side * (width / 2 + least)) for side in (-1, 1))
        low, high = np.clip(low, 0, last - least * duration), np.clip(high, least * duration, last)
        return np.asarray((self._sum(high) - self._sum(low)) / (high - low))

    def _sharp(self, values: Floats) -> Floats:
        """By how much the highest value exceeds those one reading beside it, beyond what it does in a sine, (K,)."""
        k, step = np.arange(len(values)), np.maximum(_GRID // np.maximum(self.n, 1), 1)
        top = values.argmax(axis=1)
        beside = (values[k, (top - step) % _GRID] + values[k, (top + step) % _GRID]) / 2
        sine = np.ptp(values, axis=1) / 2 * (1 - np.cos(2 * np.pi * step / _GRID))
        return np.asarray(np.maximum(values[k, top] - beside - sine, 0))

    @property
    def why(self) -> list[str]:
        """Why peak and valley are not known, for each; empty where they are."""
        found: list[str] = []
        for n, gap, seen in zip(self.n, self._gap, self._seen, strict=True):
            if n < MIN_READINGS:
                found.append(Message("{n} readings in the cycle, {least} are needed", n, MIN_READINGS))
            elif gap > 2 / MIN_READINGS:
                found.append(Message("no reading of the load for {share:.0%} of the cycle", gap))
            else:
                found.append(
                    ""
                    if seen > _WHOLE
                    else Message("a cycle of another length: {share:.0%} of its range is seen", seen)
                )
        return found


def _highest(values: Floats, since: NDArray[np.intp], until: NDArray[np.intp]) -> Floats:
    """The highest of the values in each part, (K,)."""
    parts = np.column_stack([since, until]).ravel()
    return np.asarray(np.maximum.reduceat(np.append(values, values[-1]), parts)[::2])


@dataclass(frozen=True, slots=True, eq=False)
class Loops:
    """The strain of K cycles against their load.

    Attributes
    ----------
    bursts : (K,) int
    figures : (9, K) float64
        NaN where they are not known: peak, valley and sigma of the range of the strain, without the drift over the
        cycle; modulus and its sigma (Pa, the unit of the load); area and its sigma (J/m^3, N where the load is a
        force): the energy that the cycle leaves in the volume; phase and its sigma (rad), by which the strain comes
        later.
    why : list of str
        Why they are not; empty where they are.
    """

    bursts: NDArray[np.intp]
    figures: Floats
    why: list[str]

    @classmethod
    def of_strain(cls, waves: Waves) -> Loops:
        """Where the strain itself is the channel: its ranges alone."""
        figures = np.full((9, len(waves.n)), np.nan)
        figures[:3] = waves.peak, waves.valley, waves.sigma_range
        return cls(waves.n, figures, [one or Message("no force is known") for one in waves.why])

    @classmethod
    def of(cls, waves: Waves, bursts: BurstStrains) -> Loops:
        """Loops of the bursts in cycles of the load; their times increase."""
        first, last = (
            np.searchsorted(bursts.t, waves.middle + side * waves.duration / 2) for side in (-1, 1)
        )
        n, why = last - first, waves.why
        found = np.full((9, len(n)), np.nan)
        few = "{n} bursts in the cycle do not reach its peaks (aliasing); {least} are needed"
        why = [
            one or (Message(few, k, MIN_BURSTS) if k < MIN_BURSTS else "")
            for one, k in zip(why, n, strict=True)
        ]
        of = np.flatnonzero([not one for one in why])
        if len(of):
            at = np.concatenate([np.arange(a, b) for a, b in zip(first[of], last[of], strict=True)])
            fits = _Fits(waves, of, n[of], bursts.part(at))
            found[:, of] = np.where([not one for one in fits.why], fits.figures(), np.nan)
            for k, words in zip(of, fits.why, strict=True):
                why[k] = words
        return cls(n, found, why)


class _Fits:
    """The strains of K cycles ``of`` waves as functions of their load, each of ``n`` bursts; see the module."""

    def __init__(self, waves: Waves, of: NDArray[np.intp], n: NDArray[np.intp], bursts: BurstStrains) -> None:
        from scipy.special import stdtrit

        each, start = np.repeat(np.arange(len(of)), n), np.cumsum(n) - n
        self._half, self._sharp = (waves.peak[of] - waves.valley[of]) / 2, waves.sharp[of]
        self._mean, self._load = (waves.peak[of] + waves.valley[of]) / 2, waves.values[of]
        u, width = ((bursts.t - waves.middle[of][each]), bursts.width) / waves.duration[of][each]
        s = self._shape(waves.mean(of[each], u, width), each)
        between = np.add.reduceat(np.abs(s) < _BETWEEN, start, dtype=int)
        self._curved, self._jumps = (n >= CURVED) & (between >= _FEWEST), between < n / 4
        self._turns = np.where(self._jumps[:, None], 0.0, _turned(self._shape(self._load)))
        design = _design(u, s, _means(self._turns, each, u, width), self._curved[each])
        self._longest = np.maximum.reduceat(width, start)
        self._seen = (np.maximum.reduceat(s, start) - np.minimum.reduceat(s, start)) / 2
        normal = np.add.reduceat(design[:, :, None] * design[:, None, :], start)
        size, axes = np.linalg.eigh(normal)
        # A load of two levels has a square that is constant: what can be told all the same is told.
        told = size > 1e-9 * size[:, -1:]
        self._inverse = (axes * np.where(told, 1 / np.where(told, size, 1), 0)[:, None]) @ axes.transpose(
            0, 2, 1
        )
        moments = np.add.reduceat(design * bursts.strain[:, None], start)
        self._found = np.einsum("kij,kj->ki", self._inverse, moments)
        rest = bursts.strain - np.einsum("ni,ni->n", design, self._found[each])
        free = n - np.count_nonzero(told, axis=1)
        self._scatter = np.sqrt(np.add.reduceat(rest**2, start) / free) * stdtrit(free, _ONE_SIGMA)
        held = (waves.held[of] > _HELD)[each] & (np.abs(u) < waves.held[of][each] / 2)
        part, whole = (
            np.fmax.reduceat(strain, start) - np.fmin.reduceat(strain, start)
            for strain in (np.where(held, bursts.strain, math.nan), bursts.strain)
        )
        moved = part > 2 * _CLEAR * noise(bursts.strain, 4)
        self._hidden = np.divide(part, whole, out=np.zeros(len(of)), where=moved)
        self._tips = np.zeros((len(of), 6))
        self._tips[:, 2], self._tips[:, 5] = 1, self._curved

    @property
    def why(self) -> list[str]:
        """Why there are no figures, for each; empty where there are."""
        strain, sigma = self._value(self._tips)
        found: list[str] = []
        for longest, seen, hidden, clear in zip(
            self._longest, self._seen, self._hidden, abs(strain) >= _CLEAR * sigma, strict=True
        ):
            if longest > _LONGEST:
                found.append(Message("a burst lasts {share:.0%} of the cycle", longest))
            elif seen < _SEEN:
                found.append(Message("the bursts see {share:.0%} of the range of the load", seen))
            elif hidden > _HIDDEN:
                found.append(
                    Message(
                        "the load stands at its highest over {share:.0%} of the strains: a load cell at its limit",
                        hidden,
                    )
                )
            else:
                found.append("" if clear else Message("the strain does not follow the load"))
        return found

    def figures(self) -> Floats:
        """Those of ``Loops``, (9, K)."""
        half, sigma = self._value(self._tips)
        modulus = self._half / half
        course = _design(_U, self._shape(self._load), self._turns, self._curved[:, None])
        course[:, :, 1] = 0  # without the drift
        strain, k = np.einsum("kgi,ki->kg", course, self._found), np.arange(len(half))
        top, low = course[k, strain.argmax(axis=1)], course[k, strain.argmin(axis=1)]
        ends = strain.max(axis=1), strain.min(axis=1)
        sigma_range = np.hypot(self._value(top - low)[1], self._sharp * (ends[0] - ends[1]))
        return np.array(
            [*ends, sigma_range, modulus, abs(modulus / half) * sigma, *self._first_harmonic(course)]
        )

    def _first_harmonic(self, course: Floats) -> tuple[Floats, ...]:
        """Area of the loop and phase, each with its standard uncertainty."""
        along, across = (np.einsum("g,kgi->ki", wave, course) for wave in (_COSINE, _SINE))
        in_phase, behind = self._value(along)[0], self._value(across)[0]
        late = np.arctan2(behind, in_phase) - np.arctan2(self._load @ _SINE, self._load @ _COSINE)
        turn = (in_phase[:, None] * across - behind[:, None] * along) / (in_phase**2 + behind**2)[:, None]
        steps = np.roll(self._turns, -1, axis=1) - np.roll(self._turns, 1, axis=1)
        area = self._value(np.sum(self._load * steps, axis=1, keepdims=True) / 2 * np.eye(6)[3])
        loop = *area, (late + np.pi) % (2 * np.pi) - np.pi, self._value(turn)[1]
        return tuple(np.where(self._jumps, np.nan, one) for one in loop)

    def _shape(self, load: Floats, each: Any = np.s_[:, None]) -> Floats:
        return np.asarray((load - self._mean[each]) / self._half[each])

    def _value(self, along: Floats) -> tuple[Floats, Floats]:
        """Sums of the coefficients, (K,), and their standard uncertainties."""
        variance = np.einsum("ki,kij,kj->k", along, self._inverse, along)
        return np.einsum("ki,ki->k", along, self._found), self._scatter * np.sqrt(np.maximum(variance, 0))


def _turned(s: Floats) -> Floats:
    """h of loads from -1 to 1 at even places of K cycles, (K, 128)."""
    top, low = s.argmax(axis=1)[:, None], s.argmin(axis=1)[:, None]
    rises = (np.arange(_GRID) - low) % _GRID < (top - low) % _GRID
    return np.where(rises, -1.0, 1.0) * np.sqrt(np.maximum(1 - s**2, 0))


def _means(values: Floats, each: NDArray[np.intp], u: Floats, width: Floats) -> Floats:
    """Of cycles that repeat themselves: means of the rows ``each`` over ``width``, a place at least, about ``u``."""
    sums = np.pad(np.cumsum(values, axis=1), ((0, 0), (1, 0)))
    width = np.maximum(width * _GRID, 1)

    def until(x: Floats) -> Floats:
        turns, x = np.divmod(x, _GRID)
        i = x.astype(np.intp)
        return np.asarray(turns * sums[each, -1] + sums[each, i] + (x - i) * values[each, i])

    middle = (u + 0.5) * _GRID + 0.5
    return (until(middle + width / 2) - until(middle - width / 2)) / width


def _design(u: Floats, s: Floats, turns: Floats, curved: NDArray[np.bool_]) -> Floats:
    """The columns of the fit, (..., 6); square and cube are 0 where they are not ``curved``."""
    bent = np.where(curved, 1.0, 0.0)
    columns = (np.ones(s.shape), u, s, turns, s**2 * bent, s**3 * bent)
    return np.stack(np.broadcast_arrays(*columns), axis=-1)
