"""The signatures of motion off the plane in a field without load: strains alike in x and y, even or rising evenly.

Motion along the axis shows exx = eyy. A tilt shows a scale that rises evenly over the picture (keystone): along x
u = k x^2 and v = k x y, so that both displacements give the same k; in-plane bending gives them opposite signs.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.field import PAIR_INDEX, StrainField
from analysis.optics.plane import affine_values

Floats = NDArray[np.float64]
ALIKE = 2.0
"""Two values are alike where their mean is beyond this times half their difference."""
_MIN_ZOIS = 12


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
