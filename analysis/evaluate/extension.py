"""The change of the distance between two groups of ZOIs, from their displacements alone."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.field import PAIR_INDEX, StrainField, variance_of_sum

Floats = NDArray[np.float64]
_U, _V = 0, 3  # among the affine parameters


@dataclass(frozen=True, slots=True, eq=False)
class Ends:
    """The ZOIs of the two ends, (R, C) bool each; all of them have a value, and none is empty."""

    first: NDArray[np.bool_]
    second: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Extension:
    """(L - L0)/L0 with its standard uncertainty, and L0 in px (0 where the ends lie upon each other)."""

    strain: float
    sigma: float
    length: float


def extension(field: StrainField, ends: Ends) -> Extension:
    """The strain between the mean places of two ends.

    Parameters
    ----------
    field : StrainField
    ends : Ends

    Returns
    -------
    Extension
        sigma is that of the displacement difference along the line, reference noise included.
    """
    share = ends.second / ends.second.sum() - ends.first / ends.first.sum()
    used = share != 0
    weights = share[used]
    x, y = np.meshgrid(field.grid.x, field.grid.y)
    before = np.array([_sum(weights * x[used]), _sum(weights * y[used])])
    length = float(np.hypot(*before))
    if length == 0:
        return Extension(math.nan, math.nan, 0.0)
    # The difference of the lengths loses no digits where the extension is small.
    moved = np.array([_sum(weights * field.u[used]), _sum(weights * field.v[used])])
    now = float(np.hypot(*(before + moved)))
    strain = float(moved @ (2 * before + moved)) / (now + length) / length
    spread = np.where(used, share * _sigma_along(field, (before + moved) / now), 0.0)
    variance = variance_of_sum(spread, "u", field.grid, field.window)
    return Extension(strain, math.sqrt(max(variance, 0.0)) / length, length)


def _sum(values: Floats) -> float:
    """The sum, in the order of the values: the same bits wherever they lie in memory."""
    return float(np.cumsum(values)[-1]) if values.size else 0.0


def _sigma_along(field: StrainField, direction: Floats) -> Floats:
    """Standard uncertainty of the displacement along a unit vector, (R, C), px."""
    nx, ny = direction
    uu, uv, vv = (
        field.covariance[PAIR_INDEX[pair]].astype(np.float64) for pair in ((_U, _U), (_U, _V), (_V, _V))
    )
    return np.asarray(np.sqrt(np.maximum(nx * nx * uu + 2 * nx * ny * uv + ny * ny * vv, 0)))
