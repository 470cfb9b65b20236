"""Everything that was found of one image put on the grid: values, residual, covariances."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.field import Motion, Status, StrainField, stretched
from analysis.field.uncertainty import LIMIT, PictureError
from analysis.fit.validity import AGREES, COLOURED
from analysis.follow.renewal import UNSHARED, Placement
from analysis.kernel.coloured import (
    SOME_BLUR,
    beside_strain,
    by_frequency,
    coloured_bias,
    error_cause,
    left_of_some,
    own_error,
)
from analysis.kernel.lines import some
from analysis.kernel.solve import Solution

if TYPE_CHECKING:
    from analysis.fit.assembly import ExpectedNoise
    from analysis.fit.kernel_args import PooledError

Floats = NDArray[np.float64]
Covariance = NDArray[np.float32]

FEW_REFUSED = 0.98
"""Share of valid ZOIs from which on what all fits leave in common is that of the valid ones."""
DOUBTFUL = 1.05
"""What is left over what is expected, or its colour, from which on a strain that varies within the ZOIs may do it."""
MIN_SHARE = 0.04
"""Share of the common error that the deformed image has at least, however noisy the reference was said to be."""


class PredictedMotion(NamedTuple):
    """What the field before predicts for this image: parameters (A, modes) and the motion they come from."""

    values: Floats
    motion: Motion


class _Noise(NamedTuple):
    """Variances a pixel of the reference and of the image at each ZOI, (A,), GL^2, and what they make of the values.

    ``colour`` (6,) is the variance of u, its gradients, v and its over that of white noise, ``seen`` (2,) that of u and
    v as the shapes show it, ``over`` the standard deviation of both images over that as given, NaN where not found.
    ``left`` is what the fits leave of some ZOIs (``left_of_some``); None: not looked at.
    """

    reference: Floats
    current: Floats
    colour: Floats
    over: float
    seen: Floats
    left: tuple[NDArray[np.intp], NDArray[np.float32]] | None = None

    def share(self, gain: Floats, ok: NDArray[np.bool_]) -> float:
        """What of the variance is the reference's, median of some ZOIs."""
        first = self.reference * gain**2
        return float(np.median((first / (first + self.current))[ok])) if ok.any() else 0.0


def field_of(solution: Solution, predicted: PredictedMotion | None = None) -> StrainField:
    """The field of a solution.

    Parameters
    ----------
    solution : Solution
    predicted : PredictedMotion, optional
        None: the field has no motion.
    """
    from analysis.fit.assembly import weigh, weigh_blur
    from analysis.fit.pooling import COUNTED, median

    reference, found = solution.reference, solution.found
    ok = solution.status == Status.OK
    gain = np.ascontiguousarray(found.nuisance[:, 0])
    expected = solution.expected_of_all
    shown = some(ok, COUNTED)
    noise = _noise_parts(solution, ok, shown, gain, expected)
    residual, first, whole = np.empty((3, len(ok)), np.float32)
    weigh(
        ok,
        found.left,
        reference.prepared.freedom,
        gain,
        noise.reference,
        noise.current,
        expected.share,
        found.p,
        residual,
        first,
        whole,
    )
    error, local, growth, attenuation = _corrected(solution, ok, noise)
    noise = noise._replace(colour=noise.colour / attenuation.repeat(3) ** 2)
    parts = _covariances(solution, ok, noise, first, whole)
    blur = np.empty((2, len(ok)), np.float32)
    blur[0] = growth
    weigh_blur(reference.prepared.blur, whole, blur[1])
    values = reference.total(local)
    if not ok.all():
        values = np.where(ok[:, None], values, np.nan)
        blur[0, ~ok] = np.nan
    affine = values if reference.modes == 6 else values[:, reference.affine]
    covariance_reference, covariance = stretched(parts, reference.spread(affine))
    return StrainField(
        grid=reference.grid,
        parameters=reference.spread(values),
        covariance=covariance,
        covariance_reference=covariance_reference,
        residual=reference.spread(residual[:, None])[0],
        status=reference.spread(solution.status[:, None], Status.NOT_MEASURED)[0],
        iterations=reference.spread(found.iterations[:, None], 0)[0],
        gain=reference.spread(gain[:, None].astype(np.float32))[0],
        noise=math.sqrt(median(noise.current[shown])) if len(shown) else float("nan"),
        window=reference.settings.window,
        motion=None if predicted is None else _motion(solution, values, predicted),
        sums=reference.sums,
        picture=error,
        blur=reference.spread(blur.T),
    )


