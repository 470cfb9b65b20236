"""A figure of a test: a number with the interval it lies in, or the reason why it cannot be had."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from acquire.text import Message

CONFIDENCE = 0.95
"""Of all intervals here; they hold the scatter of strain and force, and that of E the stated limits of error."""

AT_LEAST = Message("at least")
"""Qualifier of a bound: what lies above it was not seen."""


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
