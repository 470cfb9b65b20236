"""The apparent motion of a rigid plane in the pictures of one camera: a homography.

With places (X, Y) about a centre, over a length L, a plane that was square to the camera and moved a little shows

    u / L = q0 + (q2 + q6) X + (q7 - q3) Y + (q4 X + q5 Y) X
    v / L = q1 + (q2 - q6) Y + (q7 + q3) X + (q4 X + q5 Y) Y

to the first order: shift (q0, q1), scale q2, turn q3, keystone (q4, q5) of a tilt, stretch and shear (q6, q7), which
a rigid plane shows only where the camera is not square to it. Applied exactly: R. Hartley, A. Zisserman, Multiple View
Geometry in Computer Vision, 2nd ed. (2004), section 2.4.

In a field without load motion along the axis shows exx = eyy. A tilt shows a scale that rises evenly over the picture:
along x u = k x^2 and v = k x y, so that both displacements give the same k; in-plane bending gives them opposite signs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.field import PAIR_INDEX, StrainField

Floats = NDArray[np.float64]
ALIKE = 2.0
"""Two values are alike where their mean is beyond this times half their difference."""
_MIN_ZOIS = 12


Model = Literal["scale", "pose", "homography"]
MODELS: dict[Model, int] = {"scale": 4, "pose": 6, "homography": 8}
"""How many of the parameters are fitted, the others being 0."""
NAMES = ("shift_x", "shift_y", "scale", "turn", "keystone_x", "keystone_y", "stretch", "shear")
SCALE, KEYSTONE, STRETCH = 2, (4, 5), (6, 7)


def alike(one: float, other: float, noise: float) -> float:
    """What two values have in common, their mean; 0 where they differ, or where it is not beyond ``noise``."""
    both, half = (one + other) / 2, abs(one - other) / 2
    return both if abs(both) > max(ALIKE * half, noise) else 0.0


class Keystone(NamedTuple):
    """How the mean of exx and eyy rises from one side of the region to the other, as u and as v show it.

    Attributes
    ----------
    by_u, by_v : float
        NaN where there are too few ZOIs.
    sigma : float
        Standard uncertainty of the less certain one.
    px : float, px
        From side to side.
    """

    by_u: float
    by_v: float
    sigma: float
    px: float

    @property
    def rise(self) -> float:
        """Rise of both; 0 where they differ."""
        return alike(self.by_u, self.by_v, 0.0)

    def tilt(self, focal_px: float) -> float:
        """The tilt that makes ``rise``, rad, of a camera at ``focal_px`` (distance over the size of a pixel)."""
        return self.rise / (1.5 * self.px) * focal_px


def keystones(field: StrainField) -> tuple[Keystone, Keystone]:
    """Along x and along y, from polynomials of the second degree through u and v of the valid ZOIs."""
    ok, grid = field.ok, field.grid
    width, height = (max(float(np.ptp(place)), grid.step) for place in (grid.x, grid.y))
    if ok.sum() < _MIN_ZOIS:
        nothing = Keystone(math.nan, math.nan, math.nan, width)
        return nothing, nothing._replace(px=height)
    x, y = np.meshgrid((grid.x - grid.x.mean()) / width, (grid.y - grid.y.mean()) / height)
    x, y = x[ok], y[ok]
    weights = np.linalg.pinv(np.stack([np.ones(x.size), x, y, x * x, x * y, y * y], axis=1))
    u, v = affine_values(field)[[0, 3]][:, ok]
    variance = float(np.mean(field.covariance[[PAIR_INDEX[0, 0], PAIR_INDEX[3, 3]]][:, ok]))
    # Neighbours that overlap have noise in common: as many are independent as lie side by side.
    noise = math.sqrt(variance) * max(grid.size / grid.step, 1.0)
    (u_xx, u_xy), (v_xy, v_yy) = weights[3:5] @ u, weights[4:6] @ v
    s_xx, s_xy, s_yy = (noise * float(np.linalg.norm(row)) for row in weights[3:6])
    # With k in 1/px, u = k x^2 is u_xx = k W^2, and v = k x y is v_xy = k W H; the mean strain rises by 1.5 k W.
    along_x = Keystone(1.5 * u_xx / width, 1.5 * v_xy / height, 1.5 * max(s_xx / width, s_xy / height), width)
    along_y = Keystone(
        1.5 * u_xy / width, 1.5 * v_yy / height, 1.5 * max(s_xy / width, s_yy / height), height
    )
    return along_x, along_y


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
