"""What the fits of one picture leave in common: the error of the picture, whatever its cause.

Noise of another strength than stated, compression, filters and blur leave something in every ZOI. How much, follows
robustly from all ZOIs, by their contrast. How it acts on u and v follows from the shapes of third degree
(``shapes.bent``): like u they are sums of what is left with the gradients of the pattern, and hold error alone. Where
the error is not white, their variance departs from that of white noise, and that of u by the same ratio: the sandwich
H^-1 (J' w C w J) H^-1 with the autocovariance C of what is left, without C.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.compiled.loops import helper, part
from analysis.fit.assembly import MIN_NOISE_GAIN, area
from analysis.fit.kernel_args import CONVERGED, OutArgs, PooledError, ReferenceArgs
from analysis.fit.validity import AGREES, COLOURED, LOST_SHARE

Floats = NDArray[np.float64]
Places = NDArray[np.intp]

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
SHOWN = 8
"""Figures of a ZOI that are pooled (``explained``)."""
BENT, SOME_BENT = 4.0, 0.1
"""What a fit leaves of a displacement that bends, over the median of noise, that one ZOI in a hundred exceeds by
chance; share of the ZOIs that bend from which on those that do not are pooled alone, ..."""
STRAIGHT_COLOUR = 1.3, 1.7
"""... as long as they are one in ``LOWEST`` and show no more colour than the first: coloured errors bend all. Towards
the second, more and more all of them count; a step would judge pictures near it now twice as mildly, now not."""
WHITE_BENT = 0.83
"""Median of what white noise bends, over its mean (simulated: 0.80 to 0.85)."""
SAME = 1e-3
"""What is left over what the noise as stated explains, below which the picture is its own reference: no noise shows."""
LOWEST, LOWEST_DEVIATION = 5, 0.84
"""One ZOI in so many leaves less than its group by these standard deviations; if these few, in most groups, ..."""
AS_STATED = 1.1
"""... leave no more than this of what the noise as stated explains, what the others leave more is their own: blur or
glare on a part of the picture."""
MAD = 1.4826
COUNTED = 4000
"""ZOIs that a median is of, about."""
SAMPLE, AROUND = 512, 0.1
"""Of many values so many show where their median is, to this share of them on either side."""


def pooled(
    found: OutArgs, left: Floats, expected: Floats, known: ReferenceArgs, places: Places, given: bool
) -> PooledError | None:
    """The common error of the ZOIs that were fitted, at the contrasts of all; None where too few explain their pattern.

    Parameters
    ----------
    found : OutArgs
        Of B ZOIs, some of the A; of more than ``MAX_POOLED`` one in so many counts.
    left, expected : (B,), GL^2
        Variance a pixel that the fit leaves, and that the noise as stated explains.
    known : ReferenceArgs
        Of all A.
    places : (B,)
        Which of the A.
    given : bool
        Whether the noise was given: it stands where what is left agrees with it.
    """
    every = 1 + len(places) // MAX_POOLED
    out = np.empty((SHOWN, 1 + len(places) // every))
    count = explained(found, left, expected, known, places, every, out)
    if count < MIN_POOLED:
        return None
    out = out[:, :count]
    straight, part = _straight(out, known.white)
    of_all = None if part == 1 else _common(out, known, every, given)
    if part == 0:
        return of_all
    of_straight = _common(out[:, straight], known, every, given)
    if of_straight is None:
        return None
    return _between(of_all, of_straight, part)._replace(apart=True)


def _between(a: PooledError | None, b: PooledError, part: float) -> PooledError:
    """The common error between two, by ``part`` that of the second; all of it where the first is None."""
    if a is None:
        return b
    ratio, forgiven, usual, colour, bent = (
        np.exp((1 - part) * np.log(getattr(a, name)) + part * np.log(getattr(b, name)))
        for name in ("ratio", "forgiven", "usual", "colour", "bent")
    )
    scatter = (1 - part) * a.scatter + part * b.scatter
    return PooledError(ratio, forgiven, float(usual), scatter, colour, float(bent), b.apart)


def _common(out: Floats, known: ReferenceArgs, every: int, given: bool) -> PooledError | None:
    """The common error of the ZOIs shown, (SHOWN, N), one in ``every``; None where the picture is its own reference."""
    count = out.shape[1]
    contrast, ratio, spread, bare, *cubic, _, bends = np.take(out, np.argsort(out[0]), axis=1)
    if np.count_nonzero(bare < SAME) > count / 2:
        return None
    middle, usual = medians(_alike(contrast)), medians(_alike(ratio))
    number, shares = count * min(1.0, every * known.independent), np.array(cubic) / known.white[:, None]
    usual_bend = medians(bends[None]) / (WHITE_BENT * known.bends)
    bent = max(1.0, float(_shrunk(usual_bend, number)[0]))
    if given and usual.min() > AGREES[0] and usual.max() < AGREES[1]:
        colour = _shrunk(medians(shares), number)
        stated = PooledError.none(len(known.signal))._replace(
            forgiven=np.minimum(_at(known.signal, middle, usual), 1)
        )
        stated = stated._replace(bent=bent)
        return stated if np.abs(np.log(colour)).max() < np.log(COLOURED) else stated._replace(colour=colour)
    trend, of_each = _at(known.signal, middle, usual), _at(contrast, middle, usual)
    scatter = MAD * median(np.abs(ratio / of_each - 1))
    lowest = _lowest(_alike(ratio), _alike(spread))
    as_stated = (lowest < AS_STATED) | (np.median(lowest) < AS_STATED)
    common = np.where(as_stated, np.minimum(usual, 1.0), usual)
    forgiven = trend if np.array_equal(common, usual) else _at(known.signal, middle, common)
    colour = _shrunk(medians(shares / of_each), number)
    return PooledError(
        trend, forgiven, median(trend[:: 1 + len(trend) // COUNTED]), scatter, colour, bent, False
    )


def median(values: Floats) -> float:
    """The median of (N,) finite values."""
    return float(medians(values[None])[0])


def medians(rows: Floats) -> Floats:
    """The median of each row of (K, N) finite values, (K,); in any order in memory."""
    medians_of_rows: Floats = row_medians(
        np.ascontiguousarray(rows)
    )  # another order would be compiled in a test
    return medians_of_rows


@helper
def row_medians(rows: Any) -> Any:
    """As ``medians``, of rows one after the other in memory."""
    out = np.empty(len(rows))
    for i in range(len(rows)):
        out[i] = np.median(_middle(rows[i]))
    return out


@part
def _middle(values: Any) -> Any:
    """Some of many values, and infinite ones, that have the same median: those that a sample shows to be near it."""
    n = len(values)
    if n < 4 * SAMPLE:
        return values
    some = np.sort(values[:: n // SAMPLE].copy())
    low, high = some[int((0.5 - AROUND) * len(some))], some[int((0.5 + AROUND) * len(some))]
    out, count, below, above = np.empty(n), 0, 0, 0
    for k in range(n):
        value = values[k]
        out[count] = value
        below += value < low
        above += value > high
        count = k + 1 - below - above
    if abs(below - above) > count - 2:  # not near it
        return values
    end = count + abs(below - above)
    out[count:end] = -np.inf if below > above else np.inf
    return out[:end]


@helper
def explained(
    found: OutArgs, left: Any, expected: Any, known: ReferenceArgs, places: Any, every: int, out: Any
) -> int:
    """How many of one in ``every`` ZOIs have a clear pattern and explain it; 0 where most with a clear one do not.

    Written to ``out`` (SHOWN, ..) of each: contrast; variance left over that expected, and what this scatters by;
    the same before rounding counts; variance of the shapes of u and of v over that expected of u and of v; that of all
    shapes, as they bend, over the variance left for the worse of u and v, and for both.
    """
    tried = count = 0
    for i in range(0, len(places), every):
        z = places[i]
        gain = found.nuisance[i, 0]
        of_u, of_v = known.unit[z, 0], known.unit[z, 1]
        if not (math.isfinite(left[i]) and max(of_u, of_v) * min(left[i], expected[i]) < CLEAR_SIGMA**2):
            continue
        tried += 1
        pattern = known.signal[z] * min(max(gain, 0.0), 1.0) ** 2
        if found.state[i] != CONVERGED or not left[i] < max(LOST_SHARE * pattern, 1.5 * expected[i]):
            continue
        of_both = 1 - known.later + known.later / area(found.p, i)
        error = of_both * expected[i] / max(gain, MIN_NOISE_GAIN) ** 2
        out[0, count] = known.signal[z]
        out[1, count] = left[i] / expected[i]
        out[2, count] = math.sqrt(2 / max(known.pixels[z], 1.0))
        out[3, count] = found.left[i] / (known.pixels[z] * expected[i])
        out[4, count] = found.cubic[i, 0] / (error * of_u)
        out[5, count] = found.cubic[i, 1] / (error * of_v)
        bends = found.bending[i] * max(gain, MIN_NOISE_GAIN) ** 2 / left[i]
        out[6, count], out[7, count] = bends / max(of_u, of_v), bends / (of_u + of_v)
        count += 1
    return count if count >= MIN_MATCHED * tried else 0


def _straight(out: Floats, white: Floats) -> tuple[NDArray[np.bool_], float]:
    """Which of the ZOIs shown, (SHOWN, N), do not bend; how far they count alone, 0 to 1.

    0 where few bend, most do, or all by a coloured error.
    """
    straight = np.asarray(out[6] < BENT * white.sum())
    count = np.count_nonzero(straight)
    if not max(MIN_POOLED, len(straight) / LOWEST) <= count < (1 - SOME_BENT) * len(straight):
        return straight, 0.0
    shares = medians(out[4:6, straight] / out[1, straight]) / white
    low, high = np.log(STRAIGHT_COLOUR)
    return straight, float(np.clip((high - np.log(max(shares.max(), 1e-6))) / (high - low), 0, 1))


def _at(contrast: Floats, middle: Floats, values: Floats) -> Floats:
    """What holds for groups of middle contrasts, at each contrast."""
    out = np.empty(len(contrast))
    interpolate(*(np.ascontiguousarray(one, np.float64) for one in (contrast, middle, values)), out)
    return out


@helper
def interpolate(x: Any, at: Any, values: Any, out: Any) -> None:
    """``np.interp`` between few places (G,), which are in order, written to ``out``: in vectors."""
    out[:] = values[0]
    for k in range(len(at)):
        slope = (values[k + 1] - values[k]) / (at[k + 1] - at[k]) if k + 1 < len(at) else 0.0
        for n in range(len(x)):
            out[n] = values[k] + slope * (x[n] - at[k]) if x[n] >= at[k] else out[n]


def _alike(values: Floats) -> Floats:
    """Those of groups of ZOIs of like contrast, in whose order they are, (G, N); a few of the highest are left over."""
    groups = max(1, min(MAX_GROUPS, len(values) // GROUP))
    size = len(values) // groups
    return values[: groups * size].reshape(groups, size)


def _lowest(ratio: Floats, spread: Floats) -> Floats:
    """The common ratio of groups (G, N), (G,), as their lowest show it: where many are spoilt these are not."""
    at = ratio.shape[1] // LOWEST
    return np.asarray(np.partition(ratio / (1 - LOWEST_DEVIATION * spread), at, axis=1)[:, at])


def _shrunk(colour: Floats, count: float) -> Floats:
    """A ratio that ``count`` independent ZOIs show, nearer to 1 the less certain it is (James and Stein)."""
    chance = COLOUR_SPREAD**2 / count
    size = np.log(np.maximum(colour, 1e-6))
    return np.asarray(np.exp(size * np.maximum(0, 1 - chance / np.maximum(size**2, 1e-12))))
