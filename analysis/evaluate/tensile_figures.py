"""How a tensile test is evaluated, what standards demand of it, and its figures.

Of the standards facts only, from ISO 6892-1:2019 (metals), ISO 527-1:2019 (plastics) and ASTM D3039/D3039M-17
(composites); read the standard itself before reporting by it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from acquire.text import Message
from analysis.evaluate.elastic import ErrorLimits
from analysis.evaluate.figure import Figure
from analysis.evaluate.programme import KINDS, Kind

PER_MINUTE = 1 / 60
ZeroBy = Literal["raw", "toe", "preload"]


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


@dataclass(frozen=True, slots=True)
class TensileOptions:
    """How a test is evaluated.

    Attributes
    ----------
    standard : Standard
    zero : "raw", "toe" or "preload"
        Strain counts as measured, from where the elastic line has no stress (toe compensation), or from
        where the stress first reaches ``preload``.
    preload : float, Pa
    limits : ErrorLimits
        Of what E is uncertain by beyond the scatter.
    test : "auto" or one of ``KINDS``
        The kind of the test: found from its course, or given.
    """

    standard: Standard = STANDARDS["iso6892"]
    zero: ZeroBy = "raw"
    preload: float = 0.0
    limits: ErrorLimits = field(default_factory=ErrorLimits)
    test: str = "auto"

    def __post_init__(self) -> None:
        if self.zero not in ("raw", "toe", "preload"):
            raise ValueError(f"unknown zero {self.zero!r}; known: raw, toe, preload")
        if self.test not in ("auto", *KINDS):
            raise ValueError(f"unknown test {self.test!r}; known: auto, {', '.join(KINDS)}")
        if self.zero == "preload" and not self.preload > 0:
            raise ValueError("a zero at a preload needs that preload, in Pa above 0")


@dataclass(frozen=True, slots=True)
class StrainZero:
    """The measured strain that counts as none, and how it was found, in words."""

    strain: float
    how: str


@dataclass(frozen=True, slots=True)
class Span:
    """The elastic interval that was used: its strains (from zero), its stresses (Pa), and how many points."""

    strain: tuple[float, float]
    stress: tuple[float, float]
    n: int


@dataclass(frozen=True, slots=True)
class TensileFigures:
    """The figures of a tensile test; each has an interval, or the reason why it cannot be had.

    Attributes
    ----------
    E, E_chord : Figure, Pa
        By regression and by chord over ``span``.
    r2 : float
        Coefficient of determination of the regression; NaN without one.
    nu : Figure
    Rp01, Rp02, Rp1 : Figure, Pa
        Proof strengths at 0.1, 0.2 and 1 % plastic strain.
    ReH, ReL : Figure, Pa
    Rm : Figure, Pa
    Agt, Ag, At, A : Figure
        Total and plastic strain at the highest stress, and at break; not in percent.
    r, n : Figure
        Plastic anisotropy and strain hardening; ``why`` has the interval.
    rate_elastic, rate_plastic : Figure, 1/s
        Strain rate over ``span``, and over the second half of the strain from there to the highest
        stress; ``why`` holds it against the standard.
    seconds : Figure, s
        From the start of the loading to the break, or to the highest stress.
    span : Span or None
    zero : StrainZero
    standard : str
    budget : mapping of str to float
        Relative standard uncertainties that the interval of E is made of, by their causes; empty without E.
    strain, elastic_strain : str
        What the strain of the curve is, and that of E and nu, in words.
    kind : str
        Of the test, one of ``KINDS``.
    notes : tuple of str
        What must be said of the test: its kind where it is no tensile one or given, forces left out, a gap.
    """

    E: Figure
    E_chord: Figure
    r2: float
    nu: Figure
    Rp01: Figure
    Rp02: Figure
    Rp1: Figure
    ReH: Figure
    ReL: Figure
    Rm: Figure
    Agt: Figure
    Ag: Figure
    At: Figure
    A: Figure
    r: Figure
    n: Figure
    rate_elastic: Figure
    rate_plastic: Figure
    seconds: Figure
    span: Span | None
    zero: StrainZero
    standard: str
    strain: str = ""
    elastic_strain: str = ""
    budget: Mapping[str, float] = field(default_factory=dict)
    kind: Kind = "tensile"
    notes: tuple[str, ...] = ()
