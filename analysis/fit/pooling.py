"""What the fits of one picture leave in common: the error of the picture, whatever its cause.

Noise of another strength than stated, compression, filters and blur leave something in every ZOI. How much, follows
robustly from all ZOIs, by their contrast. How it acts on u and v follows from the shapes of third degree
(``shapes.bent``): like u they are sums of what is left with the gradients of the pattern, and hold error alone. Where
the error is not white, their variance departs from that of white noise, and that of u by the same ratio: the sandwich
H^-1 (J' w C w J) H^-1 with the autocovariance C of what is left, without C.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.fit.assembly import MIN_NOISE_GAIN
from analysis.fit.kernel_args import CONVERGED, OutArgs, PooledError, ReferenceArgs
from analysis.fit.validity import COLOURED, LOST_SHARE

Floats = NDArray[np.float64]
Places = NDArray[np.intp] | slice

MIN_POOLED = 25
"""ZOIs from which on their common error is taken in place of the noise as stated."""
MAX_POOLED = 1500
"""ZOIs that are enough; of more, one in so many is taken."""
MIN_MATCHED = 0.5
"""Share of the ZOIs that must explain their pattern: of an unrelated picture no common error is taken."""
CLEAR_SIGMA = 0.15
"""Uncertainty of u and v up to which a ZOI has a clear pattern, px."""
GROUP, MAX_GROUPS = 50, 8
"""ZOIs of like contrast whose median counts, at least, and number of such groups at most."""
COLOUR_SPREAD = 1.0
"""Standard deviation of the logarithm of the ratio that the shapes of one ZOI show."""
SAME = 1e-3
"""What is left over what the noise as stated explains, below which the picture is its own reference: no noise shows."""
LOWEST, LOWEST_DEVIATION = 5, 0.84
"""One ZOI in so many leaves less than its group by these standard deviations; if these few, in most groups, ..."""
AS_STATED = 1.1
"""... leave no more than this of what the noise as stated explains, what the others leave more is their own: blur or
glare on a part of the picture."""
AGREES = 0.8, 1.1
"""What is left over what the given noise explains, between which the given noise stands. Where the warp reads between
the pixels it smooths the noise, and white noise of the strength given leaves down to 0.84 (quintic splines)."""
MAD = 1.4826


def pooled(
    found: OutArgs, left: Floats, expected: Floats, known: ReferenceArgs, places: Places, given: bool
) -> PooledError | None:
    """The common error of the ZOIs that were fitted, at the contrasts of all; None where too few explain their pattern.

    Parameters
    ----------
    found : OutArgs
        Of B ZOIs, some of the A.
    left, expected : (B,), GL^2
        Variance a pixel that the fit leaves, and that the noise as stated explains.
    known : ReferenceArgs
        Of all A.
    places : which of the A
    given : bool
        Whether the noise was given: it stands where what is left agrees with it.
    """
    own, gain = known.at(places), found.nuisance[:, 0]
    matched = _matched(found, left, expected, own)
    count = int(np.count_nonzero(matched))
    if count < MIN_POOLED:
        return None
    if np.median((found.left / (own.pixels * expected))[matched]) < SAME:
        return None
    ratio, contrast = left[matched] / expected[matched], own.signal[matched]
    groups = _alike(contrast)
    middle, usual = np.median(contrast[groups], axis=1), np.median(ratio[groups], axis=1)
    scatter = MAD * float(np.median(np.abs(ratio / _at(contrast, middle, usual) - 1)))
    agrees = given and usual.min() > AGREES[0] and usual.max() < AGREES[1]
    if agrees:
        usual = np.ones(len(usual))
    spread = np.sqrt(2 / np.maximum(own.pixels[matched], 1))
    lowest = _lowest(ratio[groups], spread[groups])
    as_stated = (lowest < AS_STATED) | (np.median(lowest) < AS_STATED)
    common = np.where(as_stated, np.minimum(usual, 1.0), usual)
    trend = _at(known.signal, middle, usual)
    error = expected * trend[places] / np.maximum(gain, MIN_NOISE_GAIN) ** 2
    shares = found.cubic[matched] / (error[:, None] * own.unit)[matched]
    colour = _shrunk(np.median(shares, axis=0) / known.white, count * known.independent)
    if agrees and np.all(np.abs(np.log(colour)) < np.log(COLOURED)):
        colour = np.ones(2)
    return PooledError(trend, _at(known.signal, middle, common), scatter, colour)


def _at(contrast: Floats, middle: Floats, values: Floats) -> Floats:
    """What holds for groups of middle contrasts, at each contrast."""
    if values.min() == values.max():
        return np.full(len(contrast), values[0])
    return np.asarray(np.interp(contrast, middle, values))


def _matched(found: OutArgs, left: Floats, expected: Floats, own: ReferenceArgs) -> NDArray[np.bool_]:
    """ZOIs with a clear pattern that explain it, (B,); none where most of those with a clear pattern do not."""
    with np.errstate(invalid="ignore"):
        sharp = own.unit.max(axis=1) * np.minimum(left, expected) < CLEAR_SIGMA**2
        tried = sharp & np.isfinite(left)
        pattern = own.signal * np.clip(found.nuisance[:, 0], 0, 1) ** 2
        explained = left < np.maximum(LOST_SHARE * pattern, 1.5 * expected)
    matched = tried & explained & (found.state == CONVERGED)
    enough = np.count_nonzero(matched) >= MIN_MATCHED * np.count_nonzero(tried)
    return np.asarray(matched & enough)


def _alike(contrast: Floats) -> NDArray[np.intp]:
    """Groups of ZOIs of like contrast, (G, N); a few of the highest are left over."""
    count = max(1, min(MAX_GROUPS, len(contrast) // GROUP))
    size = len(contrast) // count
    return np.argsort(contrast, kind="stable")[: count * size].reshape(count, size)


def _lowest(ratio: Floats, spread: Floats) -> Floats:
    """The common ratio of groups (G, N), (G,), as their lowest show it: where many are spoilt these are not."""
    at = ratio.shape[1] // LOWEST
    return np.asarray(np.partition(ratio / (1 - LOWEST_DEVIATION * spread), at, axis=1)[:, at])


def _shrunk(colour: Floats, count: float) -> Floats:
    """A ratio that ``count`` independent ZOIs show, nearer to 1 the less certain it is (James and Stein)."""
    chance = COLOUR_SPREAD**2 / count
    size = np.log(np.maximum(colour, 1e-6))
    return np.asarray(np.exp(size * np.maximum(0, 1 - chance / np.maximum(size**2, 1e-12))))
