"""A figure of a test: a number with the interval it lies in, or the reason why it cannot be had.

What the standards say of a tensile test: intervals of the modulus, proof strains, strain rates.

Facts only, from ISO 6892-1:2019 (metals), ISO 527-1:2019 (plastics) and ASTM D3039/D3039M-17 (composites);
read the standard itself before reporting by it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

CONFIDENCE = 0.95
"""Of all intervals here; they hold the scatter of strain and force, not the section or the load cell's class."""


@dataclass(frozen=True, slots=True)
class Figure:
    """A number with its interval of confidence.

    Attributes
    ----------
    value, low, high : float
        NaN where it cannot be had.
    why : str
        Why it cannot be had; of a value, what to know about it, mostly nothing.
    """

    value: float
    low: float
    high: float
    why: str = ""

    @classmethod
    def about(cls, value: float, sigma: float, dof: float = math.inf, why: str = "") -> Figure:
        """``value`` with the interval that its standard uncertainty and the degrees of freedom give."""
        half = quantile(dof) * sigma
        return cls(value, value - half, value + half, why)

    @classmethod
    def none(cls, why: str) -> Figure:
        """No value, and why."""
        return cls(math.nan, math.nan, math.nan, why)

    @property
    def known(self) -> bool:
        """Whether there is a value."""
        return math.isfinite(self.value)

    def over(self, other: float) -> Figure:
        """The figure in another unit: divided by a positive number."""
        return Figure(self.value / other, self.low / other, self.high / other, self.why)

    def minus(self, other: float, sigma: float = 0.0) -> Figure:
        """``other``, of standard uncertainty ``sigma``, taken away."""
        half = quantile() * sigma
        value = self.value - other
        return Figure(
            value,
            value - math.hypot(self.value - self.low, half),
            value + math.hypot(self.high - self.value, half),
            self.why,
        )


def quantile(dof: float = math.inf) -> float:
    """Half the width of the interval in standard uncertainties (Student's t); NaN without a degree of freedom."""
    from scipy.special import ndtri, stdtrit

    both = 0.5 + CONFIDENCE / 2
    if dof <= 0:
        return math.nan
    return float(ndtri(both) if math.isinf(dof) else stdtrit(dof, both))


PER_MINUTE = 1 / 60


@dataclass(frozen=True, slots=True)
class Interval:
    """Where the modulus is taken.

    Attributes
    ----------
    by : "strain" or "yield"
        Limits are strains, or shares of the yield strength (ReH, else Rp0.2, else the highest stress).
    low, high : float
    """

    by: Literal["strain", "yield"]
    low: float
    high: float

    def __post_init__(self) -> None:
        if not 0 <= self.low < self.high:
            raise ValueError(f"an interval needs 0 <= low < high, got {self.low:g} to {self.high:g}")


@dataclass(frozen=True, slots=True)
class Band:
    """A range of the strain rate, 1/s."""

    name: str
    low: float
    high: float


def _about(name: str, rate: float, tolerance: float = 0.2) -> Band:
    return Band(name, rate * (1 - tolerance), rate * (1 + tolerance))


@dataclass(frozen=True, slots=True)
class Standard:
    """How a test is evaluated.

    Attributes
    ----------
    name : str
    interval : Interval
    brittle : tuple (strain, low, high) or None
        Where the highest stress comes before this strain, the interval is this share of that strain.
    rates_elastic, rates_plastic : tuple of Band
        Allowed up to the yield strength, and after it; empty where nothing is said.
    seconds_to_break : tuple (low, high) or None
    flow : bool
        Whether figures of plastic flow (Rp, ReH, ReL, Ag, A) belong to it.
    """

    name: str
    interval: Interval
    brittle: tuple[float, float, float] | None = None
    rates_elastic: tuple[Band, ...] = ()
    rates_plastic: tuple[Band, ...] = ()
    seconds_to_break: tuple[float, float] | None = None
    flow: bool = True


_RANGES = tuple(
    _about(f"range {k}", rate) for k, rate in enumerate((0.00007, 0.00025, 0.002, 0.0067), 1)
)  # ISO 6892-1:2019, 10.3.2: method A, tolerance 20 %

STANDARDS = {
    standard.name: standard
    for standard in (
        # Annex G: between 10 % and 40 % of ReH or Rp0.2.
        Standard(
            "iso6892", Interval("yield", 0.1, 0.4), rates_elastic=_RANGES[:2], rates_plastic=_RANGES[1:]
        ),
        # 3.9: between the strains 0.05 % and 0.25 %, chord or regression; 9.6 with table 1: 1 % a minute, 20 %.
        Standard(
            "iso527",
            Interval("strain", 0.0005, 0.0025),
            rates_elastic=(_about("1 %/min", 0.01 * PER_MINUTE),),
            flow=False,
        ),
        # 13.3.1 with table 3: chord 1000 to 3000 um/m; below 6000 um/m to failure, 25 % to 50 % of that strain.
        # 11.3: failure within 1 to 10 min.
        Standard(
            "astm-d3039",
            Interval("strain", 0.001, 0.003),
            brittle=(0.006, 0.25, 0.5),
            seconds_to_break=(60, 600),
            flow=False,
        ),
    )
}


def free(interval: Interval) -> Standard:
    """No standard: only an interval of one's own."""
    return Standard("free", interval)
