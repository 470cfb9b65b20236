"""The strain of an area: one affine displacement field through all its ZOIs, its uncertainty, and how well it fits.

Generalised least squares (A. C. Aitken, Proc. R. Soc. Edinburgh 55 (1935) 42-48) to the displacements and gradients
of the ZOIs: large areas take their strain from the displacements, small ones from the gradients. The noise is within
a tenth of that of one affine fit over the pixels.

How much it varies over the area, polynomials show through the displacements that the affine field leaves. Strain of the
second degree follows bending, a notch or a hole in the area; what repeats many times in it, as a weave does, it leaves
out. Weights follow from the grid alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.evaluate.affine import AffineFit, Places, affine_fit, covariance_of
from analysis.field import (
    PAIR_INDEX,
    CommonError,
    Measure,
    StrainField,
    combination,
    fixed_sums,
    strain_tensor,
)

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

GRADIENT = ("du_dx", "du_dy", "dv_dx", "dv_dy")
GRADIENTS = (*GRADIENT, "exx", "eyy", "exy", "gamma_xy", "omega")
"""Values that an area has by its affine field; its u and v are means."""
STRAINS = ("exx", "eyy", "exy", "gamma_xy")
"""Of these, those that a measure of strain is of."""
_AMONG = {1: 0, 2: 1, 4: 2, 5: 3}  # of the affine values, the gradients
_DISPLACEMENTS = [PAIR_INDEX[0, 0], PAIR_INDEX[3, 3]]  # variances of u and v among the 21 pairs
_POWERS = [(i, j) for i in range(4) for j in range(4 - i)]
_AFFINE = 2  # sum of the powers above which a monomial is not affine
_RANK = 1e-6  # singular values below this share of the largest are none


@dataclass(frozen=True, slots=True, eq=False)
class AreaStrain:
    """The affine displacement field of an area.

    Attributes
    ----------
    field : StrainField
    area, valid : (R, C) bool
        Its ZOIs, and those of them that have a value.
    fit : AffineFit
    fitted : (2, 3) float64
        Displacement in the middle (px), change along x and along y: of u, then of v.
    """

    field: StrainField
    area: Bools
    valid: Bools
    fit: AffineFit
    fitted: Floats

    @classmethod
    def of(cls, field: StrainField, where: ArrayLike | None = None) -> AreaStrain | None:
        """Strain of the active ZOIs of ``field``, or of those in ``where`` (R, C).

        None where none has a value, or where they have come apart (``StrainField.parts``).
        """
        area = field.grid.active if where is None else field.grid.active & np.asarray(where, bool)
        valid = area & field.ok
        if not valid.any() or field.n_parts(valid) > 1:
            return None
        fit = affine_fit(field, area, valid)
        fitted = fit.fitted(affine_values(field)[:, fit.at], valid.ravel()[fit.at])
        return cls(field, area, valid, fit, fitted.reshape(2, 3))

    def value(self, name: str) -> float:
        """A strain, in the measure of the field, or a gradient, by its name; one of ``GRADIENTS``."""
        return strain_of(name, self.field.measure, self.fitted[:, 1:].ravel().tolist())

    def sigma(self, name: str) -> float:
        """Standard uncertainty of ``value`` (of the small strain), the noise of the reference included."""
        valid = self.valid.ravel()[self.fit.at]
        variance, common = self.fit.variance(name, self.field, valid), self.field.common
        if common is not None:
            variance += self._variance_by(common, name)
        return math.sqrt(variance) if variance > 0 else 0.0

    def sigma_by(self, common: CommonError, name: str) -> float:
        """Standard uncertainty of ``value`` by an error that all ZOIs have in common."""
        return math.sqrt(max(self._variance_by(common, name), 0.0))

    def _variance_by(self, common: CommonError, name: str) -> float:
        shares = np.zeros((6, self.valid.size))
        shares[:, self.fit.at] = self.fit.weights(name, self.valid.ravel()[self.fit.at])
        return common.variance_of_sum(shares.reshape(6, *self.valid.shape))

    def unevenness(self) -> Unevenness:
        """How much the strain varies over the area."""
        grid = self.field.grid
        shapes = strain_shapes(Places.of(grid, self.field.window), self.area)
        if shapes is None:
            return Unevenness(math.nan, math.nan, math.nan)
        at = self.fit.at
        plane = np.stack([np.ones(len(at)), self.fit.x, self.fit.y])
        left = np.zeros((2, self.valid.size))
        left[:, at] = np.where(
            self.valid.ravel()[at], affine_values(self.field)[::3, at] - self.fitted @ plane, 0.0
        )
        here = np.where(self.valid, self.field.covariance[_DISPLACEMENTS], 0).reshape(2, -1)
        exx, eyy = variation(shapes.along_x, left[0]), variation(shapes.along_y, left[1])
        expected = math.fsum(fixed_sums(np.stack([shapes.noise_x, shapes.noise_y]) * here))
        return Unevenness(exx, eyy, math.hypot(exx, eyy) / math.sqrt(expected) if expected > 0 else math.nan)


@dataclass(frozen=True, slots=True)
class Unevenness:
    """How much strain varies over an area, as far as polynomials of the second degree follow it.

    Attributes
    ----------
    exx, eyy : float
        Root mean square about the strain of the area; NaN where it has too few ZOIs.
    misfit : float
        How far the area is from affine: that variation over what noise makes of it, about 1 for an affine field.
    """

    exx: float
    eyy: float
    misfit: float


def affine_values(field: StrainField) -> Floats:
    """Displacement and gradients, of u and then of v, (6, R C)."""
    half = len(field.parameters) // 2
    return np.asarray(field.parameters.reshape(2, half, -1)[:, :3].reshape(6, -1))


def strain_of(name: str, measure: Measure, gradient: Sequence[float]) -> float:
    """One of ``GRADIENTS`` of a field with the ``gradient`` du_dx, du_dy, dv_dx, dv_dy."""
    if measure != "small" and name in STRAINS:
        strain = strain_tensor(measure, *np.array(gradient)[:, None])
        return float(2 * strain.exy[0] if name == "gamma_xy" else getattr(strain, name)[0])
    return math.fsum(share * gradient[_AMONG[i]] for i, share in combination(name).items())


@dataclass(frozen=True, slots=True, eq=False)
class StrainShapes:
    """Functionals of the displacements of an area whose root sum of squares is the rms variation of strain.

    Attributes
    ----------
    along_x, along_y : (K, N) float64, 1/px
        For exx from u and for eyy from v, of all N ZOIs of the grid.
    noise_x, noise_y : (N,) float64, 1/px^2
        What the variance of a displacement adds to the sum of squares.
    """

    along_x: Floats
    along_y: Floats
    noise_x: Floats
    noise_y: Floats


def strain_shapes(places: Places, area: Bools) -> StrainShapes | None:
    """Shapes of the ZOIs of an area (R, C); None where they are too few or lie in a row."""
    return _shapes(places, area.tobytes())


@lru_cache(maxsize=16)
def _shapes(places: Places, area: bytes) -> StrainShapes | None:
    inside = np.frombuffer(area, np.bool_).reshape(places.shape)
    rows, columns = np.nonzero(inside)
    if np.unique(rows).size < 2 or np.unique(columns).size < 2 or rows.size < 2 * len(_POWERS):
        return None
    middle = np.array([[rows.mean()], [columns.mean()]])
    reach = max(np.ptp(rows), np.ptp(columns)) / 2
    y, x = (np.array([rows, columns]) - middle) / reach
    values = np.stack([x**i * y**j for i, j in _POWERS], axis=1)
    higher = [k for k, (i, j) in enumerate(_POWERS) if i + j >= _AFFINE]
    factors = np.linalg.pinv(values, rcond=_RANK)[higher]
    unit = 1 / (reach * places.step)
    slopes = [
        np.stack([i * x ** max(i - 1, 0) * y**j for i, j in _POWERS], axis=1)[:, higher] * unit,
        np.stack([j * x**i * y ** max(j - 1, 0) for i, j in _POWERS], axis=1)[:, higher] * unit,
    ]
    along = [_spread(_root(slope) @ factors, inside) for slope in slopes]
    noise = [_noise(maps, places) for maps in along]
    return StrainShapes(along[0], along[1], noise[0], noise[1])


def _root(slopes: Floats) -> Floats:
    """A matrix (K, K) with |root c| = rms of ``slopes`` (N, K) c about their mean."""
    about = (slopes - slopes.mean(axis=0)) / math.sqrt(len(slopes))
    return np.asarray(np.linalg.qr(about, mode="r"))


def _spread(rows: Floats, inside: Bools) -> Floats:
    out = np.zeros((len(rows), inside.size))
    out[:, inside.ravel()] = rows
    return out


def _noise(rows: Floats, places: Places) -> Floats:
    maps = np.zeros((len(rows), 3, *places.shape))
    maps[:, 0] = rows.reshape(-1, *places.shape)
    model = covariance_of(places)
    return np.asarray(np.sum(maps[:, 0] * model.times(maps)[:, 0], axis=0).ravel() / model.displacement)


def variation(shapes: Floats, left: Floats) -> float:
    """The rms variation of strain of what an affine field has ``left`` of the displacements, (N,) px."""
    return math.sqrt(math.fsum(fixed_sums(shapes * left) ** 2))
