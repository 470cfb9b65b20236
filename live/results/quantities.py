"""The numbers of the results: name, unit and definition of each, and the units and axes to show them in.

Files always hold px and dimensionless strains; ``Display`` converts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import ConfigError
from acquire.text import Message
from analysis.field import ZoiGrid
from live.config.figures import FIGURES

UNITLESS = ""

_GRADIENTS = ("du_dx", "du_dy", "dv_dx", "dv_dy")
_STRAINS = {*_GRADIENTS, *(one.plain for one in FIGURES if one.column and one.kind == "strain")}
# One index y (of place or of displacement) changes the sign, two restore it.
_TURNING = ("v", "exy", "du_dy", "dv_dx", "y")

_GAUGE, _SHARE = "gauge_", "share_gauge_"

MEANS = {
    name: name.removesuffix(f"_{one.unit}")
    for one in FIGURES
    if one.column and one.unit
    for name in one.columns
}
"""Column of ``Strain.values`` with the unit in its name -> quantity; other columns have the name of their quantity."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number of the results.

    Attributes
    ----------
    name : str
        As in ``strain.h5``, without a unit.
    unit : str
        "px", "s", "N", "Pa", "1/Pa", "1/s", "GL" or "" (dimensionless).
    words : str
        Its definition.
    label : str
        What ``strain.h5`` calls its map.
    """

    name: str
    unit: str
    words: str
    label: str = ""

    @property
    def is_strain(self) -> bool:
        """A strain, a gradient or the uncertainty of one; ``Display`` can give it in percent."""
        plain = self.name.removeprefix("sigma_")
        return plain in _STRAINS or plain.startswith(_GAUGE)

    @property
    def turns(self) -> bool:
        """Changes its sign when the y axis is turned upwards."""
        return self.name in _TURNING


_FIELDS = (
    Quantity("u", "px", "displacement along x since the reference", "displacement along x (right)"),
    Quantity("v", "px", "displacement along y since the reference", "displacement along y (down)"),
    Quantity("du_dx", UNITLESS, "displacement gradient du/dx, fitted over the ZOI", "du/dx"),
    Quantity("du_dy", UNITLESS, "displacement gradient du/dy, fitted over the ZOI", "du/dy"),
    Quantity("dv_dx", UNITLESS, "displacement gradient dv/dx, fitted over the ZOI", "dv/dx"),
    Quantity("dv_dy", UNITLESS, "displacement gradient dv/dy, fitted over the ZOI", "dv/dy"),
    Quantity("exx", UNITLESS, "normal strain along x", "strain xx"),
    Quantity("eyy", UNITLESS, "normal strain along y", "strain yy"),
    Quantity("exy", UNITLESS, "shear strain, tensor component: half of the engineering shear gamma_xy",
             "strain xy (tensor component, gamma/2)"),
    Quantity("residual", UNITLESS, "variance left by the fit over that expected from the noise; about 1",
             "residual chi^2 (about 1 when all is well)"),
    Quantity("blur", "px", "standard deviation of the blur since the reference; negative: sharper",
             "blur since the reference, negative: sharper"),
    Quantity("status", UNITLESS, "0 where the ZOI has a value, else the reason why it has none",
             "status of the ZOI (0 = ok)"),
    Quantity("iterations", UNITLESS, "iterations of the fit", "iterations"),
)  # fmt: skip
_MAPS = {q.name for q in _FIELDS}
_RESPONSES = (
    Quantity("compliance", "1/Pa", "strain along the load over stress, slope over all instants"),
    Quantity(
        "amplification", UNITLESS, "strain along the load over that of the channel, slope over all instants"
    ),
    Quantity("rate", "1/s", "strain along the load over time, slope over all instants"),
    Quantity("chi2", UNITLESS, "variance left by the line over that expected from the noise; about 1"),
    Quantity("instants", UNITLESS, "instants in the line of the place"),
    Quantity(
        "poisson", UNITLESS, "minus the strain across the load over that along it; noise of both allowed for"
    ),
    Quantity("leaves_at_stress", "Pa", "stress where the place leaves its line; nan where it does not"),
    Quantity("leaves_at_strain", UNITLESS, "strain of the channel where the place leaves its line; else nan"),
    Quantity(
        "current", UNITLESS, "share of the variance of strains at each instant that is not of the reference"
    ),
    Quantity("correlation", UNITLESS, "of the noises of exx and eyy, against each reference"),
    Quantity("fate", UNITLESS, "0: on its line to the end, 1: left it, 2: lost before the end"),
)
_PLACES = (
    Quantity("x", "px", "centre of the ZOI on the reference picture"),
    Quantity("y", "px", "centre of the ZOI on the reference picture"),
    Quantity("row", UNITLESS, "row of the ZOI in the grid, from 0"),
    Quantity("column", UNITLESS, "column of the ZOI in the grid, from 0"),
    Quantity("instant", UNITLESS, "number of the measurement in strain.h5, from 0"),
)
KNOWN = {q.name: q for q in (*_FIELDS, *_RESPONSES, *_PLACES)} | {
    one.plain: Quantity(one.plain, one.unit, one.words) for one in FIGURES if one.column and one.words
}


def quantity_of(name: str) -> Quantity:
    """The quantity of a map or column; one that is not known refers to the description of the format."""
    plain = MEANS.get(name, name)
    if plain in KNOWN:
        return KNOWN[plain]
    gauge = plain.removeprefix("sigma_")
    if plain.startswith(_SHARE):
        words = Message(
            "share of its area that {name} stands for, at either end", plain.removeprefix("share_")
        )
        return Quantity(plain, UNITLESS, words)
    if gauge.startswith(_GAUGE):
        named = repr(gauge.removeprefix(_GAUGE))
        words = Message("strain of the virtual gauge {name}; nan where it was lost", named)
        return Quantity(plain, UNITLESS, words if plain == gauge else _sigma_of(gauge))
    of = KNOWN.get(plain.removeprefix("sigma_"))
    if of is None or not plain.startswith("sigma_"):
        return Quantity(plain, UNITLESS, "see docs/strain-format.md")
    return Quantity(plain, of.unit, _sigma_of(of.name), of.label and f"standard uncertainty of {of.label}")


def _sigma_of(name: str) -> str:
    return Message("standard uncertainty (1 sigma) of {name}", name)


def mean_name(name: str) -> str:
    """The name of a column where it stands beside maps, which may have the same."""
    plain = MEANS.get(name, name)
    if plain.removeprefix("sigma_").startswith(_GAUGE):
        return plain
    of = plain.removeprefix("sigma_")
    return f"mean_{plain}" if of in _MAPS or of == "true_strain" else plain


@dataclass(frozen=True, slots=True)
class Display:
    """Units and axes that numbers are shown and exported in; by default as the files hold them.

    Attributes
    ----------
    mm_per_px : float or None, mm/px
        Lengths are in mm; None: in px.
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
                "a scale of {scale:g} mm/px is not possible; give what one pixel measures, in mm", scale
            )

    def unit(self, name: str) -> str:
        """The unit of a map or column; "" where it has none."""
        quantity = quantity_of(name)
        if quantity.is_strain and self.percent:
            return "%"
        return "mm" if quantity.unit == "px" and self.mm_per_px is not None else quantity.unit

    def column(self, name: str) -> str:
        """Name and unit, for heads of columns and names of arrays: ``u_mm``, ``eyy_percent``."""
        unit = self.unit(name).replace("%", "percent").replace("1/", "per_")
        plain = quantity_of(name).name
        return f"{plain}_{unit}" if unit else plain

    def definition(self, name: str) -> str:
        """What the column is, for a header."""
        unit = self.unit(name) or "dimensionless"
        return f"{self.column(name)} [{unit}]: {quantity_of(name).words}"

    def shown(self, name: str, values: NDArray[Any]) -> NDArray[Any]:
        """Values of a map or column in these units and axes; whole numbers stay as they are."""
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
        """From the stored values of a map or column to those shown."""
        quantity = quantity_of(name)
        sign = -1.0 if self.y_up and quantity.turns else 1.0
        if quantity.unit == "px" and self.mm_per_px is not None:
            return sign * self.mm_per_px
        return sign * (100.0 if self.unit(quantity.name) == "%" else 1.0)
