"""What a perfect kernel measures between two pictures of a plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.field import StrainField, ZoiGrid
from hw_mocks.deformation import Deformation

NAMES = ("u", "du_dx", "du_dy", "v", "dv_dx", "dv_dy")


def seen_between(before: Deformation, after: Deformation, grid: ZoiGrid) -> StrainField:
    """Both displace the places of the plane, whose first picture is the reference."""
    x, y = np.meshgrid(grid.x, grid.y)
    flat_x, flat_y = x.copy(), y.copy()  # places of the plane that are seen at the ZOIs
    for _ in range(12):
        u, v = before.displacement(flat_x, flat_y)
        flat_x, flat_y = x - u, y - v
    u, v = after.displacement(flat_x, flat_y)
    first, last = (_matrix(one.gradient(flat_x, flat_y)) for one in (before, after))
    gradient = np.moveaxis(last @ np.linalg.inv(first) - np.eye(2), (-2, -1), (0, 1))
    values = (flat_x + u - x, gradient[0, 0], gradient[0, 1], flat_y + v - y, gradient[1, 0], gradient[1, 1])
    return StrainField.from_values(grid, dict(zip(NAMES, values, strict=True)), 1e-3)


def _matrix(gradient: tuple[NDArray[np.float64], ...]) -> NDArray[np.float64]:
    a, b, c, d = gradient
    return np.moveaxis(np.array([[1 + a, b], [c, 1 + d]]), (0, 1), (-2, -1))
