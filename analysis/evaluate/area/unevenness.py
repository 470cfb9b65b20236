"""How much strain varies over an area: polynomials through the displacements that an affine field leaves.

Strain of the second degree follows bending, a notch or a hole in the area; what repeats many times in it, as a weave
does, it leaves out. Weights follow from the grid alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from analysis.evaluate.area.affine import Places, covariance_of
from analysis.field import fixed_sums

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_POWERS = [(i, j) for i in range(4) for j in range(4 - i)]
_AFFINE = 2  # sum of the powers above which a monomial is not affine
_RANK = 1e-6  # singular values below this share of the largest are none


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
    """Of the ZOIs of an area (R, C); None where they are too few or lie in a row."""
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
