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
from analysis.fit.kernel_args import CONVERGED, FitArgs, OutArgs, PooledError, ReferenceArgs
from analysis.fit.sensitivity import columns
from analysis.fit.validity import EMPTY_SIGMA, LOST_SHARE

Floats = NDArray[np.float64]
Places = NDArray[np.intp] | slice

MIN_POOLED = 25
"""ZOIs from which on their common error is taken in place of the noise as stated."""
MIN_MATCHED = 0.5
"""Share of the ZOIs that must explain their pattern: of an unrelated picture no common error is taken."""
GROUP, MAX_GROUPS = 50, 8
"""ZOIs of like contrast whose median counts, at least, and number of such groups at most."""
COLOUR_SPREAD = 1.5
"""Standard deviation of the logarithm of the ratio that the shapes of one ZOI show; half as many count as overlap."""
SAMPLE = 50
"""ZOIs whose answer to white noise is computed."""
LOWEST, LOWEST_DEVIATION = 5, 0.84
"""One ZOI in so many leaves less than its group by these standard deviations; if these few ..."""
AS_STATED = 1.1
"""... leave no more than this of what the noise as stated explains, what the others leave more is their own: blur or
glare on a part of the picture."""
MAD = 1.4826


def pooled(
    found: OutArgs, left: Floats, expected: Floats, known: ReferenceArgs, places: Places
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
    ratio, contrast = left[matched] / expected[matched], own.signal[matched]
    spread = np.sqrt(2 / np.maximum(own.pixels[matched], 1))
    groups = _alike(contrast)
    middle = [float(np.median(contrast[group])) for group in groups]
    usual = [float(np.median(ratio[group])) for group in groups]
    lowest = [_lowest(ratio[group], spread[group]) for group in groups]
    trend = np.interp(known.signal, middle, usual)
    common = [min(most, 1.0) if low < AS_STATED else most for low, most in zip(lowest, usual, strict=True)]
    scatter = MAD * float(np.median(np.abs(ratio / np.interp(contrast, middle, usual) - 1)))
    error = expected * trend[places] / np.maximum(gain, MIN_NOISE_GAIN) ** 2
    shares = found.cubic[matched] / (error[:, None] * own.unit)[matched]
    colour = np.median(shares, axis=0) / known.white
    return PooledError(trend, np.interp(known.signal, middle, common), scatter, _shrunk(colour, count))


def _shrunk(colour: Floats, count: int) -> Floats:
    """A ratio that ``count`` ZOIs show, with its logarithm nearer to 0 the less certain it is (James and Stein)."""
    chance = COLOUR_SPREAD**2 / count
    size = np.log(np.maximum(colour, 1e-6))
    return np.exp(size * np.maximum(0, 1 - chance / np.maximum(size**2, 1e-12)))


def _alike(contrast: Floats) -> list[NDArray[np.intp]]:
    """Groups of ZOIs of like contrast (N,)."""
    order = np.argsort(contrast, kind="stable")
    return np.array_split(order, max(1, min(MAX_GROUPS, len(order) // GROUP)))


def _lowest(ratio: Floats, spread: Floats) -> float:
    """The common ratio of (N,) ZOIs, as their lowest show it: where many are spoilt these are not."""
    at = len(ratio) // LOWEST
    return float(np.partition(ratio / (1 - LOWEST_DEVIATION * spread), at)[at])


def white_cubic(fit: FitArgs, unit: Floats, able: NDArray[np.bool_]) -> Floats:
    """Median over ZOIs of ``OutArgs.cubic`` from white noise, of u and of v, over their variance, (2,).

    Parameters
    ----------
    fit : FitArgs
        Of all A ZOIs.
    unit : (A, 2), px^2 per GL^2
        Variance of u and of v from noise of 1 GL, of a ZOI without anything else to find.
    able : (A,) bool
        ZOIs with a pattern.
    """
    which = np.flatnonzero(able)
    sample = which[:: max(1, len(which) // SAMPLE)]
    if len(sample) == 0:
        return np.ones(2)
    return np.median([_white_cubic(fit, z) / unit[z] for z in sample], axis=0)


def _white_cubic(fit: FitArgs, z: int) -> Floats:
    """The same of one ZOI, px^2 per GL^2."""
    size, (top, left) = fit.size, fit.origins[z]
    pixels = top * fit.pitch + left + np.add.outer(np.arange(size) * fit.pitch, np.arange(size))
    channels = [fit.images[pixels + k * fit.samples] for k in range(3)] + [np.ones((size, size))]
    line = fit.rows[0, :size].astype(np.float64)
    window = np.outer(line, line).ravel()
    xi = (np.arange(size) - (size - 1) / 2) / (size / 2)
    modes = np.stack(
        [(channels[k] * np.outer(xi**py, xi**px)).ravel() for k, px, py in columns(fit.order)]
    ) * window
    legendre = fit.mix @ xi ** np.arange(4)[:, None]
    inverse = fit.inverse[z].astype(np.float64)
    out = np.empty(2)
    for k in (0, 1):
        shapes = np.stack([(channels[k] * np.outer(legendre[j], legendre[3 - j])).ravel() for j in range(4)])
        taken = (shapes @ modes.T) @ inverse @ modes
        weights = (shapes * window - taken) / fit.squares[z, k]
        out[k] = _median_of_squares(np.linalg.eigvalsh(weights @ weights.T))
    return out


def _median_of_squares(variances: Floats) -> float:
    """Median of a sum of squares of normal values: of chi^2 with the same mean and variance (Wilson-Hilferty)."""
    freedom = float(variances.sum() ** 2 / np.sum(variances**2))
    return float(variances.sum()) * (1 - 2 / (9 * freedom)) ** 3
