"""Plastic flow of a sheet metal: r-value (ISO 10113:2020), n-value (ISO 10275:2020), and where it necks.

r and n are slopes by regression over true plastic strains of the uniform part, up to the highest stress; volume is
kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from acquire.text import Message
from analysis.evaluate.curve import Floats, Loading
from analysis.evaluate.elastic import MIN_POINTS, FittedLine
from analysis.evaluate.figure import Figure, quantile
from analysis.field import StrainField

R_BETWEEN, N_BETWEEN, N_EARLY = (0.02, 0.2), (0.1, 0.2), (0.02, 0.1)
"""Plastic strains (engineering) that the slopes are taken between, or up to the highest stress where that is earlier;
that of n begins early where the highest stress comes before 12 %."""
_REACH = 1.2  # of the beginning of an interval: plastic strain that must be reached
_SECTIONS = 5  # across the load, that a neck is sought among
_CLEAR_SIGMA, _CLEAR_SHARE, _CLEAR_STRAIN = 5.0, 1.0, 1e-3  # of a neck, beyond the growth elsewhere
_LEAST = 0.04  # plastic strain that n needs


@dataclass(frozen=True, slots=True, eq=False)
class PlasticPart:
    """The uniform part of a curve after the elastic interval.

    Attributes
    ----------
    along, across : (N,) float64
        True plastic strains along and across the load; NaN where unknown.
    stress : (N,) float64, Pa
        True stress.
    elastic : (N,) float64
        Elastic strain along the load.
    """

    along: Floats
    across: Floats
    stress: Floats
    elastic: Floats

    @classmethod
    def of(cls, loading: Loading, line: FittedLine, nu: float) -> PlasticPart:
        """With the elastic part of both strains taken away by the elastic ``line`` and Poisson's ratio."""
        part = slice(line.last, loading.top + 1)
        strain = loading.strain[part] - line.strain0
        stress = loading.stress[part] * (1 + strain)
        elastic = stress / line.slope
        across = np.log1p(loading.narrowing[part]) + nu * elastic
        return cls(np.log1p(strain) - elastic, across, stress, elastic)

    @property
    def reached(self) -> float:
        """The largest plastic strain, engineering; 0 of none."""
        known = self.along[np.isfinite(self.along)]
        return math.expm1(float(known.max())) if len(known) else 0.0

    def between(self, low: float, high: float) -> np.ndarray:
        """Points between two plastic strains, engineering, where all is known, (N,) bool."""
        return np.asarray((self.along >= math.log1p(low)) & (self.along <= math.log1p(high)))


def anisotropy(loading: Loading, line: FittedLine, nu: Figure) -> Figure:
    """r: true plastic strain of the width over that of the thickness; ``why`` has the interval.

    Its uncertainty has those of E and Poisson's ratio, by which the elastic strains are taken away.
    """
    if not nu.known:
        return Figure.none(nu.why)
    part = PlasticPart.of(loading, line, nu.value)
    (low, high), reached = R_BETWEEN, part.reached
    if reached < _REACH * low:
        return Figure.none(_short(reached, low))
    used = part.between(low, high) & np.isfinite(part.across)
    if np.count_nonzero(used) < MIN_POINTS:
        return Figure.none(_few(int(np.count_nonzero(used)), low, min(high, reached)))
    slope, sigma, n = _slope(part.along[used], part.across[used])
    if not -1 < slope < 0:
        return Figure.none(
            Message("the width does not shrink as the length grows: is the load along the axis?")
        )
    share, _, _ = _slope(part.along[used], part.elastic[used])
    sigma_nu = (nu.high - nu.low) / 2 / quantile()
    # nu is made with E, so E changes the elastic strain of the length alone; for another nu this is more than enough.
    elastic = abs(share) * math.hypot(sigma_nu, slope * line.sigma / line.slope)
    return Figure.about(
        -slope / (1 + slope),
        math.hypot(sigma, elastic) / (1 + slope) ** 2,
        n - 2,
        _over(low, min(high, reached)),
    )


