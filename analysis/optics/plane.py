"""The apparent motion of a rigid plane in the pictures of one camera: a homography.

With places (X, Y) about a centre, over a length L, a plane that was square to the camera and moved a little shows

    u / L = q0 + (q2 + q6) X + (q7 - q3) Y + (q4 X + q5 Y) X
    v / L = q1 + (q2 - q6) Y + (q7 + q3) X + (q4 X + q5 Y) Y

to the first order: shift (q0, q1), scale q2, turn q3, keystone (q4, q5) of a tilt, stretch and shear (q6, q7), which
a rigid plane shows only where the camera is not square to it. Applied exactly: R. Hartley, A. Zisserman, Multiple View
Geometry in Computer Vision, 2nd ed. (2004), section 2.4.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from analysis.field import StrainField

Floats = NDArray[np.float64]
Model = Literal["scale", "pose", "homography"]
MODELS: dict[Model, int] = {"scale": 4, "pose": 6, "homography": 8}
"""How many of the parameters are fitted, the others being 0."""
NAMES = ("shift_x", "shift_y", "scale", "turn", "keystone_x", "keystone_y", "stretch", "shear")
SCALE, KEYSTONE, STRETCH = 2, (4, 5), (6, 7)


def shapes(x: Floats, y: Floats, length: float) -> Floats:
    """u, du_dx, du_dy, v, dv_dx, dv_dy of each parameter at 1, to the first order, (8, 6, ...).

    Parameters
    ----------
    x, y : array
        Places over ``length``.
    length : float, px
    """
    one, no = np.ones_like(x), np.zeros_like(x)
    rows = [
        (length * one, no, no, no, no, no),
        (no, no, no, length * one, no, no),
        (length * x, one, no, length * y, no, one),
        (-length * y, no, -one, length * x, one, no),
        (length * x * x, 2 * x, no, length * x * y, y, x),
        (length * x * y, y, x, length * y * y, no, 2 * y),
        (length * x, one, no, -length * y, no, -one),
        (length * y, no, one, length * x, one, no),
    ]
    return np.array(rows)


@dataclass(frozen=True, slots=True, eq=False)
class ApparentMotion:
    """What a rigid plane does in the picture.

    Attributes
    ----------
    parameters : (8,) float64
        ``NAMES``, dimensionless.
    centre : (x, y), px
    length : float, px
    """

    parameters: Floats
    centre: tuple[float, float]
    length: float

    @property
    def matrix(self) -> Floats:
        """The homography of (X, Y, 1)."""
        shift_x, shift_y, scale, turn, key_x, key_y, stretch, shear = self.parameters
        return np.array(
            [
                [1 + scale + stretch, shear - turn, shift_x],
                [shear + turn, 1 + scale - stretch, shift_y],
                [-key_x, -key_y, 1.0],
            ]
        )

    def places(self, field: StrainField) -> tuple[Floats, Floats]:
        """(X, Y) of the ZOIs of ``field``, (R, C)."""
        x, y = np.meshgrid(field.grid.x - self.centre[0], field.grid.y - self.centre[1])
        return x / self.length, y / self.length

    def at(self, x: Floats, y: Floats) -> Floats:
        """u, du_dx, du_dy, v, dv_dx, dv_dy at places, (6, ...)."""
        moved_x, moved_y, (xx, xy, yx, yy) = _projected(self.matrix, x, y)
        return np.array([(moved_x - x) * self.length, xx - 1, xy, (moved_y - y) * self.length, yx, yy - 1])

    def removed_from(self, field: StrainField) -> StrainField:
        """``field`` as a camera sees it that moves with the plane; its uncertainty stays as it is."""
        x, y = self.places(field)
        half = len(field.parameters) // 2
        u, du_dx, du_dy, v, dv_dx, dv_dy = affine_values(field)
        back_x, back_y, (xx, xy, yx, yy) = _projected(
            np.asarray(np.linalg.inv(self.matrix), np.float64), x + u / self.length, y + v / self.length
        )
        stretch_x, stretch_y = 1 + du_dx, 1 + dv_dy
        parameters = field.parameters.copy()
        parameters[:3] = (
            (back_x - x) * self.length,
            xx * stretch_x + xy * dv_dx - 1,
            xx * du_dy + xy * stretch_y,
        )
        parameters[half : half + 3] = (
            (back_y - y) * self.length,
            yx * stretch_x + yy * dv_dx,
            yx * du_dy + yy * stretch_y - 1,
        )
        return replace(field, parameters=parameters)


def affine_values(field: StrainField) -> Floats:
    """u, du_dx, du_dy, v, dv_dx, dv_dy of a field of either order, (6, R, C)."""
    half = len(field.parameters) // 2
    return np.concatenate([field.parameters[:3], field.parameters[half : half + 3]])


def _projected(matrix: Floats, x: Floats, y: Floats) -> tuple[Floats, Floats, tuple[Floats, ...]]:
    """Where a homography brings places, and the derivatives of that."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    depth = g * x + h * y + i
    px, py = (a * x + b * y + c) / depth, (d * x + e * y + f) / depth
    gradient = (a - g * px) / depth, (b - h * px) / depth, (d - g * py) / depth, (e - h * py) / depth
    return px, py, gradient
