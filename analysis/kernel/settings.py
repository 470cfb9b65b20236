"""How the kernel measures: its settings as a frozen dataclass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from analysis.field import WINDOWS, Window

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
        Phase and amplitude with the gain as a nuisance, or phase alone (the paper's method).
    order : 1 or 2
        Of the shape function of a ZOI: affine or quadratic.
    interpolant : 1, 3 or 5
        Degree of the B-spline that warps the deformed image.
    max_iterations : int
        A ZOI that has not converged by then is NOT_CONVERGED.
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
        An impossible value; the message names the allowed ones.
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
        if self.max_iterations < 1 or self.max_iterations != int(self.max_iterations):
            raise ValueError(f"max_iterations must be a whole number from 1 on, got {self.max_iterations}")
        for name in ("tolerance_px", "tolerance_strain", "tolerance_sigma", "bending_px"):
            if not getattr(self, name) >= 0:
                raise ValueError(f"{name} must not be negative, got {getattr(self, name)}")


def _one_of(name: str, value: object, allowed: tuple[object, ...]) -> None:
    if value not in allowed or isinstance(value, float | bool):
        raise ValueError(f"{name} = {value!r} is not possible; allowed: {', '.join(map(str, allowed))}")
