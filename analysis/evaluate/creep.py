"""The creep of a test whose force is held: its strain rate, and when it reached a strain.

The hold is found from the force (``programme``). About an instant of it, with t the time since it began, the strain is
by least squares e = a + b ln t + c t: logarithmic and steady creep (ISO 204:2018 calls them primary and secondary). The
standard uncertainties are of the scatter about that, of single bursts or of means of a twelfth, whichever is more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquire.text import Message
from analysis.evaluate.curve import Curve, noise, smoothed
from analysis.evaluate.figure import Figure
from analysis.evaluate.programme import HELD, KindOfTest

Floats = NDArray[np.float64]
_FEWEST, _MOST = 12, 3  # bursts of a fit; strains to which the times are given
_CLEAR = 5.0  # standard uncertainties
_ABOUT = 1.4  # of the time at which a strain is reached: the fit goes from that part of it to that multiple


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
        if np.count_nonzero(part) < _FEWEST:
            return None
        design, strain = _design(self.t[part] / high), self.strain[part]
        inverse = np.linalg.pinv(design.T @ design, hermitian=True)
        found = inverse @ design.T @ strain
        rest = strain - design @ found
        # What neighbours have in common, of a creep of another law or of a drift, averages out by its means alone.
        common = sum(part.sum() ** 2 / len(part) for part in np.array_split(rest, _FEWEST)) / (_FEWEST - 3)
        return found, inverse * max(np.sum(rest**2) / (len(strain) - 3), common)

    def rate(self) -> Figure:
        end = float(self.t[-1]) if len(self.t) else math.nan
        fit = self._fit(end / 2, end)
        if fit is None:
            return Figure.none(Message("{least} bursts in the last half of the hold are needed", _FEWEST))
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
