"""What each place does over all instants of a test: a line by sums that add up, and where it leaves its line.

The straight line y = a + b x of each place through all instants, from sums that add up.

Weights are 1 / sigma^2. What is common to all instants measured against one reference, such as its noise, is in the
intercept of that reference and not in the slope. Where x has noise too, the slope is that of the moments without it
(W. A. Fuller, Measurement Error Models, 1987, doi:10.1002/9780470316665, sections 1.2 and 1.3).

Where each place leaves its line: local yield, first cracks, debonding, in the order in which places give in.

The mean of ``WINDOW`` instants, of a thirtieth of them where there are many, is held against the line of all before.
The limit is that of a normal deviate which all looks together pass at ``CHANCE`` of the places; it is never below
``LIMIT``.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
MIN_INSTANTS = 3
"""Beyond the intercepts, that a line needs to have a chi2."""
_CLEAR = 5.0  # standard deviations of the noise that x must move by, in the sum of its squares


@dataclass(frozen=True, slots=True, eq=False)
class ResponseSums:
    """The state: nine sums a place and reference. Two parts of a test add up.

    Attributes
    ----------
    parts : mapping of int to (9, ...) float64
        By number of the reference: instants, then sums of w, w x, w y, w x^2, w x y, w y^2, and of w times the
        variance of x and the covariance of the noises.
    """

    parts: Mapping[int, Floats] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        x: ArrayLike,
        y: Floats,
        sigma: Floats,
        reference: int = 0,
        sigma_x: ArrayLike = 0.0,
        covariance: ArrayLike = 0.0,
    ) -> ResponseSums:
        """One instant.

        Parameters
        ----------
        x : float or (...)
            Of all places, or of each.
        y, sigma : (...) float64
            Value of each place, and its standard uncertainty without the noise of the reference. A place whose value
            is not finite, or whose sigma is not above 0, has no weight.
        reference : int
            What it was measured against; each has an intercept of its own.
        sigma_x, covariance : float or (...)
            Noise of x, and covariance of the noises of x and y, both without that of the reference.
        """
        x, y, sigma, sigma_x, covariance = np.broadcast_arrays(x, y, sigma, sigma_x, covariance)
        known = np.isfinite(x) & np.isfinite(y) & (sigma > 0) & np.isfinite(sigma + sigma_x + covariance)
        w = np.zeros(y.shape)
        np.divide(1.0, np.square(sigma), out=w, where=known)
        x, y, vx, both = (np.where(known, v, 0.0) for v in (x, y, np.square(sigma_x), covariance))
        return cls(
            {reference: np.stack([known, w, w * x, w * y, w * x * x, w * x * y, w * y * y, w * vx, w * both])}
        )

    def __add__(self, other: ResponseSums) -> ResponseSums:
        both = dict(self.parts)
        for reference, sums in other.parts.items():
            both[reference] = both[reference] + sums if reference in both else sums
        return ResponseSums(both)

    def lines(self) -> ResponseLines:
        """The line of each place; NaN where its instants do not give one."""
        n, refs, sxx, sxy, syy, vx, vxy = (np.zeros(()) for _ in range(7))
        middles = {}
        with np.errstate(divide="ignore", invalid="ignore"):
            for reference, (m, w, x, y, xx, xy, yy, noise, both) in self.parts.items():
                here = m > 0
                middles[reference] = (w, np.where(here, x / w, np.nan), np.where(here, y / w, np.nan))
                n, refs, vx, vxy = n + m, refs + here, vx + noise, vxy + both
                sxx = sxx + np.where(here, xx - x * x / w, 0.0)
                sxy = sxy + np.where(here, xy - x * y / w, 0.0)
                syy = syy + np.where(here, yy - y * y / w, 0.0)
            free = np.asarray(n - refs)
            # Noise of x and the covariance over the variance of y, of a typical instant.
            r, c = vx / n, vxy / n
            clean = sxx - free * r
            known = (free >= MIN_INSTANTS) & (clean > _CLEAR * r * np.sqrt(2.0 * np.maximum(free, 0)))
            clean = np.where(known & (clean > 0), clean, np.nan)
            slope = (sxy - free * c) / clean
            beyond = 1 + slope * slope * r - 2 * slope * c
            variance = (sxx * beyond + free * (c - slope * r) ** 2) / clean**2
            left = syy - 2 * slope * sxy + slope * slope * sxx
            chi2 = left / (beyond * (free - 1))
        return ResponseLines(slope, np.sqrt(variance), chi2, np.asarray(n), middles)


@dataclass(frozen=True, slots=True, eq=False)
class ResponseLines:
    """The line of each place.

    Attributes
    ----------
    slope, sigma : (...) float64
        In y over x, and its standard uncertainty: of the noise that differs from instant to instant alone.
    chi2 : (...) float64
        What is left over what noise leaves, by the degree of freedom; about 1 where y is in proportion.
    n : (...) float64
        Instants with weight.
    middles : mapping of int to (w, x, y)
        By reference: sum of the weights, and means of x and y.
    """

    slope: Floats
    sigma: Floats
    chi2: Floats
    n: Floats
    middles: Mapping[int, tuple[Floats, Floats, Floats]]

    def intercept(self, reference: int = 0) -> Floats:
        """y where x is 0, against one reference; NaN where no instant has weight."""
        _, x, y = self.middles[reference]
        return np.asarray(y - self.slope * x)

    def at(self, x: float, reference: int = 0) -> tuple[Floats, Floats]:
        """y of the line at ``x`` and its variance; NaN where the reference has no instant."""
        if reference not in self.middles:
            nothing = np.full(np.shape(self.slope), np.nan)
            return nothing, nothing
        w, middle, y = self.middles[reference]
        with np.errstate(divide="ignore", invalid="ignore"):
            return y + self.slope * (x - middle), 1 / w + (self.sigma * (x - middle)) ** 2


FIRST, WINDOW, LIMIT = 20, 5, 4.5
"""Instants before the first look; instants of a look, at least; standard deviations, at least."""
CHANCE = 5e-5
MANY = 0.05
"""Share of the places that leave at once, from which on what all have in common is looked at."""
NOT_USED = -1
_STEP, _CLEAR_OF_NOISE, _FEWEST, _PARTS, _WIDEST = 0.7, 6.0, 3, 30, 50


@dataclass(frozen=True, slots=True, eq=False)
class _Instant:
    number: int
    x: float
    y: Floats
    sigma: Floats
    noise: tuple[float, float]


class Departures:
    """Takes the instants of a rising load, one after the other.

    A step that most places have in common (light, a slip in the grips) is no departure: the places have another
    intercept from there on, and an instant that alone is off is left out. A place without a value is lost, which is
    no departure either.

    Parameters
    ----------
    shape : tuple of int
        Of the places.
    looks : int
        Instants that will come, as far as they are known.

    Attributes
    ----------
    at : (...) float64
        x where the place left its line; NaN where it did not.
    seen : (...) bool
        It had a value in the last instants.
    sums : ResponseSums
        Of the line of each place, from the instants before the last look.
    window : int
        Instants of a look.
    segments : list of int
        For each instant, the intercept that it belongs to; ``NOT_USED`` where it was left out.
    """

    def __init__(self, shape: tuple[int, ...], looks: int = 1000) -> None:
        self.at = np.full(shape, np.nan)
        self.seen = np.zeros(shape, np.bool_)
        self.segments: list[int] = []
        self.window = min(max(WINDOW, looks // _PARTS), _WIDEST)
        self.limit = max(LIMIT, NormalDist().inv_cdf(1 - CHANCE / max(looks, 1) / 2))
        self._when = np.zeros(shape, np.intp)  # the instant at which it was found
        self.sums = ResponseSums()
        self._held: deque[_Instant] = deque()
        self._segment, self._reference = 0, 0
        # Of what all have in common in the line: sum of squares, instants, the last.
        self._usual = 0.0, 0, 0.0

    def add(
        self, x: float, y: Floats, sigma: Floats, reference: int = 0, noise: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        """One instant; parameters as ``ResponseSums.of``, ``noise`` its last two."""
        if reference != self._reference:
            while self._held:
                self._absorb(None)
            self._segment, self._reference = self._segment + 1, reference
        self.segments.append(self._segment)
        self._held.append(_Instant(len(self.segments) - 1, x, y, sigma, noise))
        self.seen = np.any([np.isfinite(one.y) for one in self._held], axis=0)
        if len(self._held) < self.window:
            return
        lines = self.sums.lines() if len(self.segments) > FIRST + self.window - 1 else None
        if lines is None or self._look(lines):
            self._absorb(lines)

    def _absorb(self, lines: ResponseLines | None) -> None:
        """The oldest of the held instants becomes one of the line, at places that have not left it."""
        one = self._held.popleft()
        off = np.nan if lines is None else self._off(lines, one)
        if np.isfinite(off):
            self._usual = self._usual[0] + off**2, self._usual[1] + 1, off
        on = np.where(np.isnan(self.at), one.y, np.nan)
        self.sums += ResponseSums.of(one.x, on, one.sigma, self.segments[one.number], *one.noise)

    def _look(self, lines: ResponseLines) -> bool:
        """Judge the held instants; whether the oldest of them may become one of the line."""
        x = float(np.mean([one.x for one in self._held]))
        y = np.mean([one.y for one in self._held], axis=0)
        noise = np.sum([one.sigma**2 for one in self._held], axis=0) / self.window**2
        expected, variance = lines.at(x, self._segment)
        chi2 = lines.chi2[np.isfinite(lines.chi2)]
        # Noise that was stated too small, of all places alike.
        scale = max(1.0, float(np.median(chi2))) if chi2.size else 1.0
        z = np.where(np.isnan(self.at) & (lines.n >= FIRST), y - expected, np.nan)
        z /= np.sqrt(scale * (noise + variance))
        out = np.abs(z) > self.limit
        if np.count_nonzero(out) >= max(MANY * np.count_nonzero(np.isfinite(z)), _FEWEST):
            fate = self._fate(np.array([self._off(lines, one) for one in self._held]))
            if fate:  # the first to pass the limit did so by it
                self.at[self._when > len(self.segments) - self.window] = np.nan
            if fate == "off":
                self.segments[self._held.popleft().number] = NOT_USED
                return False
            if fate == "step":
                self._segment += 1
                for one in self._held:
                    self.segments[one.number] = self._segment
            if fate:
                return True
        self.at[out], self._when[out] = self._held[0].x, len(self.segments)
        return True

    def _off(self, lines: ResponseLines, one: _Instant) -> float:
        """What the places have in common beyond their lines at an instant: the median."""
        off = (one.y - lines.at(one.x, self.segments[one.number])[0])[np.isnan(self.at)]
        off = off[np.isfinite(off)]
        return float(np.median(off)) if off.size else np.nan

    def _fate(self, common: Floats) -> str:
        """What the held instants have in common: a step, of which one is "off" alone, one to wait for, or none."""
        largest = float(np.max(np.abs(common)))
        usual = (self._usual[0] / max(self._usual[1], 1)) ** 0.5
        first = int(np.argmax(np.abs(common) > largest / 2))
        step = abs(common[first] - (common[first - 1] if first else self._usual[2]))
        if not (step > _STEP * largest and largest > _CLEAR_OF_NOISE * usual):
            return ""
        if first > 0:
            return "wait"
        return "step" if abs(common[-1]) > largest / 2 else "off"
