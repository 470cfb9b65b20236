"""Lost ZOIs tried again: without extrapolation, from their neighbours, by a search."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.field import Status
from analysis.kernel.attempt import Attempt
from analysis.kernel.reference import Reference

Floats = NDArray[np.float64]

RESCUE_ROUNDS = 40
SEARCH_SHARE = 0.3
"""Share of lost ZOIs from which on the whole picture is searched again."""
_WORTH_RETRYING = np.isin(
    list(Status), (Status.LOST, Status.NOT_CONVERGED, Status.POOR_MATCH, Status.OUTSIDE)
)
"""By status."""
_DOWN, _RIGHT = (offset.ravel() - 1 for offset in np.indices((3, 3)))
"""Rows and columns to a ZOI's neighbours, itself among them."""


def rescue(attempt: Attempt, before: Floats | None, clipped: NDArray[np.bool_] | None = None) -> None:
    """Try lost ZOIs again from other guesses; a worse outcome does not replace a better one.

    Parameters
    ----------
    attempt : Attempt
    before : (A, modes), or None
        Parameters of the frame before; None: the guess of the attempt was searched for.
    clipped : (H, W) bool, or None
        Saturated pixels: a ZOI on them is refused, before it is tried again and after.
    """
    if clipped is not None:
        attempt.refuse_clipped(clipped)
    lost = _lost(attempt)
    if not lost.any():
        return
    _rescue(attempt, before)
    if clipped is not None:
        attempt.refuse_clipped(clipped, lost)


def _rescue(attempt: Attempt, before: Floats | None) -> None:
    reference = attempt.reference
    # Without its gradients a guess is right for ZOIs beside a discontinuity.
    displacements = np.arange(reference.modes) % (reference.modes // 2) == 0
    _retry(attempt, attempt.guess * displacements if before is None else before)
    _retry_from_neighbours(attempt)
    able = np.count_nonzero(reference.prepared.status == Status.OK)
    if before is not None and np.count_nonzero(_lost(attempt)) > SEARCH_SHARE * able:
        _retry(attempt, reference.searched(attempt.image))
        _retry_from_neighbours(attempt)


def _lost(attempt: Attempt) -> NDArray[np.bool_]:
    return np.asarray(_WORTH_RETRYING[attempt.status] & (attempt.reference.prepared.status == Status.OK))


def _retry(attempt: Attempt, guess: Floats) -> None:
    which = np.flatnonzero(_lost(attempt) & np.isfinite(guess).all(axis=1))
    if len(which):
        _retry_some(attempt, which, guess[which])


def _retry_some(attempt: Attempt, which: NDArray[np.intp], guess: Floats) -> None:
    found, status = attempt.tried(which, guess)
    good = np.flatnonzero(status == Status.OK)
    attempt.keep(which[good], found.at(good), status[good])


def _retry_from_neighbours(attempt: Attempt) -> None:
    """Let good ZOIs lend their shape to lost neighbours, round by round."""
    tried = np.zeros(len(attempt.status), np.uint8)
    places = _Places.of(attempt.reference)
    for _ in range(RESCUE_ROUNDS):
        lost = np.flatnonzero(_lost(attempt))
        guess, lenders = _lent(attempt, places, lost)
        fresh = np.isfinite(guess[:, 0]) & (lenders > tried[lost])
        if not fresh.any():
            return
        tried[lost] = lenders
        _retry_some(attempt, lost[fresh], guess[fresh])


class _Places(NamedTuple):
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
    def of(cls, reference: Reference) -> _Places:
        rows, columns = reference.grid.shape
        row, column = np.unravel_index(reference.index, (rows, columns))
        zoi = np.full((rows + 2, columns + 2), -1, np.intp)
        zoi[row + 1, column + 1] = np.arange(len(reference.index))
        return cls(zoi, row + 1, column + 1)


def _lent(attempt: Attempt, places: _Places, lost: NDArray[np.intp]) -> tuple[Floats, NDArray[np.uint8]]:
    """For each of the lost ZOIs (L,) the mean of what its good neighbours predict there, (L, modes), and their number.

    Of a ZOI's shape u, du_dx, du_dy, v, dv_dx, dv_dy count, moved by the step to the neighbour.
    """
    reference, step = attempt.reference, attempt.reference.grid.step
    good = np.append(attempt.status == Status.OK, False)  # the last for "none"
    zoi = places.zoi[places.row[lost, None] + _DOWN, places.column[lost, None] + _RIGHT]
    to, which = np.nonzero(good[zoi])
    lender = zoi[to, which]
    part = reference.total(attempt.found.p[lender], lender)[:, reference.affine]
    for r in (0, 3):
        part[:, r] -= step * (_RIGHT[which] * part[:, r + 1] + _DOWN[which] * part[:, r + 2])
    number = np.bincount(to, minlength=len(lost))
    total = np.stack([np.bincount(to, values, len(lost)) for values in part.T], axis=1)
    with np.errstate(invalid="ignore"):
        mean = np.where(number[:, None] > 0, total / np.maximum(number, 1)[:, None], np.nan)
    return reference.local(reference.all_modes(mean), lost), number.astype(np.uint8)
