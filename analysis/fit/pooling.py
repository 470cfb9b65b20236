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
from analysis.fit.validity import EMPTY_SIGMA, LOST_SHARE

Floats = NDArray[np.float64]
Places = NDArray[np.intp] | slice

MIN_POOLED = 25
"""ZOIs from which on their common error is taken in place of the noise as stated."""
MIN_MATCHED = 0.5
"""Share of the ZOIs that must explain their pattern: of an unrelated picture no common error is taken."""
GROUP, MAX_GROUPS = 50, 8
"""ZOIs of like contrast whose median counts, at least, and number of such groups at most."""
WHITE = 64
"""ZOIs with white noise that the ratio of the shapes is averaged with: of few it is known to some 10 % alone."""
MAD = 1.4826


def pooled(
    found: OutArgs, left: Floats, expected: Floats, known: ReferenceArgs, places: Places, noise: Floats
) -> PooledError | None:
    """The common error of the ZOIs that were fitted, at the contrasts of all; None where too few explain their pattern.

    Parameters
    ----------
    found : OutArgs
        Of B ZOIs.
    left, expected : (B,), GL^2
        Variance a pixel that the fit leaves, and that the noise as stated explains.
    known : ReferenceArgs
        Of all A.
    places : which of the A
    noise : (3,)
        ``shapes.Shapes.noise``.
    """
    own, gain = known.at(places), found.nuisance[:, 0]
    with np.errstate(invalid="ignore"):
        sharp = own.unit.max(axis=1) * np.minimum(left, expected) < EMPTY_SIGMA**2
        tried = sharp & np.isfinite(left)
        explained = left < LOST_SHARE * own.signal * np.clip(gain, 0, 1) ** 2
    matched = tried & explained & (found.state == CONVERGED)
    count = np.count_nonzero(matched)
    if count < MIN_POOLED or count < MIN_MATCHED * np.count_nonzero(tried):
        return None
    ratio = left[matched] / expected[matched]
    contrast = own.signal[matched]
    trend = _by_contrast(contrast, ratio, known.signal)
    scatter = MAD * float(np.median(np.abs(ratio / _by_contrast(contrast, ratio, contrast) - 1)))
    error = expected * trend[places] / np.maximum(gain, MIN_NOISE_GAIN) ** 2
    shares = found.cubic[matched] / (error[:, None] * own.unit)[matched]
    colour = np.median(shares, axis=0) / noise[2]
    return PooledError(trend, scatter, (count * colour + WHITE) / (count + WHITE))


def _by_contrast(signal: Floats, ratio: Floats, where: Floats) -> Floats:
    """Median of a ratio (N,) in groups of like contrast (N,), between them linear, at the contrasts ``where``."""
    order = np.argsort(signal, kind="stable")
    groups = np.array_split(order, max(1, min(MAX_GROUPS, len(order) // GROUP)))
    contrast = [float(np.median(signal[group])) for group in groups]
    return np.interp(where, contrast, [float(np.median(ratio[group])) for group in groups])
