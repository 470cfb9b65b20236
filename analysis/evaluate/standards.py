"""What the standards demand of a tensile test: intervals of the modulus and strain rates.

Facts only, from ISO 6892-1:2019 (metals), ISO 527-1:2019 (plastics) and ASTM D3039/D3039M-17 (composites);
read the standard itself before reporting by it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from acquire.text import Message

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
    poisson : tuple (low, high) or None
        Strains that Poisson's ratio is taken between, up to the highest stress; None: the elastic interval.
    rates_elastic, rates_plastic : tuple of Band
        Allowed up to the yield strength, and after it; empty where the standard has none.
    seconds_to_break : tuple (low, high) or None
    flow : bool
        Whether figures of plastic flow (Rp, ReH, ReL, Ag, A) belong to it.
    """

    name: str
    interval: Interval
    brittle: tuple[float, float, float] | None = None
    poisson: tuple[float, float] | None = None
    rates_elastic: tuple[Band, ...] = ()
    rates_plastic: tuple[Band, ...] = ()
    seconds_to_break: tuple[float, float] | None = None
    flow: bool = True


# ISO 6892-1:2019, 10.3.2: method A, tolerance 20 %.
_RANGES = tuple(
    _about(Message("range {k}", k), rate) for k, rate in enumerate((0.00007, 0.00025, 0.002, 0.0067), 1)
)

STANDARDS = {
    standard.name: standard
    for standard in (
        # Annex G: between 10 % and 40 % of ReH or Rp0.2.
        Standard(
            "iso6892", Interval("yield", 0.1, 0.4), rates_elastic=_RANGES[:2], rates_plastic=_RANGES[1:]
        ),
        # Poisson's ratio from 0.3 % on, before yield.
        # 3.9: between the strains 0.05 % and 0.25 %, chord or regression; 9.6 with table 1: 1 % a minute, 20 %.
        Standard(
            "iso527",
            Interval("strain", 0.0005, 0.0025),
            poisson=(0.003, 0.015),
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
