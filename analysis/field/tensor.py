"""Strain on the grid: small, engineering, Green-Lagrange, Hencky; principal values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Measure = Literal["small", "engineering", "green", "hencky"]


@dataclass(frozen=True, slots=True, eq=False)
class StrainTensor:
    """Components of strain on the grid, each (R, C), dimensionless; exy is half the shear angle or its like."""

    measure: Measure
    exx: Floats
    eyy: Floats
    exy: Floats

    @property
    def principal(self) -> tuple[Floats, Floats, Floats]:
        """Largest and smallest principal strain and the angle of the first to x, (R, C) each, rad."""
        middle = (self.exx + self.eyy) / 2
        radius = np.hypot((self.exx - self.eyy) / 2, self.exy)
        angle = 0.5 * np.arctan2(2 * self.exy, self.exx - self.eyy)
        return middle + radius, middle - radius, angle


def elongations(cxx: Floats, cyy: Floats, cxy: Floats) -> StrainTensor:
    """What an extensometer reads, from C = F^T F: the elongation of lines that lay along x and y, over their length.

    exy is half of the change of the right angle between the two. No rotation changes any of it.
    """
    with np.errstate(invalid="ignore"):
        along_x, along_y = np.sqrt(cxx), np.sqrt(cyy)
        shear = np.arcsin(cxy / (along_x * along_y))
    return StrainTensor("engineering", along_x - 1, along_y - 1, shear / 2)


def half_logarithm(cxx: Floats, cyy: Floats, cxy: Floats) -> StrainTensor:
    """ln(C)/2 of symmetric 2x2 matrices, through their eigenvalues."""
    first, second, angle = StrainTensor("small", cxx, cyy, cxy).principal
    with np.errstate(invalid="ignore", divide="ignore"):
        h1, h2 = np.log(first) / 2, np.log(second) / 2
    cos, sin = np.cos(angle), np.sin(angle)
    return StrainTensor("hencky", h1 * cos**2 + h2 * sin**2, h1 * sin**2 + h2 * cos**2, (h1 - h2) * cos * sin)
