"""A lens that bends straight lines: the model, and how its distortion is removed from a field.

A camera without distortion would show the place (x, y), px, where this one shows, with X = (x - x0)/f, Y likewise and
r^2 = X^2 + Y^2,

    x0 + f (X (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 X Y + p2 (r^2 + 2 X^2)),  and likewise along y:

D. C. Brown, Photogrammetric Engineering 32 (1966) 444-462, in the signs of OpenCV. A rigid shift then shows as strain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.evaluate import AreaStrain
from analysis.field import CommonError, StrainField, ZoiGrid, part_of
from analysis.optics.plane import affine_values
from analysis.optics.plates import PlateLayout

Floats = NDArray[np.float64]
LENS_NAMES = ("focal_px", "x0", "y0", "k1", "k2", "p1", "p2", "k3")
"""The parameters of a lens in their order; k and p are dimensionless, the others px."""
_ROUNDS, _MORE_ROUNDS = 6, 1  # of Newton: from the place itself, and from the place with nearly the same lens


class Straightened(NamedTuple):
    """Places as a camera without distortion shows them, px, and the derivatives of that by the places seen."""

    x: Floats
    y: Floats
    xx: Floats
    xy: Floats
    yx: Floats
    yy: Floats


@dataclass(frozen=True, slots=True, eq=False)
class LensModel:
    """A calibrated lens.

    Attributes
    ----------
    parameters : (8,) float64
        ``LENS_NAMES``.
    covariance : (8, 8) float64
        Of them.
    """

    parameters: Floats
    covariance: Floats

    def distorted(self, x: Floats, y: Floats) -> Straightened:
        """Where the lens shows places of a camera without distortion, px, and the derivatives."""
        focal, x0, y0, k1, k2, p1, p2, k3 = self.parameters
        a, b = (x - x0) / focal, (y - y0) / focal
        r2 = a * a + b * b
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3))
        seen_x = a * radial + 2 * p1 * a * b + p2 * (r2 + 2 * a * a)
        seen_y = b * radial + 2 * p2 * a * b + p1 * (r2 + 2 * b * b)
        cross = slope * a * b + 2 * p1 * a + 2 * p2 * b
        xx = radial + slope * a * a + 2 * p1 * b + 6 * p2 * a
        yy = radial + slope * b * b + 2 * p2 * a + 6 * p1 * b
        return Straightened(x0 + focal * seen_x, y0 + focal * seen_y, xx, cross, cross, yy)

    def straightened(self, x: Floats, y: Floats, start: Straightened | None = None) -> Straightened:
        """The inverse of ``distorted`` by Newton's method, from ``start`` where a similar lens gave it."""
        there_x, there_y = (x, y) if start is None else (start.x, start.y)
        for _ in range(_ROUNDS if start is None else _MORE_ROUNDS):
            seen, back = self._inverse(there_x, there_y)
            left_x, left_y = x - seen.x, y - seen.y
            there_x = there_x + back[0] * left_x + back[1] * left_y
            there_y = there_y + back[2] * left_x + back[3] * left_y
        return Straightened(there_x, there_y, *self._inverse(there_x, there_y)[1])

    def _inverse(self, x: Floats, y: Floats) -> tuple[Straightened, tuple[Floats, Floats, Floats, Floats]]:
        """``distorted``, and the inverse of its derivatives."""
        seen = self.distorted(x, y)
        area = seen.xx * seen.yy - seen.xy * seen.yx
        return seen, (seen.yy / area, -seen.xy / area, -seen.yx / area, seen.xx / area)

    def variations(self) -> list[LensModel]:
        """Lenses that are off by one standard uncertainty each, in directions that are independent of each other."""
        sigma = np.sqrt(np.diag(self.covariance))
        free = sigma > 0
        if not free.any():
            return []
        over = self.covariance[np.ix_(free, free)] / np.outer(sigma[free], sigma[free])
        values, vectors = np.linalg.eigh(over)
        steps = np.zeros((len(values), len(sigma)))
        steps[:, free] = (vectors * np.sqrt(np.maximum(values, 0.0))).T * sigma[free]
        return [replace(self, parameters=self.parameters + step) for step in steps]

    def is_single_valued(self, x: Floats, y: Floats) -> bool:
        """Whether each of these places of the picture shows one direction: the polynomials do not turn back before."""
        with np.errstate(all="ignore"):
            there = self.straightened(x, y)
            seen = self.distorted(there.x, there.y)
            far = np.hypot(seen.x - x, seen.y - y)
            area = seen.xx * seen.yy - seen.xy * seen.yx
        return bool(np.all(far < 1e-6) and np.all(area > 0))


