"""The elastic line of a stress-strain curve: modulus by regression and by chord, Poisson's ratio, direction.

The noise of an optical strain is no smaller than that of the force, so that a least-squares line of stress
over strain would be too flat; the line here allows for both noises (W. E. Deming, Statistical Adjustment of
Data, 1943; W. A. Fuller, Measurement Error Models, 1987, doi:10.1002/9780470316665, section 1.3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from acquire.text import Message
from acquire.text.message import counted
from analysis.evaluate.curve import Loading, UncertainValue, first_crossing, noise, reading
from analysis.evaluate.figure import Figure

Floats = NDArray[np.float64]

MIN_POINTS = 8
"""Points that a line needs."""
BLUR_STRAIN = 30e-6 / 0.5**2
"""Largest error of a strain by a change of sharpness, over the variance of the blur, 1/px^2 (docs/data/accuracy.md)."""

_CLEAR = 20.0  # standard deviations of the noise that strains must move to have a direction
_CLEAR_STRAIN, _CLEAR_RATIO = 1e-4, 1.5  # above vibration and warming; and over the strain across
_UNEVEN_SIGMA, _UNEVEN_SHARE = 3.0, 0.02  # of a strain that is not uniform: over its noise, and of the strain
_CLEAR_BLUR = 3.0  # standard uncertainties of the rise of that variance with the strain
# Of the points of the interval: read at each end of a chord; and of their usual distance
_END, _BESIDE = 0.1, 1.5


@dataclass(frozen=True, slots=True)
class FittedLine:
    """stress = slope (strain - strain0), from points of both noises.

    Attributes
    ----------
    slope, sigma : float, Pa
        And its standard uncertainty.
    strain0 : float
        Where the line has no stress.
    r2 : float
        Coefficient of determination.
    n : int
    middle : float, Pa
        Mean stress of the points.
    scatter : float
        Standard deviation of the points about the line, in strain.
    first, last : int
        The points are ``first:last`` of the loading.
    """

    slope: float
    sigma: float
    strain0: float
    r2: float
    n: int
    middle: float
    scatter: float
    first: int
    last: int

    def strain_at(self, stress: float | Floats) -> float | Floats:
        """Strain of the line at a stress."""
        return self.strain0 + stress / self.slope

    def sigma_at(self, stress: float) -> float:
        """Standard uncertainty of ``strain_at``."""
        return math.hypot(
            self.scatter / math.sqrt(self.n), (stress - self.middle) / self.slope * self.sigma / self.slope
        )

    def modulus(self, beyond: float = 0.0) -> Figure:
        """The slope with its interval, Pa; ``beyond`` the scatter, a relative standard uncertainty counts too.

        Degrees of freedom by Welch and Satterthwaite (JCGM 100:2008, G.4).
        """
        sigma = math.hypot(self.sigma, beyond * self.slope)
        dof = (self.n - 2) * (sigma / self.sigma) ** 4 if self.sigma > 0 else math.inf
        return Figure.about(self.slope, sigma, dof)


FILM = "film"


@dataclass(frozen=True, slots=True)
class ErrorLimits:
    """What a modulus is uncertain by beyond the scatter: limits of error, between which all values are as likely.

    Attributes
    ----------
    force, section : float or None
        Relative; None: not stated.
    strain : float or None
        Of what comes with the load over the elastic interval: motion off the plane, lens, alignment.
    film : float or None
        Relative, of every strain: a codec that makes a picture of earlier ones holds motion back.
    """

    force: float | None = None
    section: float | None = None
    strain: float | None = None
    film: float | None = None

    def shares(self, strain: float) -> dict[str, float]:
        """Relative standard uncertainties (JCGM 100:2008, 4.3.7) of a slope over ``strain``; of what is stated."""
        relative = None if self.strain is None else self.strain / strain
        limits = {"load cell": self.force, "section": self.section, "strain": relative, FILM: self.film}
        return {name: limit / math.sqrt(3) for name, limit in limits.items() if limit is not None}


def lens_share(loading: Loading, line: FittedLine, strained: float) -> dict[str, float]:
    """The largest uncertainty of the strain by a corrected lens in the elastic interval, over ``strained``.

    All of it may come with the load: the error of a lens is the same in every picture of a motion.
    """
    sigma = loading.lens[line.first : line.last]
    return {"lens": float(np.nanmax(sigma)) / strained} if np.isfinite(sigma).any() else {}


def blur_share(loading: Loading, line: FittedLine) -> dict[str, float]:
    """What a change of sharpness that comes with the load may make of the strain; nothing where none is clear.

    The error grows with the variance of the blur, to ``BLUR_STRAIN`` at most: a limit, as of ``ErrorLimits``.
    """
    part = slice(line.first, line.last)
    blur, strain = loading.blur[part], loading.strain[part]
    known = np.isfinite(blur)
    n = int(known.sum())
    if n < MIN_POINTS:
        return {}
    x, y = (values[known] - values[known].mean() for values in (strain, np.copysign(blur**2, blur)))
    sxx = float(x @ x)
    slope = float(x @ y) / sxx
    rest = y - slope * x
    sigma = math.sqrt(float(rest @ rest) / (n - 2) / sxx)
    return {"blur": BLUR_STRAIN * abs(slope) / math.sqrt(3)} if abs(slope) > _CLEAR_BLUR * sigma else {}


def line_through(loading: Loading, first: int, last: int) -> FittedLine | None:
    """The line through the points ``first:last``; None where they are too few or do not rise."""
    x, y = loading.strain[first:last], loading.stress[first:last]
    n = len(x)
    if n < MIN_POINTS:
        return None
    dx, dy = x - x.mean(), y - y.mean()
    sxx, sxy, syy = float(dx @ dx), float(dx @ dy), float(dy @ dy)
    if not (sxy > 0 and sxx > 0 and syy > 0):
        return None
    slope = _slope(sxx, sxy, syy, loading.noise_strain, loading.noise_stress)
    rest = dx - dy / slope
    scatter = math.sqrt(float(rest @ rest) / (n - 2))
    sigma = slope * slope * scatter / math.sqrt(slope * sxy)
    strain0 = float(x.mean() - y.mean() / slope)
    return FittedLine(slope, sigma, strain0, sxy**2 / sxx / syy, n, float(y.mean()), scatter, first, last)


def _slope(sxx: float, sxy: float, syy: float, noise_x: float, noise_y: float) -> float:
    """Deming's slope; without any noise that of strain over stress."""
    if noise_x == 0 and noise_y > 0:
        return sxy / sxx
    if noise_x == 0 or noise_y / noise_x < 1e-6 * syy / sxy:
        return syy / sxy
    share = (noise_y / noise_x) ** 2
    half = syy - share * sxx
    root = math.hypot(half, 2 * math.sqrt(share) * sxy)
    # Both are one number; the first loses its digits where half is negative.
    return (half + root) / (2 * sxy) if half > 0 else 2 * share * sxy / (root - half)


