"""What the grey levels of a few frames say of light and of the bits that are really there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

PILED = 1e-3
"""Share of pixels at one and the same highest level, below the top of the scale, that is no chance."""


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
    low, high = np.percentile(pixels, (1, 99)) / top
    highest = pixels.max()
    return Exposure(
        low=float(low),
        mean=float(pixels.mean(dtype=np.float64)) / top,
        high=float(high),
        saturated=float((pixels >= top).any(axis=0).mean()),
        dark=float((pixels == 0).any(axis=0).mean()),
        piled=float((pixels == highest).mean()) if highest < top else 0.0,
    )


def depth(pixels: NDArray[Any], bits: int) -> Depth:
    """Which bits change at all between the pixels of a few frames, (N, P) uint8 or uint16."""
    flat = pixels.reshape(-1)
    changing = int(np.bitwise_or.reduce(flat ^ flat[0]))
    if changing == 0:
        return Depth(bits, bits, 0)
    below = (changing & -changing).bit_length() - 1
    return Depth(bits, max(bits - changing.bit_length(), 0), below)