class LensReading(NamedTuple):
    """The strain of the region that the lens made in one burst, with its standard uncertainty by the lens alone."""

    exx: float
    eyy: float
    sigma_exx: float
    sigma_eyy: float


class LensCorrection:
    """Removes the distortion of a lens from fields on one grid.

    Parameters
    ----------
    lens : LensModel
    grid : ZoiGrid
    layout : PlateLayout, optional
        Where the fields are of specimen and plates, ``layout.whole``.
    """

    def __init__(self, lens: LensModel, grid: ZoiGrid, layout: PlateLayout | None = None) -> None:
        self._lenses, self._layout = [lens, *lens.variations()], layout
        x, y = np.meshgrid(grid.x, grid.y)
        self._place = np.asarray(x, np.float64), np.asarray(y, np.float64)
        self._still = [one.straightened(*self._place) for one in self._lenses]

    def apply(self, field: StrainField) -> tuple[StrainField, LensReading]:
        """``field`` as a camera without distortion measures it, and what that changed.

        The places of the ZOIs stay those of the picture: the displacement is carried from where the camera without
        distortion would see the ZOI to there, by the gradient of the ZOI.
        """
        x, y = self._place
        values = affine_values(field)
        moved_x, moved_y = x + values[0], y + values[3]
        moved = self._lenses[0].straightened(moved_x, moved_y)
        found = self._seen(0, values, moved)
        shapes = np.zeros((len(self._lenses) - 1, 6, *field.grid.shape))
        for k, one in enumerate(self._lenses[1:], 1):
            other = self._seen(k, values, one.straightened(moved_x, moved_y, moved))
            shapes[k - 1] = np.nan_to_num(other - found)
        error = CommonError(shapes, np.eye(len(shapes)))
        half, parameters = len(field.parameters) // 2, field.parameters.copy()
        parameters[:3], parameters[half : half + 3] = found[:3], found[3:]
        corrected = replace(field, parameters=parameters, common=error.beside(field.common))
        return corrected, self._reading(field, corrected, error)

    def _seen(self, k: int, values: Floats, moved: Straightened) -> Floats:
        """u, du_dx, du_dy, v, dv_dx, dv_dy, (6, R, C), by lens ``k``."""
        (x, y), still = self._place, self._still[k]
        _, du_dx, du_dy, _, dv_dx, dv_dy = values
        area = still.xx * still.yy - still.xy * still.yx
        # From the straightened place to the seen one, through the deformation, and back: F = S1 (1 + grad u) S0^-1.
        a, b, c, d = still.yy / area, -still.xy / area, -still.yx / area, still.xx / area
        xx, xy = (1 + du_dx) * a + du_dy * c, (1 + du_dx) * b + du_dy * d
        yx, yy = dv_dx * a + (1 + dv_dy) * c, dv_dx * b + (1 + dv_dy) * d
        fxx, fxy = moved.xx * xx + moved.xy * yx - 1, moved.xx * xy + moved.xy * yy
        fyx, fyy = moved.yx * xx + moved.yy * yx, moved.yx * xy + moved.yy * yy - 1
        off_x, off_y = x - still.x, y - still.y
        u = moved.x - still.x + fxx * off_x + fxy * off_y
        v = moved.y - still.y + fyx * off_x + fyy * off_y
        return np.array([u, fxx, fxy, v, fyx, fyy])

    def _reading(self, before: StrainField, after: StrainField, error: CommonError) -> LensReading:
        if self._layout is not None:
            here, grid = self._layout.here, self._layout.specimen
            before, after = part_of(before, here, grid), part_of(after, here, grid)
            error = error.part(here.rows, here.columns)
        raw, area = AreaStrain.of(before), AreaStrain.of(after)
        if raw is None or area is None:
            return LensReading(math.nan, math.nan, math.nan, math.nan)
        made = [raw.value(name) - area.value(name) for name in ("exx", "eyy")]
        sigmas = [area.sigma_by(error, name) for name in ("exx", "eyy")]
        return LensReading(made[0], made[1], sigmas[0], sigmas[1])


def strain_of_shift(lens: LensModel, grid: ZoiGrid, shift_px: float) -> tuple[float, float]:
    """The largest strain of the region that the lens makes of a shift along x or y, and its standard uncertainty."""
    correction, found = LensCorrection(lens, grid), []
    for axis in ("u", "v"):
        still = StrainField.from_values(grid, {axis: np.full(grid.shape, shift_px)})
        read = correction.apply(still)[1]
        found += [(abs(read.exx), read.sigma_exx), (abs(read.eyy), read.sigma_eyy)]
    return max(strain for strain, _ in found), max(sigma for _, sigma in found)