def between(course: Floats, low: float, high: float) -> tuple[int, int]:
    """The points of the last rise from ``low`` to the first ``high``; (0, 0) where it is never reached."""
    over = first_crossing(course, high)
    if math.isnan(over):
        return 0, 0
    stop = math.floor(over) + 1
    below = np.flatnonzero(course[:stop] < low)
    return (int(below[-1]) + 1 if len(below) else 0), stop


def chord(loading: Loading, line: FittedLine, beyond: float = 0.0) -> Figure:
    """The modulus by the two ends of the interval of ``line``, each read from a tenth of its points.

    ``beyond`` is a relative standard uncertainty that counts beside that of the ends.
    """
    (e0, e1), (s0, s1) = (
        _ends(values, loading.strain, line, sigma)
        for values, sigma in ((loading.strain, loading.noise_strain), (loading.stress, loading.noise_stress))
    )
    rise, run = s1.value - s0.value, e1.value - e0.value
    if not (rise > 0 and run > 0):
        return Figure.none(Message("the two ends of the interval do not differ"))
    share = math.hypot(math.hypot(e0.sigma, e1.sigma) / run, math.hypot(s0.sigma, s1.sigma) / rise)
    return Figure.about(rise / run, rise / run * math.hypot(share, beyond))


def poisson(loading: Loading, line: FittedLine) -> Figure:
    """Poisson's ratio over the interval of ``line``.

    Both strains are fitted against the stress, whose noise is the least, and the slopes divided.
    """
    across, stress = loading.transverse[line.first : line.last], loading.stress[line.first : line.last]
    known = np.isfinite(across)
    n = int(known.sum())
    if n < MIN_POINTS:
        return Figure.none(
            Message(
                "the transverse strain is known at {n} points of the elastic part, {MIN_POINTS} are needed",
                n,
                MIN_POINTS,
            )
        )
    ds, dt = stress[known] - stress[known].mean(), across[known] - across[known].mean()
    sss = float(ds @ ds) - (n - 1) * loading.noise_stress**2
    if not sss > 0:
        return Figure.none(Message("the stress does not rise above its noise in the elastic part"))
    slope = -float(ds @ dt) / sss
    rest = dt + slope * ds
    sigma = math.sqrt(float(rest @ rest) / (n - 2) / sss)
    nu = slope * line.slope
    return Figure.about(nu, math.hypot(sigma * line.slope, nu * line.sigma / line.slope), n - 2)


