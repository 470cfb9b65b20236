"""A pattern of known motion and strain, and how far off it is measured."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.field import Roi, Status, StrainField, Window, ZoiGrid

MARGIN = 24
"""Pixels of the picture around the ZOIs."""
STEP = 8
"""Pixels from one of the 2 x 2 ZOIs to the next."""
LEVEL_GL, CONTRAST_GL = 2000.0, 400.0
WAVES = 24
SLOWEST, FASTEST = 0.03, 0.12
"""Cycles per pixel of the waves of the pattern: what splines of degree 3 and 5 interpolate well."""
GOLDEN = math.pi * (3 - math.sqrt(5))
"""Turn from one wave to the next, so that the pattern has no direction."""
SMALLEST = 8
LARGEST = {"spectral": 128, "phase": 64}
"""Sides of ZOIs, px. The estimator by phases needs much more time for large ones."""
ERROR_PX = {1: 0.25, 3: 0.005, 5: 0.0005}
"""Largest error of a displacement by the degree of the spline. A machine that works shows up to half of it with
degree 1, which interpolates badly, and a twentieth with degree 5, which tests use."""


class Way(NamedTuple):
    """What of the settings the self-test depends on; ``size`` in px is that of a ZOI."""

    window: Window
    estimator: str
    order: int
    interpolant: int
    size: int

    @property
    def tested(self) -> Way:
        """The one that stands for it. Loops are the same for all sizes, only the time is not."""
        return self._replace(size=min(max(self.size, SMALLEST), LARGEST[self.estimator]))


Measure = Callable[[NDArray[np.float32], NDArray[np.float32], ZoiGrid, Way], StrainField]
"""Measures a deformed picture (the second) against a reference, in this way."""


class Motion(NamedTuple):
    """Displacement u, v at the middle of the picture in px, and its gradients."""

    u: float
    v: float
    du_dx: float
    du_dy: float
    dv_dx: float
    dv_dy: float


STILL = Motion(0, 0, 0, 0, 0, 0)
MOVED = Motion(2.37, -1.61, 0.021, 0.008, -0.017, -0.013)
"""Over a ZOI of usual size the gradients lead through most places between two pixels."""


class Errors(NamedTuple):
    """The largest of any ZOI, of u and v in px and of the four gradients; NaN where ZOIs have no value."""

    length: float
    slope: float
    refused: int


def limits(way: Way) -> Errors:
    """What a machine may be off: a gradient by what moves the edge of a ZOI as far as ``ERROR_PX``."""
    length = ERROR_PX[way.interpolant]
    return Errors(length, length / (way.size / 2), 0)


def errors_of(measure: Measure, way: Way) -> Errors:
    """How far off a known pattern is measured."""
    inside, side = way.size + STEP, way.size + STEP + 2 * MARGIN
    grid = ZoiGrid.cover(Roi(MARGIN, MARGIN, inside, inside), way.size, STEP)
    field = measure(picture(side, STILL), picture(side, MOVED), grid, way)
    middle = (side - 1) / 2
    x, y = np.meshgrid(grid.x - middle, grid.y - middle)
    length = np.stack([
        field.u - (MOVED.u + MOVED.du_dx * x + MOVED.du_dy * y),
        field.v - (MOVED.v + MOVED.dv_dx * x + MOVED.dv_dy * y),
    ])  # fmt: skip
    slope = [getattr(field, name) - getattr(MOVED, name) for name in Motion._fields[2:]]
    refused = int(np.count_nonzero(field.status != Status.OK))
    return Errors(float(np.abs(length).max()), float(np.abs(slope).max()), refused)


def picture(side: int, motion: Motion) -> NDArray[np.float32]:
    """A sum of plane waves, seen after the motion, (side, side) float32, GL.

    The place that is seen at a pixel follows from the inverse of the motion in closed form, so nothing is
    interpolated; a plane wave is a product of one along x and one along y, so little is computed.
    """
    at = np.arange(side) - (side - 1) / 2
    a, b, c, d = 1 + motion.du_dx, motion.du_dy, motion.dv_dx, 1 + motion.dv_dy
    scale = 1 / (a * d - b * c)
    n = np.arange(WAVES)
    k = 2 * math.pi * (SLOWEST + (FASTEST - SLOWEST) * (n + 0.5) / WAVES)
    kx, ky = k * np.cos(GOLDEN * n), k * np.sin(GOLDEN * n)
    along_x, along_y = scale * (d * kx - c * ky), scale * (a * ky - b * kx)
    phase = 1.7 * n**2 - along_x * motion.u - along_y * motion.v
    columns = np.exp(1j * np.multiply.outer(along_x, at))
    rows = np.exp(1j * (np.multiply.outer(along_y, at) + phase[:, None]))
    # No matrix product: this must be right where the linear algebra is not.
    waves = np.einsum("ky,kx->yx", rows.real, columns.real) - np.einsum("ky,kx->yx", rows.imag, columns.imag)
    return np.asarray(LEVEL_GL + CONTRAST_GL * math.sqrt(2 / WAVES) * waves, np.float32)
