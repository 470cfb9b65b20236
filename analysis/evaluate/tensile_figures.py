"""How a tensile test is evaluated, and its figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from analysis.evaluate.elastic import ErrorLimits
from analysis.evaluate.figure import Figure
from analysis.evaluate.programme import KINDS, Kind
from analysis.evaluate.standards import STANDARDS, Standard

ZeroBy = Literal["raw", "toe", "preload"]


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
