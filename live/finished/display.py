"""The units and axes that numbers are shown or exported in; files always hold px and plain numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError
from analysis.field import ZoiGrid
from live.results import quantity_of


@dataclass(frozen=True, slots=True)
class Display:
    """How numbers come out.

    Attributes
    ----------
    mm_per_px : float or None, mm/px
        Lengths come in mm; None: in px.
    y_up : bool
        y points up, from the centre of the first pixel: y, v, exy, du_dy and dv_dx change their sign,
        exx, eyy, du_dx and dv_dy do not.
    percent : bool
        Strains and gradients in %.

    Raises
    ------
    ConfigError
        A scale that is not positive.
    """

    mm_per_px: float | None = None
    y_up: bool = False
    percent: bool = False

    def __post_init__(self) -> None:
        scale = self.mm_per_px
        if scale is not None and not 0 < scale < float("inf"):
            raise ConfigError(
                f"a scale of {scale:g} mm/px is not possible; give what one pixel measures, in mm"
            )

    def unit(self, name: str) -> str:
        """The unit that a map or column comes in; "" where it has none."""
        quantity = quantity_of(name)
        if quantity.is_strain and self.percent:
            return "%"
        return "mm" if quantity.unit == "px" and self.mm_per_px is not None else quantity.unit

    def column(self, name: str) -> str:
        """The name with its unit, as heads of columns and names of arrays carry it: ``u_mm``, ``eyy_percent``."""
        unit = self.unit(name).replace("%", "percent")
        plain = quantity_of(name).name
        return f"{plain}_{unit}" if unit else plain

    def definition(self, name: str) -> str:
        """What the column is, for a header."""
        unit = self.unit(name) or "dimensionless"
        return f"{self.column(name)} [{unit}]: {quantity_of(name).words}"

    def shown(self, name: str, values: NDArray[Any]) -> NDArray[Any]:
        """Values of a map or column as they come out; whole numbers stay as they are."""
        factor = self.factor(name)
        return values if factor == 1 else values * values.dtype.type(factor)

    def x(self, grid: ZoiGrid) -> NDArray[np.float64]:
        """Centres of the columns of ZOIs, (C,), px or mm."""
        return self.shown("x", grid.x)

    def y(self, grid: ZoiGrid) -> NDArray[np.float64]:
        """Centres of the rows of ZOIs, (R,), px or mm; descending with ``y_up``."""
        return self.shown("y", grid.y)

    def step(self, grid: ZoiGrid) -> float:
        """Distance of neighbouring ZOIs, px or mm."""
        return grid.step * (self.mm_per_px or 1.0)

    def axes(self) -> str:
        """The frame of reference in words."""
        y = "up (y = 0 in the first row, negative below)" if self.y_up else "down"
        scale = "" if self.mm_per_px is None else f"; 1 px = {self.mm_per_px:g} mm"
        return f"x right, y {y}, from the centre of the first pixel; all values lie on the reference picture{scale}"

    def factor(self, name: str) -> float:
        """From the values of a map or column as they are kept to those that come out."""
        quantity = quantity_of(name)
        sign = -1.0 if self.y_up and quantity.turns else 1.0
        if quantity.unit == "px" and self.mm_per_px is not None:
            return sign * self.mm_per_px
        return sign * (100.0 if self.unit(quantity.name) == "%" else 1.0)
