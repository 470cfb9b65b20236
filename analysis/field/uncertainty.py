"""Values as combinations of the fitted parameters, and the variance of their sums over overlapping ZOIs.

Also the finite strain measures, since the names of values refer to them: small, engineering, Green-Lagrange, Hencky.

An error that all ZOIs of a field have in common, of a correction that was applied to all of them.

The error of a picture beside its noise: how much it is, what made it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from analysis.field.grid import Window, ZoiGrid, overlap

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class CommonError:
    """What the noise of the parameters of a correction makes of each ZOI.

    Attributes
    ----------
    shapes : (K, 6, R, C) float64
        Of u, du_dx, du_dy, v, dv_dx, dv_dy by each parameter.
    covariance : (K, K) float64
        Of the parameters.
    """

    shapes: Floats
    covariance: Floats

    def variance(self, name: str) -> Floats:
        """Variance of a value of each ZOI, (R, C)."""
        of_value = sum(share * self.shapes[:, i] for i, share in combination(name).items())
        return np.asarray(np.einsum("krc,kl,lrc->rc", of_value, self.covariance, of_value))

    def variance_of_sum(self, weights: Floats) -> float:
        """Variance of the sum of the six parameters of all ZOIs times ``weights`` (6, R, C)."""
        made = np.einsum("kirc,irc->k", self.shapes, weights)
        return float(made @ self.covariance @ made)

    def beside(self, other: CommonError | None) -> CommonError:
        """Both errors, which have nothing to do with each other."""
        if other is None:
            return self
        k, n = len(self.covariance), len(self.covariance) + len(other.covariance)
        covariance = np.zeros((n, n))
        covariance[:k, :k], covariance[k:, k:] = self.covariance, other.covariance
        return CommonError(np.concatenate([self.shapes, other.shapes]), covariance)

    def part(self, rows: slice, columns: slice) -> CommonError:
        """The error of some rows and columns of ZOIs."""
        return CommonError(self.shapes[:, :, rows, columns], self.covariance)


Cause = Literal["", "noise", "compression", "bands", "blur", "filter"]


@dataclass(frozen=True, slots=True)
class PictureError:
    """What the fits of a picture leave in common, over what its noise as given (or as its reference shows) explains.

    Attributes
    ----------
    over_noise : float
        Standard deviation over that expected.
    colour : tuple of two floats
        Variance of u and of v over that of white noise of this strength.
    cause : str
        What it looks like where ``factor`` exceeds ``LIMIT``: "noise", "compression" (blocks of 8 px), "bands" (rows
        or columns), "blur" (or sharpening), "filter" (not white), else "".
    """

    over_noise: float
    colour: tuple[float, float]
    cause: Cause = ""

    @property
    def factor(self) -> float:
        """Uncertainty of a value over that from the noise as given."""
        return float(self.over_noise * max(self.colour) ** 0.5)


LIMIT = 1.5
"""Factor of the uncertainty from which on the picture is another than its noise says."""


Item = TypeVar("Item")
Measure = Literal["small", "engineering", "green", "hencky"]
U, DU_DX, DU_DY, V, DV_DX, DV_DY = range(6)
STRETCH = 0.01
"""Largest gradient up to which u and v are as uncertain as the step of the fit."""
PARTIAL_SUMS = 64
"""Sums that run side by side in ``fixed_sum``."""
_PAIRS = [(i, j) for i in range(6) for j in range(i, 6)]
PAIR_INDEX = {pair: k for k, pair in enumerate(_PAIRS)} | {(j, i): k for k, (i, j) in enumerate(_PAIRS)}
"""Where the covariance of parameters i and j stands among the 21 of ``StrainField.covariance``."""
# Each named value as a linear combination of u, du_dx, du_dy, v, dv_dx, dv_dy.
_COMBINATIONS: Mapping[str, Mapping[int, float]] = {
    "u": {U: 1.0},
    "v": {V: 1.0},
    "du_dx": {DU_DX: 1.0},
    "du_dy": {DU_DY: 1.0},
    "dv_dx": {DV_DX: 1.0},
    "dv_dy": {DV_DY: 1.0},
    "exx": {DU_DX: 1.0},
    "eyy": {DV_DY: 1.0},
    "exy": {DU_DY: 0.5, DV_DX: 0.5},
    "gamma_xy": {DU_DY: 1.0, DV_DX: 1.0},
    "omega": {DU_DY: -0.5, DV_DX: 0.5},
}
VALUES = tuple(_COMBINATIONS)
"""Names of all values."""


def combination(name: str) -> Mapping[int, float]:
    """A named value as {parameter index: factor}.

    Raises
    ------
    ValueError
        Unknown name; the message lists the known ones.
    """
    if name not in _COMBINATIONS:
        raise ValueError(f"unknown value {name!r}; known: {', '.join(VALUES)}")
    return _COMBINATIONS[name]


@lru_cache(maxsize=len(VALUES))
def products(name: str) -> tuple[tuple[int, float], ...]:
    """The variance of a named value as (which of the 21 covariances, factor); raises as ``combination``."""
    terms = combination(name).items()
    return tuple((PAIR_INDEX[i, j], a * b) for i, a in terms for j, b in terms)


def stretched(
    covariances: tuple[NDArray[np.float32], NDArray[np.float32]], parameters: Floats
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Two covariances of the fit, (21, R, C) each, as those of u, v and their gradients.

    The fit is made where the warped picture differs: its step of (u, v), and of their gradients, moves by
    F = I + grad u in the deformed picture. Below ``STRETCH`` nothing is done.

    Parameters
    ----------
    covariances : (21, R, C) each
    parameters : (6, R, C)
        u, du_dx, du_dy, v, dv_dx, dv_dy.
    """
    gradients = parameters[[DU_DX, DU_DY, DV_DX, DV_DY]]
    if not max(np.fmax.reduce(gradients, axis=None), -np.fmin.reduce(gradients, axis=None)) > STRETCH:
        return covariances
    f = np.asarray(gradients + np.array([1, 0, 0, 1])[:, None, None], np.float32).reshape(
        2, 2, *gradients.shape[1:]
    )
    return _turned(covariances[0], f), _turned(covariances[1], f)