def _corrected(
    solution: Solution, ok: NDArray[np.bool_], noise: _Noise
) -> tuple[PictureError | None, Floats, Floats, Floats]:
    """The error of the picture; parameters, and growth of the variance of the blur, without what it adds on average.

    Last, (2,), the attenuation of u and v (``OwnError``).
    """
    found, reference = solution.found, solution.reference
    p, growth, none = found.p, found.nuisance[:, 2], np.ones(2)
    if np.isnan(noise.over):
        return None, p, growth, none
    error = PictureError(noise.over, (float(noise.colour[0]), float(noise.colour[3])))
    if not solution.had_lines and noise.over * float(noise.seen.max()) ** 0.5 <= LIMIT:
        return error, p, growth, none
    which, left = noise.left or left_of_some(solution, ok)
    error = replace(error, cause="bands" if solution.had_lines else error_cause(solution, ok, left))
    if (
        reference.sensors is not None or error.cause == "blur"
    ):  # that leaves pattern, and no error of the reference
        return error, p, growth, none
    share = noise.share(found.nuisance[:, 0], ok)
    own = own_error(reference, which, left, error.cause, share)
    moved, sharper = coloured_bias(solution, own)
    return error, p + moved, growth + sharper, own.attenuation


def _motion(solution: Solution, values: Floats, expected: PredictedMotion) -> Motion:
    from analysis.follow.prediction import motion_after

    lever = solution.reference.grid.size / 6
    return motion_after(expected.motion, values, expected.values, solution.stated.tolerance.trust, lever)


def _noise_parts(
    solution: Solution, ok: NDArray[np.bool_], shown: NDArray[np.intp], gain: Floats, expected: ExpectedNoise
) -> _Noise:
    """The noise of the two images: together what the fits leave, of which the reference has what was given.

    ``expected`` is the noise as stated. Medians are of the ZOIs ``shown`` (B,).
    """
    from analysis.fit.pooling import median

    white = np.ones(6)
    reference, current = solution.variances(np.s_[:], solution.found.nuisance)
    common = solution.common
    if common is None or solution.retried or np.count_nonzero(ok) < FEW_REFUSED * len(ok):
        common = solution.pooled(np.flatnonzero(ok))
    if common is not None:
        share = _left_of_felt(solution, common, expected)
        ratio, usual, some_left = common.ratio / share, median(share[shown]), None
        seen = common.colour * usual
        colour, over = seen.repeat(3), common.usual / usual if ok.all() else median(ratio[shown])
        doubtful = max(colour.max(), over) > DOUBTFUL and not (common.apart or solution.had_lines)
        rest = beside_strain(solution, ok, expected) if doubtful else None
        if rest is not None:
            over = 1.0 if solution.is_given and AGREES[0] < rest < AGREES[1] else rest
            seen = np.minimum(seen, 1)  # what bends adds to the shapes
            colour, ratio = seen.repeat(3), np.full(len(ok), over)
        if colour.min() < 1 and abs(median(solution.found.nuisance[shown, 2])) > SOME_BLUR:
            # What a fit leaves of a blur is pattern, which moves u and v more than it shows in the shapes.
            colour = np.maximum(colour, 1)
        elif np.abs(np.log(seen)).max() > np.log(COLOURED):
            some_left = left_of_some(solution, ok)
            colour = colour * by_frequency(solution.reference, some_left[1])
        whole = ratio * expected.felt
        parts = _parted(whole, reference * gain**2, gain, solution)
        return _Noise(*parts, colour, math.sqrt(over), seen, some_left)
    if solution.noise is not None or not len(shown):
        return _Noise(reference, current, white, float("nan"), white[:2])
    left = solution.found.left / solution.reference.prepared.freedom
    found = max(median(left[shown]), solution.rounding)
    whole = np.full(len(ok), found)
    return _Noise(*_parted(whole, reference, np.ones(len(ok)), solution), white, float("nan"), white[:2])


def _left_of_felt(solution: Solution, common: PooledError, expected: ExpectedNoise) -> Floats:
    """By how much less noise the fits leave than they feel, (A,) variances: ``common`` takes one for the other.

    1 where the noise as given stands, since nothing is taken from what is left.
    """
    stands = solution.is_given and bool((common.ratio == 1).all())
    return np.ones(len(common.ratio)) if stands else expected.share


