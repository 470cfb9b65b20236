"""The strain field of a measured instant, made of the maps that the file holds."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np

from analysis.field import PAIR_INDEX, WINDOWS, Measure, StrainField, Window
from live.results import Strain

_GRADIENTS = ("du_dx", "du_dy", "dv_dx", "dv_dy")
_DU_DY, _DV_DX = 2, 4  # of u, du_dx, du_dy, v, dv_dx, dv_dy


def read_field(strain: Strain, row: int) -> StrainField:
    """The field of ``row``; of the covariances those that the stored sigmas tell, the others 0.

    Raises
    ------
    DataError
        There is no such row, or it cannot be read.
    """
    maps = {name: np.asarray(strain.maps(name, row), np.float64) for name in ("u", "v", *_GRADIENTS)}
    sigmas = {name: np.asarray(strain.maps(f"sigma_{name}", row), np.float64) for name in maps}
    status, residual = strain.maps("status", row), strain.maps("residual", row)
    field = StrainField.from_values(strain.grid, maps, sigmas, status=status, residual=residual)
    covariance = np.array(field.covariance)
    shear = np.asarray(strain.maps("sigma_exy", row), np.float64)
    both = sigmas["du_dy"] ** 2 + sigmas["dv_dx"] ** 2
    covariance[PAIR_INDEX[_DU_DY, _DV_DX]] = (4 * shear**2 - both) / 2
    measure = cast(Measure, strain.strain_measure)
    return replace(field, covariance=covariance, measure=measure, window=_window(strain))


def _window(strain: Strain) -> Window:
    """The weight of the ZOIs, which says how far neighbours are correlated; gaussian where it is not recorded."""
    said = strain.config.get("measure")
    name = said.get("window") if isinstance(said, dict) else None
    return cast(Window, name) if name in WINDOWS else "gaussian"