def poisson_between(loading: Loading, low: float, high: float) -> Figure:
    """Poisson's ratio between two strains along the load, or up to the highest stress: the slope of one over the other.

    The noise of the strain along the load is taken out of its variance.
    """
    along, across = (values[: loading.top + 1] for values in (loading.elastic, loading.transverse))
    used = (along >= low) & (along <= high) & np.isfinite(across)
    n, reached = int(used.sum()), float(np.nanmax(along))
    if n < MIN_POINTS:
        return Figure.none(
            Message(
                "only {measurements} between the strains {low:g} and {high:g} %, {MIN_POINTS} are needed: take more "
                "pictures there (the strain reaches {reached:.2g} %)",
                counted(n, "measurement"),
                100 * low,
                100 * high,
                MIN_POINTS,
                100 * reached,
            )
        )
    x, y = along[used] - along[used].mean(), across[used] - across[used].mean()
    sxx = float(x @ x) - (n - 1) * noise(loading.elastic) ** 2
    if not sxx > 0:
        return Figure.none(Message("the strain does not rise above its noise there"))
    slope = float(x @ y) / sxx
    rest = y - slope * x
    words = Message("strains {low:g} to {least:.3g} %", 100 * low, 100 * min(high, reached))
    return Figure.about(-slope, math.sqrt(float(rest @ rest) / (n - 2) / sxx), n - 2, words)


