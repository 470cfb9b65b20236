"""What the grey levels of a few frames say of light and of the bits that are really there.

How still a series is: drift, what is left about it, and the main frequency of that.

Nothing here knows what the series is of. Times need not be even: the spectrum is summed at the very times.

What a window does to a strain that varies: l_10% and the size of the VSG.

Both follow from the least-squares weight alone (docs/method.md, closed forms), here by sums over the
pixels of a ZOI, so that they hold for every window and for order 1 and 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.field import Window, profile


@dataclass(frozen=True, slots=True)
class Exposure:
    """Grey levels of the pixels looked at, as parts of full scale.

    Attributes
    ----------
    low, mean, high : float
        1st percentile, mean, 99th percentile.
    saturated : float
        Share of the pixels at the top in any of the frames.
    dark : float
        Share at zero in any of them.
    piled : float
        Share of all values at the highest one, where that is below the top: clipped by somebody else.
    """

    low: float
    mean: float
    high: float
    saturated: float
    dark: float
    piled: float


@dataclass(frozen=True, slots=True)
class Depth:
    """Bits of a sample.

    Attributes
    ----------
    stated : int
    unused_above, unused_below : int
        Highest and lowest bits that are the same in every sample.
    """

    stated: int
    unused_above: int
    unused_below: int

    @property
    def changing(self) -> int:
        """Bits between the highest and the lowest that change."""
        return max(self.stated - self.unused_above - self.unused_below, 0)


def exposure(pixels: NDArray[Any], bits: int) -> Exposure:
    """Light, from the pixels of a few frames, (N, P) uint8 or uint16."""
    top = 2**bits - 1
    counts = np.bincount(pixels.reshape(-1))
    highest = len(counts) - 1
    return Exposure(
        low=_percentile(counts, 0.01) / top,
        mean=float(counts @ np.arange(len(counts))) / pixels.size / top,
        high=_percentile(counts, 0.99) / top,
        saturated=float((pixels.max(axis=0) >= top).mean()),
        dark=float((pixels.min(axis=0) == 0).mean()),
        piled=float(counts[highest]) / pixels.size if highest < top else 0.0,
    )


def _percentile(counts: NDArray[np.intp], share: float) -> float:
    """Of values that occur ``counts`` times, as ``np.percentile`` has it."""
    upto = counts.cumsum()
    place = share * (int(upto[-1]) - 1)
    below = math.floor(place)
    low, high = (int(np.searchsorted(upto, k, side="right")) for k in (below, math.ceil(place)))
    return low + (place - below) * (high - low)


def depth(pixels: NDArray[Any], bits: int) -> Depth:
    """Which bits change at all between the pixels of a few frames, (N, P) uint8 or uint16."""
    flat = pixels.reshape(-1)
    changing = int(np.bitwise_or.reduce(flat ^ flat[0]))
    if changing == 0:
        return Depth(bits, bits, 0)
    below = (changing & -changing).bit_length() - 1
    return Depth(bits, max(bits - changing.bit_length(), 0), below)


Floats = NDArray[np.float64]

FEWEST = 8
FINE = 4  # frequencies looked at for each that the length of the series tells apart
BY_CHANCE = (
    5.0  # a peak counts from ln(frequencies) + this, in means of the spectrum: once in 150 series of noise
)
MAINS_HZ = (50.0, 60.0)


@dataclass(frozen=True, slots=True)
class Steadiness:
    """A series of a thing that should be still.

    Attributes
    ----------
    drift : float
        What a straight line through it rises by, from the first to the last.
    rms : float
        Standard deviation about that line, noise included.
    noise : float
        What of ``rms`` the measurement itself explains.
    frequency : float or None, Hz
        Where most of ``rms`` is; None where no frequency stands out, or the series has no times. What is
        faster than half the rate shows here at a lower frequency.
    seconds : float, s
    rate : float or None, 1/s
        Of the series; None without times.
    """

    drift: float
    rms: float
    noise: float
    frequency: float | None
    seconds: float
    rate: float | None

    @property
    def vibration(self) -> float:
        """``rms`` without what noise explains."""
        return math.sqrt(max(self.rms**2 - self.noise**2, 0.0))


def steadiness(times: ArrayLike, values: ArrayLike, noise: float = 0.0) -> Steadiness:
    """Drift, scatter and main frequency.

    Parameters
    ----------
    times : (N,) s
    values : (N,), NaN is left out
    noise : float
        Standard deviation of one value.
    """
    t, x = np.asarray(times, np.float64), np.asarray(values, np.float64)
    good = np.isfinite(x)
    t, x = t[good], x[good]
    if len(x) < FEWEST:
        return Steadiness(math.nan, math.nan, noise, None, math.nan, None)
    span = float(t[-1] - t[0])
    timed = span > 0
    place = (t - t[0]) / span if timed else np.linspace(0, 1, len(t))
    slope, offset = np.polyfit(place, x, 1)
    rest = x - slope * place - offset
    rms = math.sqrt(float(rest @ rest) / (len(x) - 2))
    peak = main_frequency(t, rest) if timed else None
    rate = 1 / float(np.median(np.diff(t))) if timed else None
    return Steadiness(float(slope), rms, noise, peak, span, rate)


def main_frequency(times: Floats, values: Floats) -> float | None:
    """The strongest frequency, Hz; None where it does not stand out of what noise does by chance."""
    n, span = len(times), float(times[-1] - times[0])
    first, last = 1 / span, 0.5 / float(np.median(np.diff(times)))
    if not last > first or not values.any():
        return None
    frequencies = np.arange(first, last * (1 + 1e-9), first / FINE)
    waves = np.exp(-2j * math.pi * np.outer(frequencies, times - times[0]))
    power = np.abs(waves @ values) ** 2
    k = int(np.argmax(power))
    # Without the peak and what lies beside it, so that a single line does not raise its own threshold.
    others = power[np.abs(frequencies - frequencies[k]) > 2 * first]
    usual = float(others.mean()) if others.size >= FEWEST else float(values @ values)
    return float(frequencies[k]) if power[k] > (math.log(n / 2) + BY_CHANCE) * usual else None


def aliased(frequency: float, rate: float) -> float:
    """Where ``frequency`` shows in a series of ``rate`` a second, Hz."""
    return abs(frequency - rate * round(frequency / rate))


def mains_of(found: Steadiness, harmonic: int) -> float | None:
    """The mains frequency (50 or 60 Hz) whose ``harmonic`` shows at the main frequency; None for none.

    Lamps flicker at twice the mains (harmonic 2), motors and fields shake at once.
    """
    frequency, rate = found.frequency, found.rate
    if frequency is None or rate is None:
        return None
    near = 0.75 / found.seconds
    off = {mains: abs(aliased(harmonic * mains, rate) - frequency) for mains in MAINS_HZ}
    best = min(off, key=lambda mains: off[mains])
    return best if off[best] < near else None


LOSS = 0.1
"""l_10%: the period of a sine that has lost so much of its amplitude."""


def l10_strain(size: int, window: Window = "gaussian") -> float:
    """l_10% of a strain, px. The same for order 1 and 2: a quadratic term is even, a gradient odd."""
    x = _pixels(size)
    weight = profile(window, size) * x
    return _period(x, weight / (weight @ x))


def gauge_length(size: int, window: Window = "gaussian") -> float:
    """Side of the square, evenly weighted ZOI whose strain has the same noise, px: the size of the VSG."""
    x, w = _pixels(size), profile(window, size)
    fitted = (w * x**2).sum() * w.sum()
    noise = (w**2 * x**2).sum() * (w**2).sum()
    return float((12 * fitted**2 / noise) ** 0.25)


def _pixels(size: int) -> np.ndarray:
    return np.arange(size) - (size - 1) / 2


def _period(x: np.ndarray, weight: np.ndarray) -> float:
    """The longest period whose response is 1 - LOSS, by bisection from periods without loss."""

    def response(period: float) -> float:
        k = 2 * math.pi / period
        return float(weight @ np.sin(k * x) / k)

    long, short = 1000.0 * len(x), 1000.0 * len(x)
    while response(short) > 1 - LOSS:
        long, short = short, short / 1.1
    for _ in range(60):
        middle = (long + short) / 2
        long, short = (middle, short) if response(middle) > 1 - LOSS else (long, middle)
    return (long + short) / 2
