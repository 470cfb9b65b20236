"""The table of tensile figures: summary, page, report, comparison and batch take name, unit and interval from it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from analysis.evaluate import Figure, TensileFigures

HEADLINE = ("E", "nu", "Rp02", "Rm")
"""The figures that are shown first, and compared between tests."""

_PLAIN, _PERCENT, _MPA, _GPA, _KN = ("", 1.0), ("%", 0.01), ("MPa", 1e6), ("GPa", 1e9), ("kN", 1e3)
_STRENGTHS = {"Rp01": "p0.1", "Rp02": "p0.2", "Rp1": "p1", "ReH": "eH", "ReL": "eL", "Rm": "m"}
_SMALL_KN = 2.0  # below it forces are shown in N


def quantity(value: float, sigma: float, unit: str) -> str:
    """``value +- sigma unit`` with as many digits as the uncertainty deserves."""
    if not math.isfinite(value):
        return "not known"
    if not math.isfinite(sigma) or sigma <= 0:
        return f"{value:.4g} {unit}".rstrip()
    digits = max(0, min(6, 1 - math.floor(math.log10(sigma))))
    return f"{value:.{digits}f} +- {sigma:.{digits}f} {unit}".rstrip()


def interval(figure: Figure, unit_is: float = 1.0, unit: str = "") -> str:
    """A figure with the larger half of its interval, in a unit that is ``unit_is`` of ours."""
    half = max(figure.high - figure.value, figure.value - figure.low)
    return quantity(figure.value / unit_is, half / unit_is, unit)


@dataclass(frozen=True, slots=True)
class TensileRow:
    """One line of the table.

    Attributes
    ----------
    name : str
        As the standards have it: Rp0.2, or Fp0.2 of a force.
    unit : str
    figure : Figure
        In that unit, or why it is not known.
    """

    name: str
    unit: str
    figure: Figure

    @property
    def column(self) -> str:
        """The head of a column: name and unit."""
        return f"{self.name}_{self.unit}" if self.unit else self.name

    @property
    def half(self) -> float:
        """The larger half of the interval; NaN where the figure is not known."""
        return max(self.figure.high - self.figure.value, self.figure.value - self.figure.low)

    @property
    def text(self) -> str:
        """Value, interval and unit for a person; forces below 2 kN in N."""
        if self.unit == "kN" and abs(self.figure.value) < _SMALL_KN:
            return interval(self.figure, 1e-3, "N")
        return interval(self.figure, 1.0, self.unit)


def tensile_table(figures: TensileFigures, *, stresses: bool) -> dict[str, TensileRow]:
    """The rows by the attribute of ``figures`` that they show, in the order of a report.

    Parameters
    ----------
    figures : TensileFigures
    stresses : bool
        The section is known; else the figures are of forces, N: EA, Fp0.2, Fm.
    """
    modulus, letter = ("E", "R") if stresses else ("EA", "F")
    stiffness, strength = (_GPA, _MPA) if stresses else (_KN, _KN)
    names = {"E": (modulus, stiffness), "E_chord": (f"{modulus} by chord", stiffness), "nu": ("nu", _PLAIN)}
    names |= {key: (letter + end, strength) for key, end in _STRENGTHS.items()}
    names |= {key: (key, _PERCENT) for key in ("Ag", "Agt", "A", "At")}
    return {
        key: TensileRow(name, unit, getattr(figures, key).over(one))
        for key, (name, (unit, one)) in names.items()
    }


def headline(figures: TensileFigures, *, stresses: bool) -> list[TensileRow]:
    """The rows that are shown first: modulus, Poisson's ratio, proof strength and strength."""
    rows = tensile_table(figures, stresses=stresses)
    return [rows[key] for key in HEADLINE]