def _parted(whole: Floats, reference: Floats, gain: Floats, solution: Solution) -> tuple[Floats, Floats]:
    """A variance of both images, of which ``reference`` comes from the reference as given, as those of each."""
    from analysis.fit.assembly import MIN_NOISE_GAIN

    if solution.reference.noise_model is None:
        reference = whole / 2
    first = np.minimum(reference, (1 - MIN_SHARE) * whole)
    return first / np.maximum(gain, MIN_NOISE_GAIN) ** 2, whole - first


def _covariances(
    solution: Solution,
    ok: NDArray[np.bool_],
    noise: _Noise,
    first: NDArray[np.float32],
    whole: NDArray[np.float32],
) -> tuple[Covariance, Covariance]:
    """Covariance that the reference causes, and the whole, (21, R, C), NaN where there is no value.

    ``first`` and ``whole`` (A,) are what scales the unit covariances (``assembly.weigh``).
    """
    reference = solution.reference
    colour = _pairs(noise.colour)
    grows = any(m is not None and m.slope > 0 for m in (reference.noise_model, solution.noise))
    if reference.placement is None and not (grows and reference.prepared.covariance_level is not None):
        return _scaled(solution, colour, first, whole)
    from_reference, from_current = (colour * part for part in _level_covariances(solution, noise))
    if reference.placement is not None:
        from_reference, from_current = _composed(
            reference.placement, solution.found.p, from_reference, from_current
        )
    invalid = np.where(ok, np.float32(0), np.float32(np.nan))[:, None]
    return (
        reference.spread(from_reference + invalid),
        reference.spread(from_reference + from_current + invalid),
    )


def _pairs(colour: Floats) -> NDArray[np.float32]:
    """Factors of the covariances, (21,), for variances that are ``colour`` (6,) times as large."""
    deviation = np.sqrt(colour)
    return np.array([deviation[i] * deviation[j] for i in range(6) for j in range(i, 6)], np.float32)


def _scaled(
    solution: Solution, colour: NDArray[np.float32], first: NDArray[np.float32], whole: NDArray[np.float32]
) -> tuple[Covariance, Covariance]:
    """The unit covariances times ``colour`` (21,) and two variances of each ZOI."""
    from analysis.fit.assembly import scale

    reference, unit = solution.reference, solution.reference.unit_covariance
    out = np.empty((2, *unit.shape), np.float32)
    flat = out.reshape(2, len(unit), -1)
    scale(
        unit.reshape(len(unit), -1), colour, reference.spread(first[:, None]).ravel(),
        reference.spread(whole[:, None]).ravel(), flat[0], flat[1],
    )  # fmt: skip
    return out[0], out[1]


def _composed(
    placement: Placement, local: Floats, from_reference: Covariance, from_current: Covariance
) -> tuple[Covariance, Covariance]:
    """The two parts (A, 21) of a renewed reference as they stand in the parameters against the first."""
    # The noise of a renewed picture enters twice with opposite sign and nearly cancels.
    renewed = np.float32(UNSHARED) * placement.spread(local, from_reference)
    return placement.carried(local) + renewed, placement.spread(local, from_current)


def _areas(values: Floats) -> Floats:
    """``assembly.area`` of all ZOIs, (A,)."""
    from analysis.fit.assembly import MIN_AREA

    half = values.shape[1] // 2
    stretch = (1 + values[:, 1]) * (1 + values[:, half + 2]) - values[:, 2] * values[:, half + 1]
    return np.maximum(stretch, MIN_AREA)


def _level_covariances(solution: Solution, noise: _Noise) -> tuple[Covariance, Covariance]:
    """The two parts (A, 21) with noise that grows with the grey level inside each ZOI."""
    from analysis.fit.assembly import MIN_NOISE_GAIN

    ready, model, own = solution.reference.prepared, solution.reference.noise_model, solution.noise
    unit, slope = ready.covariance, ready.covariance_level
    gain = solution.found.nuisance[:, 0]
    by_gain = 1 / (np.maximum(gain, MIN_NOISE_GAIN) ** 2 * _areas(solution.found.p))
    first = noise.reference[:, None] * unit
    second = (noise.current * by_gain)[:, None] * unit
    stated = solution.variances(np.s_[:], solution.found.nuisance)
    if slope is not None and model is not None and model.slope > 0:
        over = noise.reference / stated[0]
        first = over[:, None] * (model.floor * unit + model.slope * slope)
    if slope is not None and own is not None and own.slope > 0:
        over = by_gain * noise.current / stated[1]
        constant = own.floor + own.slope * solution.constant_level(solution.found.nuisance)
        second = over[:, None] * (constant[:, None] * unit + (own.slope * gain)[:, None] * slope)
    return first.astype(np.float32), second.astype(np.float32)
