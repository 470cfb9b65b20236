"""The maps of a field in colours during a test: strains, principal strains, displacements, sigma, status."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from analysis.field import StrainField
from live.results.maps.scale import (
    OPACITY,
    AutoRange,
    ColourScale,
    Kind,
    StatusCount,
    range_kind,
    status_colours,
    status_legend,
)

Floats = NDArray[np.floating]
NO_MAPS: Mapping[str, Floats] = MappingProxyType({})
_PRINCIPAL = ("e1", "e2")
_STRAINS = ("exx", "eyy", "exy", *_PRINCIPAL)
FIELD_MAPS = (*_STRAINS, "u", "v", "sigma", "residual", "status")
"""e1 and e2 are the principal strains, sigma is that of the strain along the load, residual is chi squared."""


@dataclass(frozen=True, slots=True, eq=False)
class Painted:
    """A map in colours.

    Attributes
    ----------
    rgba : (R, C, 4) uint8
    scale : ColourScale or None
        None for the map of statuses.
    legend : tuple of StatusCount
        Of the map of statuses.
    values, sigmas : (R, C) float or None
        None for the map of statuses; no sigma of those that have none.
    """

    rgba: NDArray[np.uint8]
    scale: ColourScale | None
    legend: tuple[StatusCount, ...] = ()
    values: Floats | None = None
    sigmas: Floats | None = None


class FieldMaps:
    """Paints the maps of one field after the other; ranges follow the data and do not flicker.

    Parameters
    ----------
    axis : "x" or "y"
        Of the load.
    fixed : float or None
        Range of the strains, -fixed to fixed.
    is_symmetric : bool
        Ranges are about zero where there are two signs; else over the values.
    alpha : int
        Opacity, 0..255.
    """

    def __init__(
        self,
        axis: Literal["x", "y"],
        fixed: float | None = None,
        *,
        is_symmetric: bool = False,
        alpha: int = OPACITY,
    ) -> None:
        self._along, self._alpha = f"e{axis * 2}", alpha
        self._fixed, self._is_symmetric = fixed, is_symmetric
        self._ranges: dict[str, AutoRange] = {}

    def _range(self, name: str) -> AutoRange:
        kind: Kind = range_kind(name)
        if kind == "free" and self._is_symmetric:
            kind = "about zero"
        return AutoRange(kind, self._fixed if name in _STRAINS else None)

    def paint(
        self, field: StrainField, names: Iterable[str], more: Mapping[str, Floats] = NO_MAPS
    ) -> dict[str, Painted]:
        """The named maps, of ``FIELD_MAPS`` or of ``more``, which has them with their ``sigma_``."""
        wanted = tuple(names)
        principal = field.strain(field.measure).principal[:2] if set(wanted) & {*_PRINCIPAL} else ()
        known = dict(zip(_PRINCIPAL, principal, strict=False)) | dict(more)
        nothing = {name: np.full(field.grid.shape, np.nan) for name in {*wanted} - {*FIELD_MAPS, *more}}
        known |= nothing  # yet
        return {
            name: self._painted(field, name, known.get(name), known.get(f"sigma_{name}")) for name in wanted
        }

    def _painted(
        self, field: StrainField, name: str, values: Floats | None, sigmas: Floats | None = None
    ) -> Painted:
        if name == "status":
            return Painted(status_colours(field.status, self._alpha), None, status_legend(field.status))
        own = sigmas
        if name == "residual":
            values = np.where(field.ok, field.residual, np.nan)
        elif name == "sigma":
            values = field.sigma(self._along)
        elif values is None:
            values, own = field.value(name), field.sigma(name)
        noise = field.sigma(self._along) if name in _PRINCIPAL else own
        span = self._ranges.setdefault(name, self._range(name)).update(values, noise)
        scale = ColourScale.of(name, span)
        return Painted(scale.colours(values, self._alpha), scale, values=values, sigmas=own)
