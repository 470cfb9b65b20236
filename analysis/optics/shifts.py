"""The distortion of a lens from pictures of a flat specimen that stands still and was shifted from one to the next.

A camera without distortion sees a rigid plane move by a homography (``plane``). What the measured displacements show
beyond one for each picture is the lens. A homography is also what the tangential terms and the place of the optical
axis make of a shift, to the first order: these are not found, and the axis is taken in the middle of the picture,
give or take ``AXIS_SIGMA``. Where the camera is square to the specimen, stretch and shear are the tangential terms.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquire.text import Message
from analysis.field import PAIR_INDEX, StrainField
from analysis.optics.lens import LENS_NAMES, LensModel
from analysis.optics.plane import MODELS, ApparentMotion

Floats = NDArray[np.float64]
AXIS_SIGMA = 0.01
"""Standard uncertainty of the place of the optical axis, over the width of the picture."""
MIN_PICTURES, MIN_ZOIS = 2, 12
_ROUNDS, _STEP, _WORST = 4, 1e-6, 1e8
_AXIS, _RADIAL, _TANGENTIAL = (1, 2), (3, 4), (5, 6)  # among LENS_NAMES
_DISPLACEMENTS = [PAIR_INDEX[0, 0], PAIR_INDEX[3, 3]]


@dataclass(frozen=True, slots=True, eq=False)
class LensFit:
    """A lens that was fitted.

    Attributes
    ----------
    lens : LensModel
    rms_px : float, px
        Of what the fit leaves of the displacements.
    over_noise : float
        That over what noise explains; above 1 the covariance has it as a factor.
    """

    lens: LensModel
    rms_px: float
    over_noise: float


@dataclass(frozen=True, slots=True, eq=False)
class _Picture:
    """ZOIs of one picture: places and displacements, px, (N,), and variances of the latter, (2 N,)."""

    x: Floats
    y: Floats
    u: Floats
    v: Floats
    variance: Floats
    of_reference: Floats

    @classmethod
    def of(cls, field: StrainField) -> _Picture:
        ok = field.ok
        x, y = np.meshgrid(field.grid.x, field.grid.y)
        variance, of_reference = (
            values[_DISPLACEMENTS][:, ok].ravel().astype(np.float64)
            for values in (field.covariance, field.covariance_reference)
        )
        return cls(x[ok], y[ok], field.u[ok], field.v[ok], variance, of_reference)

    def seen(self, lens: LensModel) -> tuple[Floats, Floats]:
        """Displacements (2, N) of a camera without distortion, and places (2, N) before them."""
        still, moved = lens.straightened(self.x, self.y), lens.straightened(self.x + self.u, self.y + self.v)
        before = np.array([still.x, still.y])
        return np.array([moved.x, moved.y]) - before, before


def lens_of_shifts(
    fields: Sequence[StrainField], width: int, height: int, *, square: bool = False
) -> LensFit:
    """Fit k1 and k2, and with ``square`` also p1 and p2, to displacements against one reference.

    Parameters
    ----------
    fields : sequence of StrainField
        All on one grid, whose ZOIs do not overlap; only ZOIs that all of them have count.
    width, height : int, px
        Of the pictures. The focal length is given as half their diagonal: a shift does not show it.
    square : bool
        The camera is square to the specimen.

    Raises
    ------
    ValueError
        Too few pictures or ZOIs, or shifts that do not show the lens.
    """
    everywhere = np.logical_and.reduce([field.ok for field in fields]) if fields else np.zeros((0, 0), bool)
    if len(fields) < MIN_PICTURES or everywhere.sum() < MIN_ZOIS:
        text = Message(
            "{n} shifted pictures with {zois} ZOIs that all of them show; it takes {pictures} and {needed}",
            *(len(fields), int(everywhere.sum()), MIN_PICTURES, MIN_ZOIS),
        )
        raise ValueError(text)
    grid = fields[0].grid.subset(active=everywhere)
    pictures = [
        _Picture.of(replace(one, grid=grid, status=np.where(everywhere, one.status, 5))) for one in fields
    ]
    free = [*_RADIAL, *_TANGENTIAL] if square else [*_RADIAL]
    count = MODELS["pose" if square else "homography"]
    start = np.zeros(len(LENS_NAMES))
    start[:3] = math.hypot(width, height) / 2, (width - 1) / 2, (height - 1) / 2
    found = _solved(start, free, count, pictures)
    covariance = found.over_noise**2 * found.covariance
    for axis in _AXIS:
        off = start.copy()
        off[axis] += AXIS_SIGMA * width
        change = _solved(off, free, count, pictures).parameters - found.parameters
        covariance = covariance + np.outer(change, change)
    return LensFit(LensModel(found.parameters, covariance), found.rms_px, found.over_noise)


@dataclass(frozen=True, slots=True, eq=False)
class _Solution:
    """Parameters of a lens, their covariance by the noise, and what the fit leaves."""

    parameters: Floats
    covariance: Floats
    rms_px: float
    over_noise: float


def _solved(start: Floats, free: list[int], count: int, pictures: Sequence[_Picture]) -> _Solution:
    """Gauss-Newton of the ``free`` parameters of the lens and of ``count`` of the motion of each picture."""
    parameters, motions = start.copy(), [np.zeros(8) for _ in pictures]
    for _ in range(_ROUNDS):
        steps = [
            _Step.of(one, parameters, free, motion[:count])
            for one, motion in zip(pictures, motions, strict=True)
        ]
        normal = np.sum([step.lens.T @ step.lens for step in steps], axis=0)
        unit = np.sqrt(np.diag(normal))
        if not unit.min() > 0 or not np.linalg.cond(normal / np.outer(unit, unit)) < _WORST:
            raise ValueError(
                "the shifts do not show the lens; shift by a tenth of the picture, along x and along y"
            )
        inverse = np.linalg.inv(normal)
        change = inverse @ np.sum([step.lens.T @ step.left for step in steps], axis=0)
        parameters[free] += change
        motions = [
            motion + np.pad(step.motion(change), (0, 8 - count))
            for motion, step in zip(motions, steps, strict=True)
        ]
    gains = [inverse @ (step.lens.T * step.weight) for step in steps]
    covariance = np.zeros((len(start), len(start)))
    covariance[np.ix_(free, free)] = _noise(gains, pictures)
    left = np.concatenate([step.left for step in steps])
    px = np.concatenate([step.left / step.weight for step in steps])
    over = math.sqrt(float(left @ left) / (left.size - count * len(pictures) - len(free)))
    return _Solution(parameters, covariance, math.sqrt(float(np.mean(px**2))), max(over, 1.0))


def _noise(gains: Sequence[Floats], pictures: Sequence[_Picture]) -> Floats:
    """Covariance of the parameters: the noise of each picture, and that of the reference, which they share."""
    own = np.sum(
        [
            gain * (one.variance - one.of_reference) @ gain.T
            for gain, one in zip(gains, pictures, strict=True)
        ],
        axis=0,
    )
    shared = np.sum(gains, axis=0)
    return np.asarray(own + shared * pictures[0].of_reference @ shared.T)


@dataclass(frozen=True, slots=True, eq=False)
class _Step:
    """One picture, linearised: each value over its standard uncertainty.

    Attributes
    ----------
    left : (2 N,) float64
        What lens and motion so far leave.
    lens : (2 N, K) float64
        What the free parameters of the lens take from it, without what the motion takes as well.
    by_lens, by_motion : (2 N, K), (2 N, M) float64
        The same of both, each alone.
    weight : (2 N,) float64, 1/px
    """

    left: Floats
    lens: Floats
    by_lens: Floats
    by_motion: Floats
    weight: Floats

    @classmethod
    def of(cls, picture: _Picture, parameters: Floats, free: list[int], motion: Floats) -> _Step:
        weight = 1 / np.sqrt(picture.variance)
        seen = picture.seen(_lens(parameters))
        left, changes = _left(seen, parameters, motion), _STEP * np.eye(len(parameters))
        of_lens = [
            _left(picture.seen(_lens(parameters + changes[k])), parameters + changes[k], motion) for k in free
        ]
        of_motion = [_left(seen, parameters, motion + one[: len(motion)]) for one in changes[: len(motion)]]
        by_lens, by_motion = (
            np.stack([weight * (left - other) / _STEP for other in others], axis=1)
            for others in (of_lens, of_motion)
        )
        lens = by_lens - by_motion @ np.linalg.lstsq(by_motion, by_lens, rcond=None)[0]
        return cls(weight * left, lens, by_lens, by_motion, weight)

    def motion(self, change: Floats) -> Floats:
        """What the motion takes of the rest, where the lens changes by ``change``."""
        return np.asarray(
            np.linalg.lstsq(self.by_motion, self.left - self.by_lens @ change, rcond=None)[0], np.float64
        )


def _lens(parameters: Floats) -> LensModel:
    return LensModel(parameters, np.zeros((0, 0)))


def _left(seen: tuple[Floats, Floats], parameters: Floats, motion: Floats) -> Floats:
    """What a motion leaves of what a lens shows (``_Picture.seen``), (2 N,) px."""
    displacement, before = seen
    centre = float(parameters[1]), float(parameters[2])
    x, y = (before - np.array(centre)[:, None]) / parameters[0]
    apparent = ApparentMotion(np.pad(motion, (0, 8 - len(motion))), centre, float(parameters[0]))
    return np.asarray((displacement - apparent.at(x, y)[::3]).ravel())