def _turned(covariance: NDArray[np.float32], f: NDArray[np.float32]) -> NDArray[np.float32]:
    """A covariance (21, R, C) of (u, v) and its gradients, each multiplied by ``f`` (2, 2, R, C)."""
    out = np.empty_like(covariance)
    for pair, (i, j) in enumerate(_PAIRS):
        (row, first), (column, second) = divmod(i, 3), divmod(j, 3)
        out[pair] = sum(
            f[row, a] * f[column, b] * covariance[PAIR_INDEX[3 * a + first, 3 * b + second]]
            for a in (0, 1) for b in (0, 1)
        )  # fmt: skip
    return out


class Sums(Protocol):
    """The noise of means, more exactly than from the overlap of windows."""

    def factor(self, name: str, where: NDArray[np.bool_]) -> float:
        """Standard deviation of the mean of ``name`` over a gauge (R, C), over that of ``variance_of_sum``."""
        ...

    def information(self, at: NDArray[np.intp]) -> Floats:
        """Inverse covariance of the six affine values of ZOIs at flat places (n,), up to a factor, (6, 6, n).

        Zero where a ZOI has no pattern.
        """
        ...

    def variance(self, at: NDArray[np.intp], weights: Floats) -> float:
        """Variance of a sum of the six affine values of ZOIs by ``weights`` (6, n), for noise of 1 GL."""
        ...

    def unit_variances(self, at: NDArray[np.intp]) -> Floats:
        """Variances of u and v of ZOIs, (2, n), for noise of 1 GL."""
        ...

    def kept(self, key: Hashable, make: Callable[[], Item]) -> Item:
        """What ``make`` gives, remembered as long as the reference holds."""
        ...


