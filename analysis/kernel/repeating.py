"""Patterns that repeat: ZOIs that fit at several places alike, and which of these places is theirs.

A ZOI repeats where it measures its own reference at a displacement: there noise cannot tell that place from the right
one. Its neighbours decide, outward from ZOIs that do not repeat; where none is near, the prediction does, or in a first
picture the smallest motion. What nothing decides is AMBIGUOUS.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.field import Status, in_blocks
from analysis.follow.repetition import Repetition
from analysis.kernel.neighbours import Neighbours
from analysis.kernel.reference import ReferencePicture
from analysis.kernel.solve import Solution

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

ALLOWED_PERIODS = 0.48
"""How far a ZOI may lie from what is expected of it, in periods; at half of one another place is as near."""
CALM_PERIODS = 0.25
"""Where no ZOI has moved so far from its prediction, all agree with each other as they did before."""
SELF_PERIODS = 0.4
"""How far from where it begins a ZOI may measure itself, in periods."""
USUAL = 0.5
"""Share of ZOIs that look alike somewhere from which on those do, too, for which that place is beyond the picture."""
FEW, FAR_MOVES = 256, 6
"""ZOIs that are tried first, and pixels uphill from a place that was found in a smaller picture."""
STRAYS = 0.02
"""Share of ZOIs that may lie farther off for the others to be trusted."""
AS_GOOD = 0.05
"""Correlation that noise and a fraction of a pixel take from the nearest place; beyond it a farther one is better."""
MIN_ANCHORS = 0.02
"""ZOIs that do not repeat, of those that do, from which on all wait for them."""
ALIKE = 0.4
"""Least correlation, without noise, of a ZOI with a place where it is fitted."""
DOUBT = 2.0
"""A ZOI repeats where it would be valid elsewhere if the fit left so many times less: noise differs between images."""


def repetition(reference: ReferencePicture) -> Repetition:
    """Where each ZOI measures its own reference; one whose places lie beyond the picture as those beside it do."""
    from analysis.follow.repetition import side_peaks

    prepared, solution = reference.prepared, None
    able, zois = prepared.status == Status.OK, len(reference.index)
    y, x = (prepared.origins + (reference.grid.size - 1) / 2).T
    places, has = [], []
    for peak, near in side_peaks(prepared.pattern.level, reference.region, x, y):
        away, there = np.full((2, zois, 2), np.nan), np.zeros((2, zois), bool)
        for k, place in enumerate((np.array(peak), -np.array(peak))):
            there[k] = _inside(reference, place) & near & able
            which, found = _alike(reference, np.flatnonzero(there[k]), place)
            if len(which) and solution is None:
                nowhere = np.full((zois, reference.modes), np.nan)
                solution = Solution(reference, reference.image, reference.noise_model, nowhere)
            if solution is not None:
                away[k, which] = _self_match(solution, which, found) * (1, -1)[k]
        match, tested = np.isfinite(away[..., 0]).any(axis=0), there.any(axis=0)
        if match.any():
            places.append(np.nanmedian(away[:, match].reshape(-1, 2), axis=0))
            usual = np.count_nonzero(match) >= USUAL * np.count_nonzero(tested)
            has.append(match | (near & able & ~tested & usual))
    whole = np.array(has, bool).reshape(-1, zois).T
    return Repetition(np.array(places).reshape(-1, 2), _with_lone(reference, whole, able))


def _with_lone(reference: ReferencePicture, has: Bools, able: Bools) -> Bools:
    """``has`` (A, K) with that of their neighbours for the few that do not repeat among those that do."""
    from scipy.ndimage import binary_dilation

    lone = able & ~has.any(axis=1)
    if not has.any() or not lone.any():
        return has
    beside = reference.spread(lone[:, None], False)[0]
    lone &= ~in_blocks(beside).ravel()[reference.index]
    around = [binary_dilation(one, np.ones((3, 3), bool)) for one in reference.spread(has, False)]
    return has | (lone[:, None] & np.stack([one.ravel()[reference.index] for one in around], axis=1))


def _inside(reference: ReferencePicture, place: NDArray[np.intp]) -> Bools:
    """Which ZOIs lie in the picture ``place`` (x, y) px away, (A,)."""
    first = reference.prepared.origins + place[::-1]
    return np.asarray(((first >= 0) & (first + reference.grid.size <= reference.prepared.shape)).all(axis=1))


def _alike(
    reference: ReferencePicture, which: NDArray[np.intp], place: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """Those of some ZOIs that look like ``place`` (x, y) px away, and where exactly, (B, 2)."""
    from analysis.follow.hill_climb import climbed
    from analysis.follow.repetition import REACH, TILE

    ready, level = reference.prepared, np.ascontiguousarray(reference.prepared.pattern.level)
    moves = FAR_MOVES if abs(place).max() > REACH * TILE else 0

    def scored(some: NDArray[np.intp]) -> tuple[NDArray[np.int64], Floats]:
        near = np.tile(place.astype(np.int64), (len(some), 1, 1))
        origins = ready.origins[some]
        return climbed(level, level, np.float32(0), origins, reference.grid.size, near, moves)

    # As a rule none is, of the places that an edge or light makes.
    if not (scored(which[:: max(1, len(which) // FEW)])[1] > ALIKE).any():
        return which[:0], np.zeros((0, 2), np.int64)
    found, score = scored(which)
    return which[score > ALIKE], found[score > ALIKE]


def _self_match(solution: Solution, which: NDArray[np.intp], place: NDArray[np.int64]) -> Floats:
    """Where ZOIs measure their own picture, begun at ``place`` (B, 2), (x, y) px; NaN where they do not."""
    at = _displacements(solution)
    guess = np.zeros((len(which), solution.reference.modes))
    guess[:, at] = place
    found, _ = solution.solved(which, guess)
    found = found._replace(left=found.left / DOUBT, bending=found.bending / DOUBT)
    here = np.hypot(*(found.p[:, at] - place).T) < SELF_PERIODS * np.hypot(*place.T)
    fits = solution.verdicts(which, found) == Status.OK
    return np.where((fits & here)[:, None], found.p[:, at], np.nan)


def settle(solution: Solution, expected: Floats) -> Bools:
    """Bring each ZOI that repeats to the place that is its own, or give it the status AMBIGUOUS.

    Parameters
    ----------
    solution : Solution
    expected : (A, modes)
        As predicted; zero in a first picture, NaN where nothing is known.

    Returns
    -------
    (A,) bool
        Which may have changed.
    """
    repeats = np.asarray(solution.reference.repetition.has.any(axis=1))
    if not repeats.any():
        return repeats
    neighbours = Neighbours.of(solution.reference)
    valid, off = solution.status == Status.OK, _periods_off(solution, expected)
    if (off[valid & np.isfinite(off)] < CALM_PERIODS).all():
        settled = _outward(solution, neighbours, valid & np.isfinite(off), repeats)
    else:
        _fit_near(solution, np.flatnonzero(valid & (off >= CALM_PERIODS)), expected)
        settled = _outward(solution, neighbours, (solution.status == Status.OK) & ~repeats, repeats)
        settled = _as_expected(solution, neighbours, settled, expected)
    undecided = repeats & ~settled & (solution.status == Status.OK)
    solution.status[undecided] = Status.AMBIGUOUS
    return repeats


def _periods_off(solution: Solution, expected: Floats) -> Floats:
    """How far each ZOI lies from what is expected, in its periods, (A,); lost ones NaN."""
    at = _displacements(solution)
    return solution.reference.repetition.off(solution.found.p[:, at] - expected[:, at])


def _displacements(solution: Solution) -> list[int]:
    """Where u and v stand among the parameters."""
    return [0, solution.reference.modes // 2]


def _outward(solution: Solution, neighbours: Neighbours, settled: Bools, among: Bools) -> Bools:
    """Settle ZOIs of ``among`` that fit where settled neighbours expect them, round by round; (A,), all settled."""
    settled, pending = settled.copy(), among & ~settled
    while True:
        which = np.flatnonzero(pending)
        guess, lenders = neighbours.lent(solution, which, settled)
        reached = lenders > 0
        if not reached.any():
            return settled
        which, guess = which[reached], guess[reached]
        pending[which] = False
        settled[which] = _brought(solution, which, guess)


def _brought(solution: Solution, which: NDArray[np.intp], guess: Floats) -> Bools:
    """Fit those of some ZOIs anew that are not at ``guess``; (B,) bool, which are there then."""
    away = ~_is_at(solution, which, guess)
    if away.any():
        found, status = solution.solved(which[away], guess[away])
        good = np.flatnonzero(status == Status.OK)
        solution.keep(which[away][good], found.at(good), status[good])
    return _is_at(solution, which, guess)


def _is_at(solution: Solution, which: NDArray[np.intp], guess: Floats) -> Bools:
    at = _displacements(solution)
    away = solution.found.p[which][:, at] - guess[:, at]
    near = solution.reference.repetition.off(away, which) <= ALLOWED_PERIODS
    return np.asarray(near & (solution.status[which] == Status.OK))


def _as_expected(solution: Solution, neighbours: Neighbours, settled: Bools, expected: Floats) -> Bools:
    """Settle what no settled neighbour reaches: from the ZOI nearest to what is expected of it outward.

    Nothing is settled where other ZOIs move otherwise than expected, or where the ones reached come away from it.
    """
    repeats = np.isfinite(solution.reference.period)
    rest = repeats & ~settled
    if not rest.any() or not _is_expected(solution, expected):
        return settled
    _fit_near(solution, np.flatnonzero(rest & np.isfinite(expected[:, 0])), expected)
    off = _periods_off(solution, expected)
    for seed in np.argsort(off):
        if rest[seed] and off[seed] <= ALLOWED_PERIODS and solution.status[seed] == Status.OK:
            part = _outward(solution, neighbours, np.arange(len(rest)) == seed, rest)
            rest &= ~part
            if (_periods_off(solution, expected)[part] > ALLOWED_PERIODS).mean() <= STRAYS:
                settled = settled | part
    return settled


def _is_expected(solution: Solution, expected: Floats) -> bool:
    """Whether most ZOIs that do not repeat are where they are expected; True where there are hardly any."""
    repeats = np.isfinite(solution.reference.period)
    known = (solution.reference.prepared.status == Status.OK) & np.isfinite(expected[:, 0])
    anchors = known & ~repeats
    if anchors.sum() < MIN_ANCHORS * repeats.sum():
        return True
    off = _periods_off(solution, expected)[anchors]
    there = (solution.status[anchors] == Status.OK) & (off <= ALLOWED_PERIODS)
    return bool(there.mean() >= 0.5)


def _fit_near(solution: Solution, which: NDArray[np.intp], expected: Floats) -> None:
    """Fit some ZOIs where they are expected, or at the nearest place like theirs; not where that is worse."""
    at = _displacements(solution)
    guess = expected[which]
    here = np.where((solution.status[which] == Status.OK)[:, None], solution.found.p[which][:, at], np.nan)
    away = np.nan_to_num(here - guess[:, at])
    nearest = solution.reference.repetition.nearest(away, which)
    near, score = _climbed(solution, which, guess[:, None, at] + np.stack([nearest, 0 * away], axis=1))
    own = _climbed(solution, which, (guess[:, at] + away)[:, None])[1]
    better = np.isnan(here[:, 0]) | (score >= own - AS_GOOD)
    guess[:, at] = near
    _brought(solution, which[better], guess[better])


def _climbed(solution: Solution, which: NDArray[np.intp], places: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Whole pixels (B, 2) uphill from the best of some places (B, K, 2) of ZOIs, and the correlation there, (B,)."""
    from analysis.follow.hill_climb import MAX_MOVES, climbed

    reference, image = solution.reference, solution.image.astype(np.float32)
    offset, origins = np.float32(reference.prepared.pattern.mean), reference.prepared.origins[which]
    near = np.rint(places).astype(np.int64)
    return climbed(reference.image, image, offset, origins, reference.grid.size, near, MAX_MOVES)
