"""Going on from a renewed reference: results stay composed on the original grid.

When the pattern has changed too much to be compared with the first picture, a later picture takes
its place. Each ZOI of the new picture is placed on the whole pixel nearest to where the material
of the original ZOI then was; what is measured from there is composed with what was measured before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.field import PAIR_INDEX, Roi, Status, StrainField

Floats = NDArray[np.float64]

UNSHARED = 0.15
"""Share of the renewed picture's noise that does not cancel between the two measurements it enters."""


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """Where the ZOIs of a renewed reference stand, and what was measured up to there; A active ZOIs.

    Attributes
    ----------
    base : (A, modes) float64
        Parameters of the field at the renewal; NaN for a ZOI that was not valid then.
    offset : (A, 2) float64, px
        From the centre of the new ZOI to the material point of the original centre (x, y).
    origins : (A, 2) int64
        First row and column of each new ZOI, moved into the image where need be.
    covariance : (A, 21) float64
        What the noise of the earlier references has left in ``base``.
    status : (A,) uint8
        Of the field at the renewal; OUTSIDE where the new ZOI does not fit into the image.
    """

    base: Floats
    offset: Floats
    origins: NDArray[np.int64]
    covariance: Floats
    status: NDArray[np.uint8]

    def at(self, places: NDArray[np.intp] | slice) -> Placement:
        """That of some of the ZOIs."""
        if isinstance(places, slice) and places == slice(None):
            return self
        return Placement(
            self.base[places], self.offset[places], self.origins[places], self.covariance[places],
            self.status[places],
        )  # fmt: skip

    def compose(self, local: Floats) -> Floats:
        """Parameters against the original reference, (A, modes), from those against the renewed one."""
        out = local + self.base
        half = local.shape[1] // 2
        here, before = _gradient(local), _gradient(self.base)
        moved = np.einsum("aij,aj->ai", here, self.offset)
        total = here + before + here @ before
        for r in (0, 1):
            out[:, r * half] += moved[:, r]
            out[:, r * half + 1 : r * half + 3] = total[:, r]
        return out

    def locate(self, total: Floats) -> Floats:
        """The inverse of ``compose``."""
        out = total - self.base
        half = total.shape[1] // 2
        one = np.eye(2)
        before, after = one + _gradient(self.base), one + _gradient(total)
        known = np.isfinite(before).all(axis=(1, 2))
        before[~known] = one
        here = after @ np.linalg.inv(before) - one
        moved = np.einsum("aij,aj->ai", here, self.offset)
        for r in (0, 1):
            out[:, r * half] -= moved[:, r]
            out[:, r * half + 1 : r * half + 3] = here[:, r]
        out[~known] = np.nan
        return out

    def spread(self, local: Floats, covariance: NDArray[np.float32]) -> NDArray[np.float32]:
        """A covariance (A, 21) of local parameters as one of composed parameters."""
        stretch = np.zeros((len(local), 6, 6))
        before = np.eye(2) + np.nan_to_num(_gradient(self.base))
        for r in (0, 3):
            stretch[:, r, r] = 1
            stretch[:, r + 1 : r + 3, r + 1 : r + 3] = before.transpose(0, 2, 1)
        return _packed(stretch @ _unpacked(covariance) @ stretch.transpose(0, 2, 1))

    def carried(self, local: Floats) -> NDArray[np.float32]:
        """The covariance of ``base`` as it stands in the composed parameters, (A, 21)."""
        turn = np.zeros((len(local), 6, 6))
        here = np.nan_to_num(_gradient(local))
        turn[:, 0, 0] = turn[:, 3, 3] = 1
        for i in (1, 2):
            for r in (0, 1):
                for c in (0, 1):
                    turn[:, 3 * r + i, 3 * c + i] = (r == c) + here[:, r, c]
        return _packed(turn @ _unpacked(self.covariance) @ turn.transpose(0, 2, 1))

    def region(self, size: int, shape: tuple[int, int]) -> Roi:
        """The rectangle of the renewed picture that holds the ZOIs that can be measured."""
        good = self.status == Status.OK
        origins = self.origins[good] if good.any() else self.origins
        top, left = origins.min(axis=0)
        bottom, right = origins.max(axis=0) + size
        return Roi(int(left), int(top), int(min(right, shape[1]) - left), int(min(bottom, shape[0]) - top))


def place(field: StrainField, index: NDArray[np.intp], modes: int, shape: tuple[int, int]) -> Placement:
    """Place the ZOIs of a grid in the picture that ``field`` was measured on.

    Parameters
    ----------
    field : StrainField
    index : (A,) flat indices of the active ZOIs
    modes : 6 or 12
    shape : (H, W) of the picture
    """
    grid, size = field.grid, field.grid.size
    base = taken(field.parameters, index, modes)
    status = field.status.ravel()[index].copy()
    rows, columns = np.unravel_index(index, grid.shape)
    centre = np.stack([grid.x[columns], grid.y[rows]], axis=1)
    target = centre + np.nan_to_num(base[:, [0, modes // 2]])
    first = np.rint(target - (size - 1) / 2).astype(np.int64)
    last = np.array([shape[1] - size, shape[0] - size])
    status[(status == Status.OK) & ((first < 0) | (first > last)).any(axis=1)] = Status.OUTSIDE
    first = np.clip(first, 0, last)
    offset = target - (first + (size - 1) / 2)
    covariance = field.covariance_reference.reshape(21, -1)[:, index].T.astype(np.float64)
    origins = np.ascontiguousarray(first[:, ::-1])
    return Placement(base, offset, origins, np.nan_to_num(covariance), status)


def taken(values: Floats, index: NDArray[np.intp], modes: int) -> Floats:
    """(6 or 12, R, C) as (A, modes); modes that are not there are zero, those not wanted dropped.

    Where nothing is to be left out this is the same memory.
    """
    half, own = modes // 2, len(values) // 2
    if len(values) == modes and len(index) == values[0].size:
        return values.reshape(modes, -1).T
    out = np.zeros((len(index), modes))
    flat = values.reshape(2, own, -1)[:, :, index]
    keep = min(half, own)
    for c in range(2):
        out[:, c * half : c * half + keep] = flat[c, :keep].T
    return out


def _gradient(p: Floats) -> Floats:
    half = p.shape[1] // 2
    return np.stack([p[:, 1:3], p[:, half + 1 : half + 3]], axis=1)


def _unpacked(covariance: NDArray[np.floating]) -> Floats:
    out = np.empty((len(covariance), 6, 6))
    for (i, j), k in PAIR_INDEX.items():
        out[:, i, j] = covariance[:, k]
    return out


def _packed(matrix: Floats) -> NDArray[np.float32]:
    out = np.empty((len(matrix), 21), np.float32)
    for (i, j), k in PAIR_INDEX.items():
        out[:, k] = matrix[:, i, j]
    return out
