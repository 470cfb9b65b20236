"""What is known of the noise: a standard deviation, or one that grows with the light."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class NoiseModel:
    """Noise of a camera that grows with the signal, for an average of n frames.

    The variance of one frame at grey level mu is ``gain * mu + read**2 + 1/12``, the last term
    being the quantisation to whole grey levels.

    Attributes
    ----------
    gain : float, GL per electron
        Slope of the variance over the grey level (dark level already subtracted).
    read : float, GL
        Standard deviation without light.
    saturation : float, GL
        Level at and above which a pixel counts as clipped.
    n : int
        Frames averaged.
    """

    gain: float
    read: float
    saturation: float = float("inf")
    n: int = 1

    def __post_init__(self) -> None:
        if not (self.gain >= 0 and self.read >= 0 and self.n >= 1):
            raise ValueError(f"a noise model needs gain >= 0, read >= 0 and n >= 1, got {self}")

    @property
    def floor(self) -> float:
        """Variance of the average at zero signal, GL^2."""
        return (self.read**2 + 1 / 12) / self.n

    @property
    def slope(self) -> float:
        """Growth of the variance of the average with the grey level, GL."""
        return self.gain / self.n

    def variance(self, level: NDArray[np.floating] | float) -> NDArray[np.float64]:
        """Variance of the average of n frames at a grey level, GL^2."""
        above = np.asarray(level, np.float64)
        if self.slope == 0:
            return np.full(above.shape, self.floor)
        return np.asarray(self.floor + self.slope * np.maximum(above, 0))

    def averaged(self, n: int) -> NoiseModel:
        """The same camera with n frames averaged."""
        return replace(self, n=n)


Noise = float | NoiseModel
"""Standard deviation of an image in GL, or a model of it."""


def as_model(noise: Noise) -> NoiseModel:
    """A plain standard deviation (GL, of the image as given, quantisation included) as a model.

    Raises
    ------
    ValueError
        Negative or not finite.
    """
    if isinstance(noise, NoiseModel):
        return noise
    if not (np.isfinite(noise) and noise >= 0):
        raise ValueError(f"noise must be a standard deviation in grey levels, got {noise}")
    # n only scales the quantisation term away: the given value already contains it.
    return _PlainNoise(gain=0.0, read=float(noise))


@dataclass(frozen=True, slots=True)
class _PlainNoise(NoiseModel):
    """A standard deviation that is taken as it is, at every level."""

    @property
    def floor(self) -> float:
        return self.read**2