def not_uniform(loading: Loading, line: FittedLine) -> str:
    """A remark where the strain varies over its area, in the upper half of the interval of ``line``; else empty.

    E and nu are then slopes of a mean strain, and not those of the material.
    """
    half = slice((line.first + line.last) // 2, line.last)
    uneven, misfit = loading.uneven[half], loading.misfit[half]
    if not np.isfinite(misfit).any() or np.nanmedian(misfit) < _UNEVEN_SIGMA:
        return ""
    noise_free = np.sqrt(np.maximum(1 - 1 / np.maximum(misfit, 1) ** 2, 0))
    share = float(
        np.nanmedian(uneven * noise_free) / np.nanmedian(np.abs(loading.elastic[half] - line.strain0))
    )
    return Message("the strain varies by {share:.0%} over the region", share) if share > _UNEVEN_SHARE else ""


def principal_direction(exx: Floats, eyy: Floats, exy: Floats) -> Figure:
    """The angle of the largest principal strain to x, rad, positive clockwise on the screen (y points down).

    Of the strains that come with the load: the line through the points (exx - eyy, 2 exy) of all instants has
    twice the angle, and what is common to them (the noise of the reference) does not turn it.

    Parameters
    ----------
    exx, eyy, exy : (N,) float64
        Means of a test that pulls; NaN where unknown.
    """
    known = np.isfinite(exx) & np.isfinite(eyy) & np.isfinite(exy)
    n = int(known.sum())
    if n < MIN_POINTS:
        return Figure.none(
            Message("strains are known at {n} instants, {MIN_POINTS} are needed", n, MIN_POINTS)
        )
    cloud = np.stack([exx[known] - eyy[known], 2 * exy[known]])
    moved = cloud - cloud.mean(axis=1, keepdims=True)
    away = np.hypot(cloud[0] - cloud[0, 0], cloud[1] - cloud[1, 0])
    if away.max() <= _CLEAR * math.hypot(noise(cloud[0]), noise(cloud[1])):
        return Figure.none(Message("the strains hardly change"))
    xx, xy, yy = float(moved[0] @ moved[0]), float(moved[0] @ moved[1]), float(moved[1] @ moved[1])
    turn = 0.5 * math.atan2(2 * xy, xx - yy)
    line = np.array([math.cos(turn), math.sin(turn)])
    if line @ (cloud[:, int(np.argmax(away))] - cloud[:, 0]) < 0:
        turn += math.pi
    along, beside = line @ moved, line[0] * moved[1] - line[1] * moved[0]
    sigma = math.sqrt(float(beside @ beside) / (n - 2) / max(float(along @ along), 1e-300))
    return Figure.about(0.5 * math.remainder(turn, 2 * math.pi), 0.5 * sigma, n - 2)


@dataclass(frozen=True, slots=True)
class LoadAxis:
    """Along which side of the picture a test is loaded.

    Attributes
    ----------
    axis : "x" or "y"
    found : bool
        Whether it follows from the strains; else it is as given, or assumed to be y.
    angle : Figure
        Angle from the axis to the direction whose length changes most, rad, positive clockwise on the screen.
    assumed : bool
        It was not given, and the strains do not decide.
    """

    axis: Literal["x", "y"]
    found: bool
    angle: Figure
    assumed: bool = False


def load_axis(
    exx: Floats, eyy: Floats, exy: Floats, given: str = "auto", sigma: Floats | None = None
) -> LoadAxis:
    """The axis of the load: as ``given`` ("x", "y"), or found: nearest to the strain of largest magnitude.

    That holds for pulling and pressing, where Poisson's ratio is below 1. It is found once the angle and its
    interval lie within 45 degrees of it; of few instants, once one strain is far above its noise and the other.

    Parameters
    ----------
    exx, eyy, exy : (N,) float64
        Strains of a test; NaN where unknown.
    given : "x", "y" or "auto"
    sigma : (N,) float64, optional
        The larger standard uncertainty of ``exx`` and ``eyy``; without it few instants decide nothing.
    """
    angle = principal_direction(exx, eyy, exy)
    if angle.known:
        angle = angle.minus(0.0 if _is_longest(angle.value, exx, eyy, exy) else math.pi / 2)
    offs = {axis: _turned(angle, at) for axis, at in (("x", 0.0), ("y", math.pi / 2))}
    axis: Literal["x", "y"]
    if given in offs:
        axis = "x" if given == "x" else "y"
        return LoadAxis(axis, False, offs[axis])
    axis = "x" if abs(offs["x"].value) < math.pi / 4 else "y"
    if max(abs(offs[axis].low), abs(offs[axis].high)) < math.pi / 4:
        return LoadAxis(axis, True, offs[axis])
    clear = None if angle.known or sigma is None else _clear_axis(exx, eyy, sigma)
    return LoadAxis(clear or "y", clear is not None, offs[clear or "y"], clear is None)


def _clear_axis(exx: Floats, eyy: Floats, sigma: Floats) -> Literal["x", "y"] | None:
    """The axis of the larger strain, where one instant shows it clearly."""
    strains = np.abs(np.stack([exx, eyy]))
    larger, smaller = strains.max(axis=0), strains.min(axis=0)
    limit = np.maximum(np.maximum(_CLEAR * sigma, _CLEAR_STRAIN), _CLEAR_RATIO * smaller)
    clear = np.flatnonzero(larger > limit)
    if not len(clear):
        return None
    first, second = strains[:, clear[np.argmax(larger[clear])]]
    return "x" if first > second else "y"


def _is_longest(angle: float, exx: Floats, eyy: Floats, exy: Floats) -> bool:
    """Whether strain along ``angle`` has changed more than across it, where both have changed most."""
    known = np.isfinite(exx) & np.isfinite(eyy) & np.isfinite(exy)
    c, s = math.cos(angle), math.sin(angle)
    turn = 2 * exy[known] * s * c
    along = exx[known] * c * c + eyy[known] * s * s + turn
    across = exx[known] * s * s + eyy[known] * c * c - turn
    most = int(np.argmax(np.abs((along - along[0]) - (across - across[0]))))
    return bool(abs(along[most] - along[0]) >= abs(across[most] - across[0]))


def _turned(angle: Figure, at: float) -> Figure:
    """From the direction ``at`` (rad), of two ways the nearer."""
    turned = angle.minus(at)
    return turned.minus(math.pi * round(turned.value / math.pi)) if turned.known else turned


def _ends(
    values: Floats, strain: Floats, line: FittedLine, min_sigma: float
) -> tuple[UncertainValue, UncertainValue]:
    reach = max(3, round(_END * line.n))
    # Beyond the interval samples may lie farther apart, up to yield: those are not beside its end.
    beside = _BESIDE * reach * float(strain[line.last - 1] - strain[line.first]) / (line.n - 1)
    found = []
    for k in (line.first, line.last - 1):
        first = max(k - reach, 0)
        near = first + np.flatnonzero(np.abs(strain[first : k + reach + 1] - strain[k]) <= beside)
        found.append(reading(values, k, int(near[0]), int(near[-1]) + 1, min_sigma))
    return found[0], found[1]
