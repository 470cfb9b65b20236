"""Everything that was found of one image put on the grid: values, residual, covariances."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.field import Motion, Status, StrainField
from analysis.follow.renewal import UNSHARED, Placement
from analysis.kernel.solve import Solution

Floats = NDArray[np.float64]
Covariance = NDArray[np.float32]


class PredictedMotion(NamedTuple):
    """What the field before predicts for this image: parameters (A, modes) and the motion they come from."""

    values: Floats
    motion: Motion


class _Noise(NamedTuple):
    """Variances a pixel of the reference and of the image at each ZOI, (A,), GL^2."""

    reference: Floats
    current: Floats


def field_of(solution: Solution, expected: PredictedMotion | None = None) -> StrainField:
    """The field of a solution.

    Parameters
    ----------
    solution : Solution
    expected : PredictedMotion, optional
        None: the field has no motion.
    """
    from analysis.fit.assembly import weigh

    reference, found = solution.reference, solution.found
    ok = solution.status == Status.OK
    gain = found.nuisance[:, 0]
    noise = _noise_parts(solution, ok)
    residual, first, whole = np.empty((3, len(ok)), np.float32)
    weigh(ok, found.left, reference.prepared.freedom, gain, *noise, residual, first, whole)
    covariance_reference, covariance = _covariances(solution, ok, noise, first, whole)
    variance = np.where(ok, reference.prepared.blur * whole, np.float32(np.nan))
    sigma_blur = np.sqrt(np.maximum(variance, 0))  # rounding may leave a little less than nothing
    blur = np.stack([np.where(ok, found.nuisance[:, 2], np.nan), sigma_blur]).astype(np.float32)
    values = reference.total(found.p)
    if not ok.all():
        values = np.where(ok[:, None], values, np.nan)
    return StrainField(
        grid=reference.grid,
        parameters=reference.spread(values),
        covariance=covariance,
        covariance_reference=covariance_reference,
        residual=reference.spread(residual[:, None])[0],
        status=reference.spread(solution.status[:, None], Status.NOT_MEASURED)[0],
        iterations=reference.spread(found.iterations[:, None], 0)[0],
        gain=reference.spread(gain[:, None].astype(np.float32))[0],
        noise=_noise_found(solution, ok, noise.current),
        window=reference.settings.window,
        motion=None if expected is None else _motion(solution, values, expected),
        sums=reference.sums,
        blur=reference.spread(blur.T),
    )


def _motion(solution: Solution, values: Floats, expected: PredictedMotion) -> Motion:
    from analysis.follow.prediction import motion_after

    lever = solution.reference.grid.size / 6
    return motion_after(expected.motion, values, expected.values, solution.tolerance.trust, lever)


def _noise_found(solution: Solution, ok: NDArray[np.bool_], current: Floats) -> float:
    """Standard deviation of the deformed image, GL, as given or found; the median over the ZOIs."""
    if solution.noise is not None and solution.noise.slope == 0 and ok.any():
        return float(np.sqrt(solution.noise.floor))
    return float(np.sqrt(np.median(current[ok]))) if ok.any() else float("nan")


def _noise_parts(solution: Solution, ok: NDArray[np.bool_]) -> _Noise:
    """The noise of the two images; what is not given, from the residual."""
    reference, current = solution.variances(np.s_[:], solution.found.nuisance[:, 0])
    if solution.noise is not None or not ok.any():
        return _Noise(reference, current)
    pooled = float(np.median((solution.found.left / solution.reference.prepared.freedom)[ok]))
    if solution.reference.noise_model is None:  # shared equally
        return _Noise(np.full(len(ok), pooled / 2), np.full(len(ok), pooled / 2))
    rest = max(pooled - float(np.median(reference)), pooled / 4)
    return _Noise(reference, np.full(len(ok), rest))


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
    grows = any(m is not None and m.slope > 0 for m in (reference.noise_model, solution.noise))
    if reference.placement is None and not (grows and reference.prepared.covariance_level is not None):
        return _scaled(solution, first, whole)
    from_reference, from_current = _level_covariances(solution, noise)
    if reference.placement is not None:
        from_reference, from_current = _composed(
            reference.placement, solution.found.p, from_reference, from_current
        )
    invalid = np.where(ok, np.float32(0), np.float32(np.nan))[:, None]
    return (
        reference.spread(from_reference + invalid),
        reference.spread(from_reference + from_current + invalid),
    )


def _scaled(
    solution: Solution, first: NDArray[np.float32], whole: NDArray[np.float32]
) -> tuple[Covariance, Covariance]:
    """The unit covariances times two variances of each ZOI."""
    from analysis.fit.assembly import scale

    reference, unit = solution.reference, solution.reference.unit_covariance
    out = np.empty((2, *unit.shape), np.float32)
    flat = out.reshape(2, len(unit), -1)
    scale(
        unit.reshape(len(unit), -1), reference.spread(first[:, None]).ravel(),
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


def _level_covariances(solution: Solution, noise: _Noise) -> tuple[Covariance, Covariance]:
    """The two parts (A, 21) with noise that grows with the grey level inside each ZOI."""
    from analysis.fit.assembly import MIN_NOISE_GAIN

    ready, model, own = solution.reference.prepared, solution.reference.noise_model, solution.noise
    unit, slope = ready.covariance, ready.covariance_level
    gain, offset = solution.found.nuisance[:, 0], solution.found.nuisance[:, 1]
    by_gain = 1 / np.maximum(gain, MIN_NOISE_GAIN) ** 2
    first = noise.reference[:, None] * unit
    second = (noise.current * by_gain)[:, None] * unit
    if slope is not None and model is not None and model.slope > 0:
        first = model.floor * unit + model.slope * slope
    if slope is not None and own is not None and own.slope > 0:
        constant = own.floor + own.slope * (offset + (1 - gain) * ready.pattern.mean)
        second = by_gain[:, None] * (constant[:, None] * unit + (own.slope * gain)[:, None] * slope)
    return first.astype(np.float32), second.astype(np.float32)
