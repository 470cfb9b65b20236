"""Motion while a picture or a burst is taken: what it adds to the strain.

A rolling shutter reads lines one after the other, so that motion at v px/s shows v T / H as strain along their normal.
The picture is stamped at its middle line. The velocity is that of the mean displacement since the burst before, so it
holds for rigid motion, not for the strain rate within the picture.

The readout time T is found from the bands of a flickering lamp: on mains of 50 or 60 Hz it flickers at F = 100 or
120 Hz, and a picture whose lines are read over T shows F T bands. Or it is found from a specimen that is moved: along
the lines' normal at v it shows the strain v T / (H - 1), and along the lines a shear.

The mean of the frames of a burst is the picture at its time only at a steady rate. The mean of a burst during T, in
which the strain rate changes by r at s after its middle, is off by ``r (T/2 - |s|)^2 / (2 T)``, at most ``r T / 8``.
From the bursts before, its strain is then off by as much or more: that is the bound which is taken as its standard
uncertainty, where noise does not explain it. At a steady rate nothing is added: blur that is alike on both sides does
not shift a picture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquire.text import Message
from analysis.field import CommonError, StrainField
from analysis.optics.plane import affine_values


@dataclass(frozen=True, slots=True)
class _Place:
    """Mean displacement at a time: t in s, u and v in px with standard uncertainties."""

    t: float
    u: tuple[float, float]
    v: tuple[float, float]


class ShutterCorrection:
    """Removes the shutter from each field, in the order of time.

    Parameters
    ----------
    readout_s : float, s
        From the first line of the picture to the last.
    height : int
        Lines of the picture.
    sigma_s : float, s
        Standard uncertainty of ``readout_s``.
    """

    def __init__(self, readout_s: float, height: int, sigma_s: float = 0.0) -> None:
        self._relative = sigma_s / readout_s if readout_s else 0.0
        self._a_line = readout_s / max(height - 1, 1)
        self._middle = (height - 1) / 2
        self._last: _Place | None = None

    def apply(self, field: StrainField, t: float) -> StrainField:
        """``field`` of a burst at ``t`` (s) as if all lines were read at once; as it is where nothing was measured."""
        here, last = _Place(t, field.mean("u"), field.mean("v")), self._last
        if not math.isfinite(here.u[0]):
            return field
        self._last = here
        if last is None or t <= last.t:
            return field
        (vx, sx), (vy, sy) = (
            _rate(now, before, t - last.t) for now, before in ((here.u, last.u), (here.v, last.v))
        )
        return self._removed(field, (vx, vy), (sx, sy))

    def _removed(
        self, field: StrainField, velocity: tuple[float, float], sigma: tuple[float, float]
    ) -> StrainField:
        _, _, _, v, dv_dx, dv_dy = affine_values(field)
        late = self._a_line * (field.grid.y[:, None] + v - self._middle)
        along_x, along_y = self._a_line * dv_dx, self._a_line * (1 + dv_dy)
        moved = np.array([late, along_x, along_y])
        half, parameters = len(field.parameters) // 2, field.parameters.copy()
        parameters[:3] -= velocity[0] * moved
        parameters[half : half + 3] -= velocity[1] * moved
        shapes = np.zeros((3, 6, *field.grid.shape))
        shapes[0, :3] = shapes[1, 3:] = np.nan_to_num(moved)
        shapes[2] = velocity[0] * shapes[0] + velocity[1] * shapes[1]  # of the readout time, relative
        error = CommonError(shapes, np.diag(np.square([*sigma, self._relative])))
        return replace(field, parameters=parameters, common=error.beside(field.common))


def _rate(now: tuple[float, float], before: tuple[float, float], seconds: float) -> tuple[float, float]:
    """Change of a value and its standard uncertainty over a time."""
    return (now[0] - before[0]) / seconds, math.hypot(now[1], before[1]) / seconds


Floats = NDArray[np.float64]
CERTAIN = 3.0
"""A change of the strain rate is one beyond so many of its standard uncertainties."""
STRAINS = ("exx", "eyy", "exy")


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    t: float
    field: StrainField
    means: dict[str, tuple[float, float]]


class BurstMotion:
    """Adds to each field, in the order of time, what an uneven motion during its burst can do to it."""

    def __init__(self) -> None:
        self._before: list[_Seen] = []

    def apply(self, field: StrainField, t: float, duration: float) -> StrainField:
        """``field`` of a burst at ``t`` with this error, common to its ZOIs; as it is without a ``duration`` (s)."""
        here = _Seen(t, field, {name: field.mean(name) for name in STRAINS})
        before, self._before = self._before, [*self._before[-1:], here]
        if duration <= 0 or len(before) < 2 or not before[0].t < before[1].t < here.t:
            return field
        ahead = (here.t - before[1].t) / (before[1].t - before[0].t)
        shares = (ahead, -1 - ahead, 1.0)  # of the three: how far the last is off a straight line
        unexplained = 0.0
        for name in STRAINS:
            off, noise = 0.0, 0.0
            for share, seen in zip(shares, (*before, here), strict=True):
                off += share * seen.means[name][0]
                noise += (share * seen.means[name][1]) ** 2
            if abs(off) > CERTAIN * math.sqrt(noise):  # NaN: never
                unexplained = max(unexplained, 1 - CERTAIN**2 * noise / off**2)
        if not unexplained:
            return field
        affine = (
            affine_values(seen.field) * share for share, seen in zip(shares, (*before, here), strict=True)
        )
        error = CommonError(np.nan_to_num(sum(affine))[None], np.array([[unexplained]]))
        return replace(field, common=error.beside(field.common))


LAMP_SIGMA = 5e-4
"""Relative standard uncertainty of the frequency of the mains."""
MIN_PICTURES, MAX_ERROR = 16, 0.1
"""Pictures that are needed, and the relative standard uncertainty beyond which nothing is measured."""
_GROUPS, _LEAST, _MOST, _GRID = 8, 0.2, 40.0, 0.05  # bands in a picture
_KEPT = 0.1
_CLEAR = 5.0  # over what noise explains by chance
_NO_BANDS = Message("no bands that move from picture to picture")
_FINE = 60  # steps of the golden section
_LITTLE = Message("too little motion; move the specimen to and fro, faster, at a steady distance")
_JUMP = 0.02  # of the highest velocity: two ways to find it agree so far where it is steady
_LEAST_POWER = 1e-12  # of a velocity, (px/s)^2
_GOLDEN = (math.sqrt(5) - 1) / 2


@dataclass(frozen=True, slots=True)
class Readout:
    """Time from the first line of a picture to the last, s, with its standard uncertainty."""

    seconds: float
    sigma: float


def readout_of_bands(profiles: ArrayLike, lamp_Hz: float) -> Readout:
    """From the mean grey level of each line, (N, H), of N pictures of anything that stands still.

    The number of bands is the one whose cosine, with any amplitude and phase in each picture, leaves the least; the
    uncertainty follows from groups of pictures.

    Parameters
    ----------
    profiles : (N, H)
    lamp_Hz : float, Hz
        Of the light: twice the mains.

    Raises
    ------
    ValueError
        Too few pictures, or no bands that move.
    """
    seen = np.asarray(profiles, np.float64)
    if len(seen) < MIN_PICTURES:
        raise ValueError(Message("{n} pictures; it takes {needed}", len(seen), MIN_PICTURES))
    ratio = seen / np.maximum(seen.mean(axis=0), 1e-9)
    ratio -= ratio.mean(axis=1, keepdims=True)
    bands = _bands(ratio)
    _check_bands(ratio, bands)
    groups = [_bands(ratio[k::_GROUPS], bands) for k in range(_GROUPS)]
    scatter = float(np.std(groups, ddof=1)) / math.sqrt(_GROUPS)
    # The mean of the pictures, which is the scene, keeps some of the bands: it matters below one band.
    scene = _KEPT / len(seen) if bands < 1 else 0.0
    sigma = math.hypot(scatter, LAMP_SIGMA * bands, scene * bands)
    if not sigma < MAX_ERROR * bands:
        raise ValueError(_NO_BANDS)
    return Readout(bands / lamp_Hz, sigma / lamp_Hz)


def _check_bands(ratio: Floats, bands: float) -> None:
    """Raises ValueError where ``bands`` are noise, or lie at the end of what is sought."""
    energy = float(np.sum(ratio**2))
    explained = float(np.sum((ratio @ _basis(bands, ratio.shape[1])) ** 2))
    by_chance = 2 / (ratio.shape[1] - 1) * (energy - explained)
    at_the_end = bands < _LEAST + _GRID or bands > _limit(ratio.shape[1]) - _GRID
    if at_the_end or not explained > _CLEAR * by_chance:
        raise ValueError(_NO_BANDS)


def _limit(lines: int) -> float:
    return min(_MOST, lines / 8)


def _basis(bands: float, lines: int) -> Floats:
    """Cosine and sine over the lines of a picture, without their means, (H, 2) orthonormal."""
    angle = 2 * math.pi * bands * np.linspace(-0.5, 0.5, lines)
    basis = np.stack([np.cos(angle) - np.cos(angle).mean(), np.sin(angle)], axis=1)
    return np.asarray(basis / np.linalg.norm(basis, axis=0))


def _bands(ratio: Floats, near: float | None = None) -> float:
    """Bands in a picture, from the lines of pictures over their mean (N, H); the best, or the best ``near`` a value."""

    def explained(bands: float) -> float:
        return float(np.sum(np.square(ratio @ _basis(bands, ratio.shape[1]))))

    if near is None:
        tried = np.arange(_LEAST, _limit(ratio.shape[1]), _GRID)
        near = float(tried[np.argmax([explained(one) for one in tried])])
    low, high = max(near - 2 * _GRID, _LEAST / 2), near + 2 * _GRID
    for _ in range(_FINE):
        one, other = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        low, high = (low, other) if explained(one) > explained(other) else (one, high)
    return (low + high) / 2


def readout_of_motion(
    t: ArrayLike, moved: tuple[ArrayLike, ArrayLike], along: tuple[ArrayLike, ArrayLike], height: int
) -> Readout:
    """From the motion of a rigid specimen, to and fro.

    What goes with the velocity is the shutter; what goes with the displacement, to the second degree, is lens,
    tilt and distance.

    Parameters
    ----------
    t : (N,) s
    moved : (u, v), each (N,) px
        Mean displacement.
    along : (du_dy, dv_dy), each (N,)
        Mean gradients along y.
    height : int
        Lines of the picture.

    Raises
    ------
    ValueError
        Too few pictures, or too little motion.
    """
    times, u, v, du_dy, dv_dy = (np.asarray(one, np.float64) for one in (t, *moved, *along))
    known = np.isfinite(u + v + du_dy + dv_dy)
    if known.sum() < MIN_PICTURES or not np.all(np.diff(times[known]) > 0):
        n = int(known.sum())
        raise ValueError(Message("{n} pictures with a value in order; it takes {needed}", n, MIN_PICTURES))
    times, u, v, du_dy, dv_dy = (one[known] for one in (times, u, v, du_dy, dv_dy))
    still = np.stack([np.ones(len(u)), *(_unit(one) ** k for one in (u, v) for k in (1, 2))], axis=1)
    found = [_slope(times, one, still, slope) for one, slope in ((u, du_dy), (v, dv_dy))]
    weights = np.array([0.0 if math.isinf(sigma) else sigma**-2 for _, sigma in found])
    if not weights.any():
        raise ValueError(_LITTLE)
    slope = float(np.sum(weights * [one for one, _ in found]) / weights.sum())
    sigma = 1 / math.sqrt(float(weights.sum()))
    if not sigma < MAX_ERROR * abs(slope):
        raise ValueError(_LITTLE)
    return Readout(slope * (height - 1), sigma * (height - 1))


def _unit(moved: Floats) -> Floats:
    """Displacement about its mean, over its range."""
    return np.asarray((moved - moved.mean()) / max(float(np.ptp(moved)), 1e-9))


def _velocity(t: Floats, moved: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Velocity, px/s, and where it is known: not at the ends, nor where it jumps from one picture to the next."""
    from scipy.interpolate import CubicSpline

    found, plain = np.asarray(CubicSpline(t, moved)(t, 1)), np.gradient(moved, t)
    steady = np.abs(found - plain) < _JUMP * np.abs(plain).max()
    steady[:2] = steady[-2:] = False
    return found, steady


def _slope(t: Floats, moved: Floats, still: Floats, gradient: Floats) -> tuple[float, float]:
    """Change of the gradient by the velocity, 1/(px/s), beside what goes with ``still``, and its uncertainty."""
    velocity, within = _velocity(t, moved)
    if within.sum() < MIN_PICTURES:
        return 0.0, math.inf
    rest, *_ = np.linalg.lstsq(still[within], velocity[within], rcond=None)
    own = velocity[within] - still[within] @ rest
    power = float(own @ own)
    if not power > _LEAST_POWER:
        return 0.0, math.inf
    design = np.column_stack([own, still[within]])
    fitted, *_ = np.linalg.lstsq(design, gradient[within], rcond=None)
    left = gradient[within] - design @ fitted
    return float(fitted[0]), math.sqrt(float(left @ left) / max(len(left) - design.shape[1], 1) / power)