def variance_of_sum(sigma: Floats, name: str, grid: ZoiGrid, window: Window) -> float:
    """Variance of the sum of one value over all ZOIs: sum of sigma_i sigma_j rho(lag_ij).

    rho is a product of one correlation along x and one along y for each parameter; the two
    parts of exy and omega are equally strong and uncorrelated for a pattern without direction.
    """
    terms = combination(name)
    total = 0.0
    for parameter in terms:
        along_y, along_x = _correlations(grid.shape, window, grid.size, grid.step, parameter % 3)
        total += float(np.sum(sigma * (along_y @ sigma @ along_x))) / len(terms)
    return total


@lru_cache(maxsize=64)
def _correlations(
    shape: tuple[int, int], window: Window, size: int, step: int, kind: int
) -> tuple[Floats, Floats]:
    """Correlation matrices (R, R) and (C, C) of a displacement (0), an x (1) or a y gradient (2)."""
    along = [int(kind == 2), int(kind == 1)]
    rho = [overlap(window, size, step, n, moment) for n, moment in zip(shape, along, strict=True)]
    lags = [np.abs(np.subtract.outer(np.arange(n), np.arange(n))) for n in shape]
    return rho[0][lags[0]], rho[1][lags[1]]


def fixed_sum(values: Floats) -> float:
    """The sum of (N,) values, added in an order that no memory alignment changes: the same bits everywhere."""
    return float(fixed_sums(values[None])[0])


def fixed_sums(values: Floats) -> Floats:
    """``fixed_sum`` of each row of (K, N), (K,)."""
    whole = values.shape[1] // PARTIAL_SUMS * PARTIAL_SUMS
    parts = np.ascontiguousarray(values[:, :whole]).reshape(len(values), -1, PARTIAL_SUMS).sum(axis=1)
    return np.array([math.fsum([*row, *rest]) for row, rest in zip(parts, values[:, whole:], strict=True)])


def strain_tensor(
    measure: Measure, du_dx: Floats, du_dy: Floats, dv_dx: Floats, dv_dy: Floats
) -> StrainTensor:
    """The strain of displacement gradients, each of one shape, in a measure (``StrainField.strain``)."""
    if measure == "small":
        return StrainTensor(measure, du_dx, dv_dy, (du_dy + dv_dx) / 2)
    if measure not in ("engineering", "green", "hencky"):
        raise ValueError(f"unknown strain measure {measure!r}; known: small, engineering, green, hencky")
    cxx = (1 + du_dx) ** 2 + dv_dx**2
    cyy = du_dy**2 + (1 + dv_dy) ** 2
    cxy = (1 + du_dx) * du_dy + dv_dx * (1 + dv_dy)
    if measure == "green":
        return StrainTensor(measure, (cxx - 1) / 2, (cyy - 1) / 2, cxy / 2)
    return elongations(cxx, cyy, cxy) if measure == "engineering" else half_logarithm(cxx, cyy, cxy)


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
    """Engineering strain, from C = F^T F: the elongation of lines that lay along x and y, over their length.

    exy is half of the change of the right angle between the two. No rotation changes any of it.
    """
    with np.errstate(invalid="ignore"):
        along_x, along_y = np.sqrt(cxx), np.sqrt(cyy)
        shear = np.arcsin(cxy / (along_x * along_y))
    return StrainTensor("engineering", along_x - 1, along_y - 1, shear / 2)


def half_logarithm(cxx: Floats, cyy: Floats, cxy: Floats) -> StrainTensor:
    """Hencky strain, ln(C)/2 of symmetric 2x2 matrices, through their eigenvalues."""
    first, second, angle = StrainTensor("small", cxx, cyy, cxy).principal
    with np.errstate(invalid="ignore", divide="ignore"):
        h1, h2 = np.log(first) / 2, np.log(second) / 2
    cos, sin = np.cos(angle), np.sin(angle)
    return StrainTensor("hencky", h1 * cos**2 + h2 * sin**2, h1 * sin**2 + h2 * cos**2, (h1 - h2) * cos * sin)
