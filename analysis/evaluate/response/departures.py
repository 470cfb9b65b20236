"""Where each place leaves its line: local yield, first cracks, debonding, in the order in which places give in.

The mean of ``WINDOW`` instants, of a thirtieth of them where there are many, is held against the line of all before.
The limit is that of a normal deviate which all
looks together pass at ``CHANCE`` of the places; it is never below ``LIMIT``.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from analysis.evaluate.response.lines import ResponseLines, ResponseSums

Floats = NDArray[np.float64]
FIRST, WINDOW, LIMIT = 20, 5, 4.5
"""Instants before the first look; instants of a look, at least; standard deviations, at least."""
CHANCE = 5e-5
MANY = 0.05
"""Share of the places that leave at once, from which on what all have in common is looked at."""
NOT_USED = -1
_STEP, _CLEAR, _FEWEST, _PARTS, _WIDEST = 0.7, 6.0, 3, 30, 50


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
        if not (step > _STEP * largest and largest > _CLEAR * usual):
            return ""
        if first > 0:
            return "wait"
        return "step" if abs(common[-1]) > largest / 2 else "off"
