"""Figures of a tensile test from its stress-strain curve: E, nu, Rp0.2, Rm.

Arrays in, one frozen result out. Loads are tension positive, strains dimensionless, stresses Pa.
The elastic slope follows ISO 6892-1 (annex G) in spirit: a straight line through the part of the
curve between two fractions of the proof stress, which is itself found with that line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LOW, HIGH = 0.1, 0.6  # of the proof stress (of the highest stress, where there is none)
OFFSET = 0.002
FEWEST = 5

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Line:
    """A straight line through points: slope, its standard uncertainty, intercept, and how many points."""

    slope: float
    sigma: float
    intercept: float
    n: int


@dataclass(frozen=True, slots=True)
class Tensile:
    """What a tensile test tells; NaN where it does not.

    Attributes
    ----------
    E, sigma_E : float, Pa
        Young's modulus and its standard uncertainty from the scatter about the line.
    nu, sigma_nu : float
        Poisson's ratio over the same part of the curve.
    Rp02 : float, Pa
        Proof stress at 0.2 % plastic strain.
    Rm : float, Pa
        Highest stress.
    n_elastic : int
        Points on the line.
    """

    E: float
    sigma_E: float
    nu: float
    sigma_nu: float
    Rp02: float
    Rm: float
    n_elastic: int


def straight_line(x: Array, y: Array) -> Line:
    """Least-squares line of y over x; NaN with fewer than 3 points or no spread in x.

    Parameters
    ----------
    x, y : (N,) float64
    """
    n = len(x)
    if n < 3 or np.ptp(x) == 0:
        return Line(math.nan, math.nan, math.nan, n)
    dx, dy = x - x.mean(), y - y.mean()
    sxx = float(dx @ dx)
    slope = float(dx @ dy) / sxx
    rest = dy - slope * dx
    sigma = math.sqrt(float(rest @ rest) / (n - 2) / sxx)
    return Line(slope, sigma, float(y.mean() - slope * x.mean()), n)


def tensile_figures(axial: Array, transverse: Array, stress: Array) -> Tensile:
    """Evaluate a test.

    Parameters
    ----------
    axial, transverse : (N,) float64
        Mean strain along and across the load; NaN where unknown.
    stress : (N,) float64, Pa
        Or any multiple of the force: E and the strengths come in the same unit.

    Returns
    -------
    Tensile
    """
    good = np.isfinite(axial) & np.isfinite(transverse) & np.isfinite(stress)
    axial, transverse, stress = axial[good], transverse[good], stress[good]
    if len(stress) < FEWEST or stress.max() <= 0:
        nothing = math.nan
        return Tensile(nothing, nothing, nothing, nothing, nothing, nothing, 0)
    top = int(np.argmax(stress)) + 1  # the loading part alone
    elastic, proof = _elastic_line(axial[:top], stress[:top])
    window = _window(stress[:top], proof if math.isfinite(proof) else float(stress.max()))
    contraction = straight_line(axial[:top][window], -transverse[:top][window])
    return Tensile(
        E=elastic.slope,
        sigma_E=elastic.sigma,
        nu=contraction.slope,
        sigma_nu=contraction.sigma,
        Rp02=proof,
        Rm=float(stress.max()),
        n_elastic=elastic.n,
    )


def _elastic_line(axial: Array, stress: Array) -> tuple[Line, float]:
    """The line and the proof stress found with it, repeated until both agree."""
    proof = math.nan
    limit = 0.5 * float(stress.max())
    line = straight_line(axial, stress)
    for _ in range(6):
        window = _window(stress, limit)
        if window.sum() < FEWEST:
            window = stress <= np.sort(stress)[min(FEWEST, len(stress)) - 1]
        line = straight_line(axial[window], stress[window])
        proof = _proof_stress(axial, stress, line)
        limit = proof if math.isfinite(proof) else float(stress.max())
    return line, proof


def _window(stress: Array, limit: float) -> NDArray[np.bool_]:
    return (stress >= LOW * limit) & (stress <= HIGH * limit)


def _proof_stress(axial: Array, stress: Array, line: Line) -> float:
    """Where the curve crosses the elastic line moved by 0.2 % strain; NaN where it never does."""
    if not line.slope > 0:
        return math.nan
    plastic = axial - (stress - line.intercept) / line.slope
    beyond = np.flatnonzero(plastic >= OFFSET)
    if not len(beyond) or beyond[0] == 0:
        return math.nan
    i = int(beyond[0])
    part = (OFFSET - plastic[i - 1]) / (plastic[i] - plastic[i - 1])
    return float(stress[i - 1] + part * (stress[i] - stress[i - 1]))
