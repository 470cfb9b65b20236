"""What the neighbours of a ZOI predict there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.kernel.reference import ReferencePicture
from analysis.kernel.solve import Solution

Floats = NDArray[np.float64]

_DOWN, _RIGHT = (offset.ravel() - 1 for offset in np.indices((3, 3)))
"""Rows and columns to a ZOI's neighbours, itself among them."""


class Neighbours(NamedTuple):
    """Where the ZOIs lie on the grid.

    Attributes
    ----------
    zoi : (R + 2, C + 2)
        Which of the active ZOIs, -1 for none; the grid begins at (1, 1).
    row, column : (A,)
        Of each active ZOI in ``zoi``.
    """

    zoi: NDArray[np.intp]
    row: NDArray[np.intp]
    column: NDArray[np.intp]

    @classmethod
    def of(cls, reference: ReferencePicture) -> Neighbours:
        """Those of the active ZOIs."""
        rows, columns = reference.grid.shape
        row, column = np.unravel_index(reference.index, (rows, columns))
        zoi = np.full((rows + 2, columns + 2), -1, np.intp)
        zoi[row + 1, column + 1] = np.arange(len(reference.index))
        return cls(zoi, row + 1, column + 1)

    def lent(
        self, solution: Solution, which: NDArray[np.intp], lenders: NDArray[np.bool_]
    ) -> tuple[Floats, NDArray[np.uint8]]:
        """For each ZOI of ``which`` (L,) the mean of what its neighbours predict there, (L, modes), and their number.

        Of a neighbour's shape u, du_dx, du_dy, v, dv_dx, dv_dy count, moved by the step to the ZOI. ``lenders`` (A,)
        are the neighbours that count; NaN where there is none.
        """
        reference, step = solution.reference, solution.reference.grid.step
        good = np.append(lenders, False)  # the last for "none"
        zoi = self.zoi[self.row[which, None] + _DOWN, self.column[which, None] + _RIGHT]
        to, way = np.nonzero(good[zoi])
        lender = zoi[to, way]
        part = reference.total(solution.found.p[lender], lender)[:, reference.affine]
        for r in (0, 3):
            part[:, r] -= step * (_RIGHT[way] * part[:, r + 1] + _DOWN[way] * part[:, r + 2])
        number = np.bincount(to, minlength=len(which))
        total = np.stack([np.bincount(to, values, len(which)) for values in part.T], axis=1)
        with np.errstate(invalid="ignore"):
            mean = np.where(number[:, None] > 0, total / np.maximum(number, 1)[:, None], np.nan)
        return reference.local(reference.all_modes(mean), which), number.astype(np.uint8)