def hardening(loading: Loading, line: FittedLine) -> Figure:
    """n: slope of the logarithm of true stress over that of true plastic strain; ``why`` has the interval."""
    part = PlasticPart.of(loading, line, 0.0)
    reached = part.reached
    if reached < _LEAST:
        return Figure.none(_short(reached, _LEAST))
    low, high = N_BETWEEN if reached >= _REACH * N_BETWEEN[0] else N_EARLY
    used = part.between(low, high) & (part.stress > 0)
    if np.count_nonzero(used) < MIN_POINTS:
        return Figure.none(_few(int(np.count_nonzero(used)), low, min(high, reached)))
    slope, sigma, n = _slope(np.log(part.along[used]), np.log(part.stress[used]))
    return Figure.about(slope, sigma, n - 2, _over(low, min(high, reached)))


def true_at_top(strength: Figure, strain: Figure) -> tuple[Figure, Figure]:
    """True stress (Pa) and logarithmic strain of the highest stress and the extension there, where a neck begins.

    Volume is kept, and the strain is uniform up to there. Both must be known.
    """
    stretch, ends = strain.minus(-1.0), ("value", "low", "high")
    stress: dict[str, Any] = {end: getattr(strength, end) * getattr(stretch, end) for end in ends}
    logarithm: dict[str, Any] = {end: math.log(getattr(stretch, end)) for end in ends}
    return replace(strength, **stress, why=""), replace(strain, **logarithm, why="")


@dataclass(frozen=True, slots=True)
class Neck:
    """Where strain grows after the highest stress while the rest of the specimen rests.

    Attributes
    ----------
    x, y : float, px
        Middle of the neck on the reference picture.
    growth : float
        Of the strain along the load there, in the section that grows most.
    elsewhere : float
        Median growth over the sections.
    """

    x: float
    y: float
    growth: float
    elsewhere: float


def neck(before: StrainField, after: StrainField, axis: Literal["x", "y"]) -> Neck | None:
    """The neck between two fields after the highest stress; None where the strain grows evenly, or hardly.

    Parameters
    ----------
    before, after : StrainField
        On one grid.
    axis : "x" or "y"
        Of the load.
    """
    name, across = ("exx", 0) if axis == "x" else ("eyy", 1)
    both = before.ok & after.ok
    count = both.sum(axis=across)
    known = count >= max(1, 0.5 * count.max())
    if np.count_nonzero(known) < _SECTIONS:
        return None
    growth = np.where(both, after.value(name) - before.value(name), 0.0).sum(axis=across)
    variance = np.where(both, after.sigma(name) ** 2 + before.sigma(name) ** 2, 0.0).sum(axis=across)
    mean, sigma = growth[known] / count[known], np.sqrt(variance[known]) / count[known]
    k, elsewhere = int(np.argmax(mean)), float(np.median(mean))
    if mean[k] - elsewhere < max(_CLEAR_SIGMA * sigma[k], _CLEAR_SHARE * abs(elsewhere), _CLEAR_STRAIN):
        return None
    grid, at = before.grid, np.flatnonzero(known)[k]
    section = np.zeros(grid.shape, np.bool_)
    section[(slice(None), at) if across == 0 else (at, slice(None))] = True
    rows, columns = np.nonzero(section & grid.active)
    return Neck(float(grid.x[columns].mean()), float(grid.y[rows].mean()), float(mean[k]), elsewhere)


def _slope(x: Floats, y: Floats) -> tuple[float, float, int]:
    """Slope of y over x by least squares, its standard uncertainty, and the number of points."""
    dx, dy = x - x.mean(), y - y.mean()
    sxx = float(dx @ dx)
    slope = float(dx @ dy) / sxx
    rest = dy - slope * dx
    return slope, math.sqrt(float(rest @ rest) / (len(x) - 2) / sxx), len(x)


def _over(low: float, high: float) -> str:
    return Message("plastic strains {low:.3g} to {high:.3g} %", 100 * low, 100 * high)


def _short(reached: float, needed: float) -> str:
    return Message(
        "the plastic strain reaches {most:.2g} %, {needed:g} % is needed",
        100 * max(reached, 0.0),
        100 * needed,
    )


def _few(n: int, low: float, high: float) -> str:
    return Message("{n} points over {over}, {MIN_POINTS} are needed", n, _over(low, high), MIN_POINTS)
