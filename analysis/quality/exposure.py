"""What the grey levels of a few frames show of light and of the bits that really change."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


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
        Share of all values at the highest one, where that is below the top: clipped before it came here.
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


def exposure(pixels: NDArray[Any], top: int) -> Exposure:
    """Light, from the pixels of a few frames, (N, P) uint8 or uint16; ``top`` (GL) is where they saturate."""
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
