"""A figure of a test: a number with the interval it lies in, or the reason why it cannot be had; and the noise floor.

The noise floor is found in the instants at the start of a test that are still: how ZOIs scatter in them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquire.text import Message
from analysis.evaluate.curve import noise

CONFIDENCE = 0.95
"""Of all intervals here; they hold the scatter of strain and force, and that of E the stated limits of error."""

AT_LEAST = Message("at least")
"""Qualifier of a bound: what lies above it was not seen."""

Floats = NDArray[np.float64]

MIN_STILL_INSTANTS = 2
"""Still instants that a noise floor needs."""

_FORCE = 0.01  # of the range of the force
_MIN_RANGE = 10.0  # standard deviations of its noise that a force must range over; noise alone ranges over 9
_SIGMAS = 5.0


@dataclass(frozen=True, slots=True)
class Figure:
    """A number with its interval of confidence.

    Attributes
    ----------
    value, low, high : float
        NaN where it cannot be had.
    why : str
        Why it cannot be had; of a value, a remark, mostly none.
    qualifier : str
        What kind of a number it is: ``AT_LEAST`` of a bound, "film" of a compressed film; mostly none.
    applies : bool
        The standard of the evaluation has such a figure.
    """

    value: float
    low: float
    high: float
    why: str = ""
    qualifier: str = ""
    applies: bool = True

    @classmethod
    def about(cls, value: float, sigma: float, dof: float = math.inf, why: str = "") -> Figure:
        """``value`` with the interval that its standard uncertainty and the degrees of freedom give."""
        half = quantile(dof) * sigma
        return cls(value, value - half, value + half, why)

    @classmethod
    def none(cls, why: str, *, applies: bool = True) -> Figure:
        """No value, and why."""
        return cls(math.nan, math.nan, math.nan, why, applies=applies)

    @property
    def known(self) -> bool:
        """Whether there is a value."""
        return math.isfinite(self.value)

    @property
    def is_bound(self) -> bool:
        """Whether the value may be any above."""
        return self.qualifier == AT_LEAST

    @property
    def half(self) -> float:
        """Half the interval; where it is not even, the longer half."""
        return max(self.high - self.value, self.value - self.low)

    @property
    def sigma(self) -> float:
        """The standard uncertainty that gives this interval."""
        return self.half / quantile()

    def remarked(self, words: str) -> Figure:
        """The figure with a remark, where it is known."""
        return replace(self, why=words) if self.known and words else self

    def at_least(self) -> Figure:
        """The figure as a bound, without an upper end, where it is known."""
        return replace(self, high=math.inf, qualifier=AT_LEAST) if self.known else self

    def over(self, other: float) -> Figure:
        """The figure in another unit: divided by a positive number."""
        return replace(self, value=self.value / other, low=self.low / other, high=self.high / other)

    def times(self, other: Figure) -> Figure:
        """The product with another figure, of independent error; its words are of this one."""
        value = self.value * other.value
        below = math.hypot((self.value - self.low) * other.value, self.value * (other.value - other.low))
        above = math.hypot((self.high - self.value) * other.value, self.value * (other.high - other.value))
        return replace(self, value=value, low=value - below, high=value + above)

    def limited(self, share: float, qualifier: str) -> Figure:
        """The figure with a limit of error beyond its interval, a ``share`` of its value."""
        beyond = share * abs(self.value)
        words = self.qualifier or (qualifier if self.known else "")
        return replace(self, low=self.low - beyond, high=self.high + beyond, qualifier=words)

    def minus(self, other: float, sigma: float = 0.0) -> Figure:
        """``other``, of standard uncertainty ``sigma``, taken away."""
        half = quantile() * sigma
        value = self.value - other
        low, high = (math.hypot(one, half) for one in (self.value - self.low, self.high - self.value))
        return replace(self, value=value, low=value - low, high=value + high)


def quantile(dof: float = math.inf) -> float:
    """Half the width of the interval in standard uncertainties (Student's t); NaN without a degree of freedom."""
    from scipy.special import ndtri, stdtrit

    both = 0.5 + CONFIDENCE / 2
    if dof <= 0:
        return math.nan
    return float(ndtri(both) if math.isinf(dof) else stdtrit(dof, both))


@dataclass(frozen=True, slots=True)
class NoiseFloor:
    """Standard deviation of single ZOIs in still instants.

    Attributes
    ----------
    measured, predicted : float
        In the unit of the map.
    """

    measured: float
    predicted: float


def still_phase(force: Floats, means: Mapping[str, tuple[Floats, Floats]] | None = None) -> int:
    """The number of instants at the start of a test in which nothing moves.

    They end before the first one whose force differs from the first value by more than 1 % of the range of the
    force, or is not known. The strains do not count there: instants chosen by their strain would lack the very
    scatter that is measured. Only where the force does not decide (it is not known at the first instant, or does
    not range over more than its noise) the still phase ends before the first mean strain beyond 5 of its
    standard uncertainties.

    Parameters
    ----------
    force : (T,) float64, N
        With one zero for all; NaN where it is not known.
    means : mapping of str to two (T,) float64, optional
        Mean strains with their standard uncertainties.
    """
    if _force_decides(force):
        return _leading(np.abs(force - force[0]) <= _FORCE * np.ptp(force[np.isfinite(force)]))
    within = [np.abs(mean) <= _SIGMAS * sigma for mean, sigma in (means or {}).values()]
    return _leading(np.all(within, axis=0)) if within else 0


def _force_decides(force: Floats) -> bool:
    known = force[np.isfinite(force)]
    return bool(len(force)) and math.isfinite(force[0]) and float(np.ptp(known)) > _MIN_RANGE * noise(known)


def _leading(good: NDArray[np.bool_]) -> int:
    return len(good) if good.all() else int(np.argmin(good))


def evenly(count: int, max_count: int) -> NDArray[np.intp]:
    """At most ``max_count`` of ``count`` places, from the first to the last."""
    return np.unique(np.linspace(0, count - 1, min(max_count, count)).round().astype(np.intp))


def noise_floor(maps: Iterable[tuple[Floats, Floats]], *, planes: bool = False) -> NoiseFloor | None:
    """Scatter over the ZOIs of each still instant; None where too few have a value.

    Parameters
    ----------
    maps : iterable of two (R, C) float64
        Values and their standard uncertainties, NaN where there are none.
    planes : bool
        Scatter about a plane in place of the mean: of a displacement, it leaves rigid motion, strain and the
        vibration of the rig out. What is left holds the noise of the pictures and of the reference, as the
        uncertainties do.
    """
    terms = 3 if planes else 1
    squares, expected, n = 0.0, 0.0, 0
    for values, sigma in maps:
        known = np.isfinite(values) & np.isfinite(sigma)
        count = int(known.sum())
        if count <= terms:
            continue
        rest = _without_plane(values, known) if planes else values[known] - values[known].mean()
        squares += float(rest @ rest) * count / (count - terms)
        expected += float((sigma[known] ** 2).sum())
        n += count
    return NoiseFloor(math.sqrt(squares / n), math.sqrt(expected / n)) if n else None


def _without_plane(values: Floats, known: NDArray[np.bool_]) -> Floats:
    y, x = np.nonzero(known)
    plane = np.stack([np.ones(len(x)), x, y], axis=1)
    factors = np.linalg.lstsq(plane, values[known], rcond=None)[0]
    return np.asarray(values[known] - plane @ factors)
