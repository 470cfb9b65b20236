"""A field as maps in colours: strains, principal strains, sigma, residual, status; each with its span."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis.field import Status
from live.maps import STATUS_COLOURS, AutoRange, Unit, colour, nice_above, unit_for
from live.view.exchange.setup import MAPS, STRAINS, ViewSetup

if TYPE_CHECKING:
    from analysis.field import StrainField

Floats = NDArray[np.floating]
Span = tuple[float, float]

PRINCIPAL = ("e1", "e2")
_ALPHA = 225
_SHRINK, _PATIENCE = 0.55, 20
_CHI = Unit("chi\u00b2", 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Painted:
    """One map.

    Attributes
    ----------
    rgba : (R, C, 4) uint8
    span : (low, high) or None
        Of the colours; None where they have no order (status).
    unit : Unit
    legend : tuple of (str, (red, green, blue))
        What the colours say, where they have no order.
    """

    rgba: NDArray[np.uint8]
    span: Span | None
    unit: Unit
    legend: tuple[tuple[str, tuple[int, int, int]], ...] = ()


class FieldMaps:
    """Paints the maps of one field after the other; spans follow the data and do not flicker."""

    def __init__(self, setup: ViewSetup) -> None:
        self._axial = "eyy" if setup.axis == "y" else "exx"
        fixed = setup.strain_range
        automatic = setup.scale == "automatic" and fixed is None
        self._symmetric = {name: AutoRange(fixed) for name in (*STRAINS, *PRINCIPAL) if not automatic}
        self._free = {name: FreeSpan() for name in MAPS}

    def paint(self, field: StrainField, names: tuple[str, ...]) -> dict[str, Painted]:
        """The named maps of ``MAPS``."""
        sigma = getattr(field, f"sigma_{self._axial}")
        principal = (
            dict(zip(PRINCIPAL, field.principal[:2], strict=True)) if set(names) & {*PRINCIPAL} else {}
        )
        values = {**principal, "sigma": sigma, "residual": np.where(field.ok, field.residual, np.nan)}
        painted = {}
        for name in names:
            if name == "status":
                painted[name] = _status(field)
                continue
            shown = values[name] if name in values else getattr(field, name)
            low, high = self._span(name, shown, getattr(field, f"sigma_{name}", sigma))
            rgba = colour(shown - (low + high) / 2, (high - low) / 2, _ALPHA)
            painted[name] = Painted(rgba, (low, high), _unit(name, max(abs(low), abs(high))))
        return painted

    def _span(self, name: str, values: Floats, sigmas: Floats) -> Span:
        if name in self._symmetric:
            limit = self._symmetric[name].update(values, sigmas)
            return -limit, limit
        return self._free[name].update(values, from_zero=name in ("sigma", "residual"))


class FreeSpan:
    """A span over the values there are, in steps that read well: grows at once, shrinks when they stay small."""

    def __init__(self) -> None:
        self._span, self._small = (0.0, 0.0), 0

    def update(self, values: Floats, *, from_zero: bool = False) -> Span:
        """Take a map; the span now in force."""
        found = values[np.isfinite(values)]
        if found.size:
            low, high = (float(v) for v in np.percentile(found, (2, 98)))
            self._follow(_nice(0.0 if from_zero else low, high))
        low, high = self._span
        return (low, high) if high > low else (0.0, 1e-4)

    def _follow(self, wanted: Span) -> None:
        (low, high), width = self._span, wanted[1] - wanted[0]
        outside = wanted[0] < low or wanted[1] > high
        self._small = self._small + 1 if width < _SHRINK * (high - low) else 0
        if outside or self._small >= _PATIENCE:
            self._span, self._small = wanted, 0


def _nice(low: float, high: float) -> Span:
    """A span around ``low`` to ``high`` whose ends are whole steps of it; of values all alike, a hundredth."""
    least = max(abs(low), abs(high), 1e-6) / 100
    if high - low < least:
        low, high = low - least / 2, high + least / 2
    step = nice_above(high - low) / 5
    return float(np.floor(low / step) * step), float(np.ceil(high / step) * step)


def _unit(name: str, largest: float) -> Unit:
    return _CHI if name == "residual" else unit_for(largest)


def _status(field: StrainField) -> Painted:
    table = np.array([_rgba(STATUS_COLOURS[int(status)]) for status in Status], np.uint8)
    rgba = table[np.clip(field.status.astype(np.intp), 0, len(table) - 1)]
    legend = [
        (f"{status.name} {count}", (int(table[status][0]), int(table[status][1]), int(table[status][2])))
        for status in Status
        if status is not Status.NOT_MEASURED and (count := int((field.status == status).sum()))
    ]
    return Painted(rgba, None, Unit("", 1.0), tuple(legend))


def _rgba(text: str) -> tuple[int, ...]:
    parts = [int(text[k : k + 2], 16) for k in range(1, len(text), 2)]
    return (*parts, _ALPHA)[:4]
