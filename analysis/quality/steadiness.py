"""How still a series is: drift, what is left about it, and the main frequency of that.

The series may be of anything. Times need not be even: the spectrum is summed at the very times.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

MIN_VALUES = 8
FINE = 4
"""Frequencies computed for each that the length of the series resolves."""
BY_CHANCE = 5.0
"""A peak counts from ln(frequencies) + this, in means of the spectrum: once in 150 series of noise."""
MAINS_HZ = (50.0, 60.0)
MAX_DRIFT, CLEAR = 2e-5, 5.0
"""Of a strain that should be still, and in units of its uncertainty: beyond both, the specimen is loaded or moves."""


@dataclass(frozen=True, slots=True)
class Steadiness:
    """A series of values that should not change.

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
    sigma_drift : float
        Standard uncertainty of ``drift``; NaN where it is not known.
    """

    drift: float
    rms: float
    noise: float
    frequency: float | None
    seconds: float
    rate: float | None
    sigma_drift: float = math.nan

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
    if len(x) < MIN_VALUES:
        return Steadiness(math.nan, math.nan, noise, None, math.nan, None)
    span = float(t[-1] - t[0])
    timed = span > 0
    place = (t - t[0]) / span if timed else np.linspace(0, 1, len(t))
    slope, offset = np.polyfit(place, x, 1)
    rest = x - slope * place - offset
    rms = math.sqrt(float(rest @ rest) / (len(x) - 2))
    peak = main_frequency(t, rest) if timed else None
    rate = 1 / float(np.median(np.diff(t))) if timed else None
    sigma = max(rms, noise) / math.sqrt(float(((place - place.mean()) ** 2).sum()))
    return Steadiness(float(slope), rms, noise, peak, span, rate, sigma)


def strain_drifts(drift: float, sigma: float) -> bool:
    """Whether a strain that should be still has changed by ``drift``, whose uncertainty is ``sigma``; NaN: no."""
    return abs(drift) > MAX_DRIFT and abs(drift) > CLEAR * sigma


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
    usual = float(others.mean()) if others.size >= MIN_VALUES else float(values @ values)
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
