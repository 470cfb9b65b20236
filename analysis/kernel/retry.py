"""Lost ZOIs of an image tried again: without extrapolation, from their neighbours, by a search, by features.

Each way is tried for what the one before has left without a value: where nothing is lost, none costs anything. A worse
outcome never replaces a better one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.field import Status, in_blocks
from analysis.kernel.neighbours import Neighbours
from analysis.kernel.repeating import settle
from analysis.kernel.solve import Solution

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

RETRY_ROUNDS = 200
"""Rounds in which valid ZOIs lend their shape to lost neighbours; each reaches a step farther."""
SEARCH_SHARE = 0.3
"""Share of lost ZOIs from which on the whole picture is searched again, and features are matched."""
SEARCH_PX = 100.0
"""How much farther than before a lost block may have moved, px."""
_WORTH_RETRYING = np.isin(
    list(Status), (Status.LOST, Status.NOT_CONVERGED, Status.POOR_MATCH, Status.OUTSIDE)
)
"""By status."""


def retry_lost(solution: Solution, before: Floats | None, clipped: Bools | None = None) -> None:
    """Try lost ZOIs again from other guesses, and settle where ZOIs of a pattern that repeats are.

    Parameters
    ----------
    solution : Solution
    before : (A, modes), or None
        Parameters of the frame before; None: the guess was searched for.
    clipped : (H, W) bool, or None
        Saturated pixels: a ZOI on them is refused, before it is tried again and after.
    """
    if clipped is not None:
        solution.refuse_clipped(clipped)
    lost = _lost(solution)
    if lost.any():
        _retry_lost(solution, before)
    moved = settle(solution, np.zeros_like(solution.guess) if before is None else solution.guess)
    if clipped is not None and (lost | moved).any():
        solution.refuse_clipped(clipped, lost | moved)


def _retry_lost(solution: Solution, before: Floats | None) -> None:
    # Without its gradients a guess is right for ZOIs beside a discontinuity.
    modes = solution.reference.modes
    displacements = np.arange(modes) % (modes // 2) == 0
    _retry(solution, solution.guess * displacements if before is None else before)
    _retry_from_neighbours(solution)
    if before is not None:
        _search_again(solution, before)
    if _share_lost(solution) > SEARCH_SHARE:
        _retry_from_features(solution)


def _search_again(solution: Solution, before: Floats) -> None:
    """Search where a block of ZOIs was lost since the frame before, or all over where many are lost."""
    reference = solution.reference
    if _share_lost(solution) > SEARCH_SHARE:
        _retry(solution, reference.searched(solution.image))
    else:
        newly = _lost(solution) & np.isfinite(before[:, 0])
        block = np.flatnonzero(in_blocks(reference.spread(newly[:, None], False)[0]).ravel()[reference.index])
        if not len(block):
            return
        moved = float(np.abs(before[block][:, [0, reference.modes // 2]]).max())
        _retry_some(solution, block, reference.searched_near(solution.image, block, moved + SEARCH_PX))
    _retry_from_neighbours(solution)


def _retry_from_features(solution: Solution) -> None:
    """Start from affine motions that features of the two pictures share."""
    from analysis.follow.features import feature_motions, motion_at

    reference = solution.reference
    y, x = (reference.prepared.origins + (reference.grid.size - 1) / 2).T
    deformed = solution.image.astype(np.float32)
    for matrix in feature_motions(reference.image, deformed, reference.region):
        _retry(solution, reference.all_modes(motion_at(matrix, x, y)))
        _retry_from_neighbours(solution)
        if _share_lost(solution) <= SEARCH_SHARE:
            return


def _lost(solution: Solution) -> Bools:
    refused = np.asarray(solution.status != Status.OK)
    if not refused.any():
        return refused
    return np.asarray(_WORTH_RETRYING[solution.status] & (solution.reference.prepared.status == Status.OK))


def _share_lost(solution: Solution) -> float:
    able = int(np.count_nonzero(solution.reference.prepared.status == Status.OK))
    return int(np.count_nonzero(_lost(solution))) / max(able, 1)


def _retry(solution: Solution, guess: Floats) -> None:
    which = np.flatnonzero(_lost(solution) & np.isfinite(guess).all(axis=1))
    if len(which):
        _retry_some(solution, which, guess[which])


def _retry_some(solution: Solution, which: NDArray[np.intp], guess: Floats) -> None:
    found, status = solution.solved(which, guess)
    good = np.flatnonzero(status == Status.OK)
    solution.keep(which[good], found.at(good), status[good])


def _retry_from_neighbours(solution: Solution) -> None:
    """Let good ZOIs lend their shape to lost neighbours, round by round."""
    tried_with = np.zeros(len(solution.status), np.uint8)
    neighbours = Neighbours.of(solution.reference)
    for _ in range(RETRY_ROUNDS):
        lost = np.flatnonzero(_lost(solution))
        guess, lenders = neighbours.lent(solution, lost, solution.status == Status.OK)
        fresh = lenders > tried_with[lost]
        if not fresh.any():
            return
        tried_with[lost] = lenders
        _retry_some(solution, lost[fresh], guess[fresh])
