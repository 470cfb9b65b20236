"""Quantities for people: value, uncertainty and unit by one set of rules.

The page has the same rules in ``numbers.js``, held to one table of cases by the tests. Groups of three are a narrow
space apart, a minus is a true one, there is no plus; the decimal mark is that of the language; digits follow from
the uncertainty. Files have points and SI units, and do not come here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Decimal
from typing import Any, NamedTuple

GAP, MINUS, PLUS_MINUS, UNKNOWN = "\u202f", "−", "±", "–"
LIVE_DIGITS = 5
"""Digits of a live figure at most: more cannot be read while they change."""
MOST_DECIMALS = 6
IN_ASCII = str.maketrans(
    {"µ": "u", PLUS_MINUS: "+-", UNKNOWN: "-", MINUS: "-", GAP: "", "×": "x", "σ": "sigma"}
)
"""For a terminal that shows no others, and for pictures where OpenCV draws no others."""
_COMMA = ("de", "fr")
_WHOLE = 1e15
"""From here on not every whole number is a float: four digits and a power of ten."""


@dataclass(frozen=True, slots=True)
class ShownUnit:
    """A unit of a kind of quantity.

    Attributes
    ----------
    name : str
    one : float
        In SI units.
    since : float
        The magnitude, SI, from which on a quantity is shown in it.
    decimals : int
        Of a value whose uncertainty is not known.
    """

    name: str
    one: float
    since: float
    decimals: int


UNITS = {
    "": (ShownUnit("", 1.0, 0.0, 3),),
    "share": (ShownUnit("%", 1e-2, 0.0, 2),),
    "strain": (ShownUnit("µm/m", 1e-6, 0.0, 0), ShownUnit("%", 1e-2, 1e-2, 4)),
    "force": (ShownUnit("N", 1.0, 0.0, 1), ShownUnit("kN", 1e3, 1e4, 3)),
    "stress": (ShownUnit("MPa", 1e6, 0.0, 1), ShownUnit("GPa", 1e9, 1e10, 2)),
    "time": (ShownUnit("s", 1.0, 0.0, 1), ShownUnit("min", 60.0, 120.0, 1)),
    "rest": (ShownUnit("min", 60.0, 0.0, 0), ShownUnit("h", 3600.0, 36e3, 0)),
    "delay": (ShownUnit("ms", 1e-3, 0.0, 0),),
    "length": (ShownUnit("mm", 1e-3, 0.0, 2),),
    "pixels": (ShownUnit("px", 1.0, 0.0, 2),),
    "size": (ShownUnit("MB", 1e6, 0.0, 1), ShownUnit("GB", 1e9, 1e9, 2)),
    "count": (ShownUnit("", 1.0, 0.0, 0),),
}


class Printed(NamedTuple):
    """The parts of a quantity as they are shown; ``sigma`` is empty where it is not known."""

    value: str
    sigma: str
    unit: str

    def __str__(self) -> str:
        between = f" {PLUS_MINUS} {self.sigma}" if self.sigma else ""
        return f"{self.value}{between} {self.unit}".rstrip()


@dataclass(frozen=True, slots=True)
class Amount:
    """A value in SI units with its uncertainty, and how it is shown.

    Attributes
    ----------
    kind : str
        Of ``UNITS``.
    value, sigma : float
        NaN where not known.
    digits : 1 or 2
        Those of the uncertainty that are shown: one of a live figure, which has at most ``LIVE_DIGITS``, two of a
        result.
    unit : str
        The unit to show it in; empty: the one for its size.
    """

    kind: str
    value: float
    sigma: float = math.nan
    digits: int = 1
    unit: str = ""

    @classmethod
    def rough(cls, kind: str, value: float, digits: int = 3) -> Amount:
        """A value to so many digits, of which the uncertainty is not told."""
        return cls(kind, float(f"{value:.{digits}g}"), digits=2)

    def to_json(self) -> dict[str, Any]:
        """Its attributes; null where a number is not known."""
        plain = {name: getattr(self, name) for name in ("kind", "value", "sigma", "digits", "unit")}
        return {
            key: None if isinstance(one, float) and not math.isfinite(one) else one
            for key, one in plain.items()
        }

    def printed(self, language: str = "en") -> Printed:
        """Its parts in a language."""
        unit = unit_of(self.kind, self.value, self.unit)
        value, sigma = self.value / unit.one, self.sigma / unit.one
        return Printed(
            *with_sigma(value, sigma, self.digits, decimals=unit.decimals, language=language), unit.name
        )

    def __str__(self) -> str:
        return str(self.printed())


def counts(*numbers: int) -> Iterator[Amount]:
    """Numbers of things, which are shown in groups of three."""
    return (Amount("count", n) for n in numbers)


def unit_of(kind: str, size: float, name: str = "") -> ShownUnit:
    """The unit of this name, else the one for a magnitude in SI units."""
    units = UNITS[kind]
    named = [unit for unit in units if unit.name == name]
    return (named or [unit for unit in units if abs(size) >= unit.since] or units[:1])[-1]


def decimal_mark(language: str) -> str:
    """Comma or point."""
    return "," if language in _COMMA else "."


def number(value: float, decimals: int = 0, language: str = "en") -> str:
    """A number to so many decimals, negative ones of tens; ``UNKNOWN`` where it is not finite."""
    if not math.isfinite(value):
        return UNKNOWN
    size = abs(float(value))
    if size < _WHOLE:
        exact = Decimal(size).quantize(Decimal(1).scaleb(-decimals), ROUND_HALF_UP)
        size, text = float(exact), f"{exact:,f}".replace(",", GAP)
    else:
        text = f"{size:.3e}"
    text = text.replace(".", decimal_mark(language))
    return MINUS + text if value < 0 and size else text


def with_sigma(
    value: float, sigma: float, digits: int, *, decimals: int = 0, language: str = "en"
) -> tuple[str, str]:
    """Value and uncertainty in one unit, to the place of the ``digits``-th digit of the uncertainty.

    A live figure (one digit) has at most ``LIVE_DIGITS``; an uncertainty far below its last place is "<" that.
    Without an uncertainty a live figure has ``decimals``, a result at most four digits; the second text is empty.
    """
    if not math.isfinite(value):
        return UNKNOWN, ""
    known = math.isfinite(sigma) and sigma > 0
    if known or digits > 1:
        decimals = min(_decimals_of(sigma, digits) if known else _shortest(value), MOST_DECIMALS)
    if digits == 1:
        decimals = min(decimals, max(0, LIVE_DIGITS - len(f"{abs(value):.0f}")))
    text, last = number(value, decimals, language), 10.0**-decimals
    if not known:
        return text, ""
    if sigma < last / 2:
        return text, f"< {number(last, decimals, language)}"
    return text, number(sigma, decimals, language)


def _shortest(value: float) -> int:
    """The decimals of a number with four digits, without zeros at its end."""
    digits = f"{value:.3e}".partition("e")[0]
    return max(_decimals_of(value, 4) - len(digits) + len(digits.rstrip("0")), 0)


def _decimals_of(size: float, digits: int) -> int:
    """The decimals that show so many digits of a number."""
    return digits - 1 - int(f"{size:.{digits - 1}e}".partition("e")[2])
