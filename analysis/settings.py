"""How the kernel measures, and what it knows of the noise: settings as frozen dataclasses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from analysis.windows import WINDOWS, Window

Estimator = Literal["spectral", "phase"]
DEGREES = (1, 3, 5)


@dataclass(frozen=True, slots=True)
class KernelSettings:
    """The settings of a ``PhaseKernel``; the defaults are what to use without thinking.

    Attributes
    ----------
    window : "gaussian" | "uniform" | "tukey" | "bi-triangular"
        The least-squares weight of a ZOI (gaussian: sigma = size/6).
    estimator : "spectral" | "phase"
        Phase and amplitude with the gain as a nuisance, or phase alone (the paper's road).
    order : 1 or 2
        Of the shape function of a ZOI: affine or quadratic.
    interpolant : 1, 3 or 5
        Degree of the B-spline that warps the deformed image.
    max_iterations : int
        A ZOI that has not settled by then is NOT_CONVERGED.
    tolerance_px : float, px
        Iteration stops when the error left in u and v is predicted below this ...
    tolerance_strain : float
        ... and that of each gradient below this ...
    tolerance_sigma : float
        ... or below this share of the value's own standard uncertainty, where that is more.
    bending_px : float, px
        A ZOI is UNEVEN whose displacement bends or jumps by more than this beside what noise and a
        steady strain explain; inf accepts all, for a smooth field that the ZOIs are meant to average.

    Raises
    ------
    ValueError
        An impossible value; the message says what is allowed.
    """

    window: Window = "gaussian"
    estimator: Estimator = "spectral"
    order: int = 1
    interpolant: int = 5
    max_iterations: int = 12
    tolerance_px: float = 5e-5
    tolerance_strain: float = 1e-6
    tolerance_sigma: float = 0.05
    bending_px: float = 0.05

    def __post_init__(self) -> None:
        _one_of("window", self.window, WINDOWS)
        _one_of("estimator", self.estimator, get_args(Estimator))
        _one_of("order", self.order, (1, 2))
        _one_of("interpolant", self.interpolant, DEGREES)
        if self.estimator == "phase" and self.order != 1:
            raise ValueError('estimator "phase" has order 1 only')
        if self.max_iterations < 1:
            raise ValueError(f"max_iterations must be at least 1, got {self.max_iterations}")
        for name in ("tolerance_px", "tolerance_strain", "tolerance_sigma", "bending_px"):
            if not getattr(self, name) >= 0:
                raise ValueError(f"{name} must not be negative, got {getattr(self, name)}")


def _one_of(name: str, value: object, allowed: tuple[object, ...]) -> None:
    if value not in allowed:
        raise ValueError(f"{name} = {value!r} is not possible; allowed: {', '.join(map(str, allowed))}")


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
