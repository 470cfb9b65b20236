"""Patterns that repeat: ZOIs that fit at several places alike, and which of these places is theirs.

A ZOI repeats where it measures its own reference at a displacement: there noise cannot tell that place from the right
one. Its neighbours decide, outward from ZOIs that do not repeat; where none is near, the prediction does, or in a first
picture the smallest motion. What nothing decides is AMBIGUOUS.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.field import Status
from analysis.kernel.neighbours import Neighbours
from analysis.kernel.reference import ReferencePicture
from analysis.kernel.solve import Solution

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

ALLOWED_PERIODS = 0.4
"""How far a ZOI may lie from what is expected of it, in periods; at half of one another place is as near."""
CALM_PERIODS = 0.25
"""Where no ZOI has moved so far from its prediction, all agree with each other as they did before."""
STRAYS = 0.02
"""Share of ZOIs that may lie farther off for the others to be trusted."""
MIN_ANCHORS = 0.02
"""ZOIs that do not repeat, of those that do, from which on all wait for them."""
ALIKE = 0.4
"""Least correlation, without noise, of a ZOI with a place where it is fitted."""
DOUBT = 2.0
"""A ZOI repeats where it would be valid elsewhere if the fit left so many times less: noise differs between images."""


def periods(reference: ReferencePicture) -> Floats:
    """The smallest displacement at which each ZOI measures its own reference, px, (A,); infinite: none."""
    from analysis.follow.repetition import side_peaks

    prepared, solution = reference.prepared, None
    out = np.full(len(reference.index), np.inf)
    y, x = (prepared.origins + (reference.grid.size - 1) / 2).T
    for peak, near in side_peaks(prepared.pattern.level, reference.region, x, y):
        for place in (np.array(peak), -np.array(peak)):
            which = _alike(reference, np.flatnonzero(near & (prepared.status == Status.OK)), place)
            if len(which) and solution is None:
                nowhere = np.full((len(out), reference.modes), np.nan)
                solution = Solution(reference, reference.image, reference.noise_model, nowhere)
            if solution is not None:
                out[which] = np.minimum(out[which], _self_match(solution, which, place))
    return out


def _alike(reference: ReferencePicture, which: NDArray[np.intp], place: NDArray[np.intp]) -> NDArray[np.intp]:
    """Those of some ZOIs that look like ``place`` (x, y) px away."""
    from analysis.follow.hill_climb import climbed

    ready, level = reference.prepared, np.ascontiguousarray(reference.prepared.pattern.level)
    places = np.tile(place.astype(np.int64), (len(which), 1, 1))
    score = climbed(level, level, np.float32(0), ready.origins[which], reference.grid.size, places, 0)[1]
    return which[score > ALIKE]


def _self_match(solution: Solution, which: NDArray[np.intp], place: NDArray[np.intp]) -> Floats:
    """How far away ZOIs measure their own picture, begun at ``place`` (x, y), px; infinite where they do not."""
    at = [0, solution.reference.modes // 2]
    guess = np.zeros((len(which), solution.reference.modes))
    guess[:, at] = place
    found, _ = solution.solved(which, guess)
    found = found._replace(left=found.left / DOUBT, bending=found.bending / DOUBT)
    here = np.hypot(*(found.p[:, at] - place).T) < ALLOWED_PERIODS * np.hypot(*place)
    fits = solution.verdicts(which, found) == Status.OK
    return np.where(fits & here, np.hypot(*found.p[:, at].T), np.inf)


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
    repeats = np.isfinite(solution.reference.period)
    if not repeats.any():
        return repeats
    neighbours = Neighbours.of(solution.reference)
    valid, off = solution.status == Status.OK, _periods_off(solution, expected)
    if (off[valid & np.isfinite(off)] < CALM_PERIODS).all():
        settled = _outward(solution, neighbours, valid & np.isfinite(off), repeats)
    else:
        settled = _outward(solution, neighbours, valid & ~repeats, repeats)
        settled = _as_expected(solution, neighbours, settled, expected)
    undecided = repeats & ~settled & (solution.status == Status.OK)
    solution.status[undecided] = Status.AMBIGUOUS
    return repeats


def _periods_off(solution: Solution, expected: Floats) -> Floats:
    """How far each ZOI lies from what is expected, in its periods, (A,); others in the smallest one, lost ones NaN."""
    period, at = solution.reference.period, _displacements(solution)
    length = np.where(np.isfinite(period), period, period.min())
    return np.asarray(np.hypot(*(solution.found.p[:, at] - expected[:, at]).T) / length)


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
    distance = np.hypot(*(solution.found.p[which][:, at] - guess[:, at]).T)
    near = distance <= ALLOWED_PERIODS * solution.reference.period[which]
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
    """Fit some ZOIs at the best whole pixel uphill from where they are expected."""
    from analysis.follow.hill_climb import MAX_MOVES, climbed

    reference, at = solution.reference, _displacements(solution)
    offset = np.float32(reference.prepared.pattern.mean)
    guess, image = expected[which], solution.image.astype(np.float32)
    near = np.rint(guess[:, None, at]).astype(np.int64)
    origins, size = reference.prepared.origins[which], reference.grid.size
    guess[:, at] = climbed(reference.image, image, offset, origins, size, near, MAX_MOVES)[0]
    _brought(solution, which, guess)
