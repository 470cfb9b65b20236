"""Lost ZOIs tried again: without extrapolation, from their neighbours, by a search."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.field import Status
from analysis.kernel.attempt import Attempt

Floats = NDArray[np.float64]

RESCUE_ROUNDS = 40
SEARCH_SHARE = 0.3
"""Share of lost ZOIs from which on the whole picture is searched again."""
_WORTH_RETRYING = np.isin(
    list(Status), (Status.LOST, Status.NOT_CONVERGED, Status.POOR_MATCH, Status.OUTSIDE)
)
"""By status."""


def rescue(attempt: Attempt, before: Floats | None) -> None:
    """Try lost ZOIs again from other guesses; a worse outcome does not replace a better one.

    Parameters
    ----------
    attempt : Attempt
    before : (A, modes), or None
        Parameters of the frame before; None: the guess of the attempt was searched for.
    """
    if not _lost(attempt).any():
        return
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
    if len(which) == 0:
        return
    found, status = attempt.tried(which, guess[which])
    good = np.flatnonzero(status == Status.OK)
    attempt.keep(which[good], found.at(good), status[good])


def _retry_from_neighbours(attempt: Attempt) -> None:
    """Let good ZOIs lend their shape to lost neighbours, round by round."""
    tried = np.zeros(len(attempt.status), np.uint8)
    for _ in range(RESCUE_ROUNDS):
        guess, lenders = _lent(attempt)
        fresh = np.isfinite(guess[:, 0]) & _lost(attempt) & (lenders > tried)
        if not fresh.any():
            return
        tried = lenders
        _retry(attempt, np.where(fresh[:, None], guess, np.nan))


def _lent(attempt: Attempt) -> tuple[Floats, NDArray[np.uint8]]:
    """For each ZOI the mean of what its good neighbours predict there, and their number."""
    reference = attempt.reference
    good = attempt.status == Status.OK
    shape = np.where(good[:, None], reference.total(attempt.found.p)[:, reference.affine], 0)
    total, number = _around(
        reference.spread(shape, 0.0), reference.spread(good[:, None].astype(float), 0.0)[0], reference.grid.step
    )  # fmt: skip
    with np.errstate(invalid="ignore"):
        mean = np.where(number > 0, total / np.maximum(number, 1), np.nan)
    guess = reference.all_modes(mean.reshape(6, -1)[:, reference.index].T)
    return reference.local(guess), number.ravel()[reference.index].astype(np.uint8)


def _around(shape: Floats, valid: Floats, step: int) -> tuple[Floats, Floats]:
    """Sum over the valid ones of a ZOI and its eight neighbours of what their shapes say of it, and their number.

    ``shape`` (6, R, C) are u, du_dx, du_dy, v, dv_dx, dv_dy, ``valid`` (R, C) is 0 or 1.
    """
    rows, columns = valid.shape
    total, number = np.zeros((6, rows, columns)), np.zeros((rows, columns))
    padded, there = np.pad(shape, ((0, 0), (1, 1), (1, 1))), np.pad(valid, 1)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            beside = np.s_[1 + dy : 1 + dy + rows, 1 + dx : 1 + dx + columns]
            part = padded[:, *beside].copy()
            for r in (0, 3):
                part[r] -= step * (dx * part[r + 1] + dy * part[r + 2])
            total += part * there[beside]
            number += there[beside]
    return total, number
