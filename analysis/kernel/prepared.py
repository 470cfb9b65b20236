"""A reference made ready: filtered pattern, normal matrices and which ZOIs can be measured."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis.field import Status, profile
from analysis.fit.kernel_args import NormalArgs, ReferenceImages, WindowRows
from analysis.fit.noise_bias import noise_bias
from analysis.fit.validity import (
    CLIPPED_SHARE,
    SHOWN_SHARE,
    has_pattern,
    information,
    least_information,
)
from analysis.kernel.images import (
    NoiseModel,
    continue_rim,
    padded,
    rounding_variance,
    with_second_differences,
)
from analysis.kernel.settings import KernelSettings
from analysis.picture.spectrum import Pattern, filtered_pattern

if TYPE_CHECKING:
    from analysis.fit.shapes import Shapes


DOUBTFUL = 0.5
"""Information from which on the picture of a ZOI is not looked at (``validity.least_information``)."""


AT_ONCE = 500
"""ZOIs whose pixels are copied at a time."""


class PatternError(ValueError):
    """The reference has no pattern that could be followed."""


@dataclass(frozen=True, slots=True, eq=False)
class PreparedReference:
    """Everything of a reference that does not change from frame to frame; A active ZOIs.

    Attributes
    ----------
    shape : (H, W)
    pattern : Pattern
    images : (4, H + 1, pitch) float32
        Gradients and level of the filtered reference, f_x, f_y, f, and the reference less its mean, with padding
        beyond H rows of W, since loops read whole vectors; f goes on by a pixel beyond its edges.
    origins : (A, 2) int64
        First row and column of each ZOI.
    inverse : (A + 1, P, P) float32
    cross : (A + 1, P, 10) float32
        Of the shapes that the fit cannot follow with the columns of J (``shapes.cross_moments``). Both
        have a ZOI more than there is, of zeros, since loops read whole vectors.
    shapes : Shapes
    energy : (A, 2) float64, (GL/px)^2
        Mean of f_x^2 and f_y^2 under the window.
    covariance, covariance_level : (A, 21) float32
        For noise of variance 1 GL^2, and of variance 1 GL^2 a grey level.
    freedom, weight : (A,) and float
        Effective number of pixels less what the fit takes; sum of the weights.
    signal : (A,) float64, GL^2
        Variance of the filtered pattern.
    information : (A,) float64, GL^2
        Variance of the noise that would pretend as much as is known of the least known of u, v and the gradients.
    level : (A,) float64, GL
        Mean grey level.
    status : (A,) uint8
        OK, NO_PATTERN or CLIPPED.
    blur : (A,) float32, px^4 per GL^2
        Variance of the blur for noise of variance 1 GL^2.
    bias : (A, P) float32
        See ``noise_bias``.
    """

    shape: tuple[int, int]
    pattern: Pattern
    images: NDArray[np.float32]
    origins: NDArray[np.int64]
    inverse: NDArray[np.float32]
    cross: NDArray[np.float32]
    shapes: Shapes
    energy: NDArray[np.float64]
    covariance: NDArray[np.float32]
    covariance_level: NDArray[np.float32] | None
    freedom: NDArray[np.float64]
    weight: float
    signal: NDArray[np.float64]
    information: NDArray[np.float64]
    level: NDArray[np.float64]
    status: NDArray[np.uint8]
    blur: NDArray[np.float32]
    bias: NDArray[np.float32]


def prepare_reference(
    image: NDArray[np.float32],
    origins: NDArray[np.int64],
    size: int,
    settings: KernelSettings,
    noise: NoiseModel | None,
    clipped: NDArray[np.bool_] | None = None,
) -> PreparedReference:
    """Filter the reference and compute the normal matrix of each ZOI.

    Parameters
    ----------
    image : (H, W) float32, GL
    origins : (A, 2) int64, first row and column of each ZOI
    noise : NoiseModel or None
        Of this image; None: taken from its spectrum.
    clipped : (H, W) bool, optional
        Saturated pixels.
    """
    mean = float(image.mean(dtype=np.float64))
    std = None if noise is None else float(np.sqrt(noise.variance(mean)))
    pattern = filtered_pattern(image, std, settings.interpolant)
    line = profile(settings.window, size)
    images = padded(pattern.grad_x, pattern.grad_y, pattern.level, image - np.float32(mean))
    continue_rim(images, 2, image.shape)
    pattern = _within(pattern, images, image.shape)
    channels = with_second_differences(images)
    by_level = _by_level(channels, pattern, mean, noise)
    out, shapes = _fits(channels, by_level, origins, line, settings.order)
    energy = out.energy
    share, over_noise = information(
        out.inverse[:-1], energy[:, :2].astype(np.float64), pattern.left_gradient, line
    )
    status = _measurable(pattern, out.covariance, energy, rounding_variance(image))
    unknown = share < least_information(len(line), settings.order)
    status[unknown | ~_shown(image, origins, line, energy, share)] = Status.NO_PATTERN
    if clipped is not None and clipped.any():
        from analysis.fit.assembly import clipped_share

        status[clipped_share(clipped, origins, line) > CLIPPED_SHARE] = Status.CLIPPED
    return PreparedReference(
        shape=(image.shape[0], image.shape[1]),
        pattern=pattern,
        images=images,
        origins=origins,
        inverse=out.inverse,
        cross=out.cross,
        shapes=shapes,
        energy=energy[:, :2].astype(np.float64),
        covariance=out.covariance,
        covariance_level=out.covariance_level if by_level.size else None,
        freedom=np.maximum(out.freedom.astype(np.float64), 1e-3),
        weight=float(line.sum() ** 2),
        signal=np.maximum(energy[:, 2].astype(np.float64), 0),
        information=over_noise,
        level=energy[:, 3].astype(np.float64) + mean,
        status=status,
        blur=out.blur,
        bias=noise_bias(out.inverse[:-1], out.taken, pattern.own_noise, float(line.sum() ** 2), size),
    )


def _within(pattern: Pattern, images: NDArray[np.float32], shape: tuple[int, ...]) -> Pattern:
    """The same pattern where it stands in ``images``, so that it is not kept twice."""
    grad_x, grad_y, level = images[:3, : shape[0], : shape[1]]
    return replace(pattern, grad_x=grad_x, grad_y=grad_y, level=level)


def _fits(
    images: NDArray[np.float32],
    by_level: NDArray[np.float32],
    origins: NDArray[np.int64],
    line: NDArray[np.float64],
    order: int,
) -> tuple[NormalArgs, Shapes]:
    """The linear fit of each ZOI, and the shapes that it cannot follow."""
    from analysis.compiled.vectors import whole
    from analysis.fit.sensitivity import columns, parameter_scale, prepare, square_rows
    from analysis.fit.shapes import N_SHAPES, shapes_of

    size = len(line)
    table, units = columns(order), parameter_scale(order, size)
    half = len(units) // 2
    affine = units[[0, 1, 2, half, half + 1, half + 2]]
    shapes = shapes_of(line, whole(size))
    out = NormalArgs.empty(len(origins), len(table), 2 * N_SHAPES, by_level.size > 0)
    prepare(
        ReferenceImages(images.ravel(), by_level.ravel(), images[0].size, images.shape[2]), origins, size,
        WindowRows(shapes.powers, square_rows(line, whole(size)), shapes.mix), table, affine, out,
    )  # fmt: skip
    return out, shapes


def _measurable(
    pattern: Pattern, covariance: NDArray[np.float32], energy: NDArray[np.float32], rounding: float
) -> NDArray[np.uint8]:
    """OK or NO_PATTERN for each ZOI, (A,); the noise is at least that of rounding, of a variance ``rounding``, GL^2."""
    variances = covariance[:, [0, 15]].astype(np.float64)  # of u and of v among the 21 pairs
    noise = max(pattern.noise, rounding**0.5)
    good = has_pattern(energy[:, :2].astype(np.float64), variances, noise, noise**2 * pattern.left_gradient)
    return np.where(good, Status.OK, Status.NO_PATTERN).astype(np.uint8)


def _shown(
    image: NDArray[np.float32],
    origins: NDArray[np.int64],
    line: NDArray[np.float64],
    energy: NDArray[np.float32],
    share: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Whether ZOIs hold the gradients along x and y that the filtered pattern has there, (A,).

    Looked for where little is known. Beside a sharp edge the filtered pattern swings where the picture is even.
    """
    out = np.ones(len(origins), bool)
    doubtful = np.flatnonzero(share < DOUBTFUL)
    weight, along = (line / line.sum()).astype(np.float32), np.arange(len(line))
    between = (weight[1:] + weight[:-1]) / 2
    for which in np.split(doubtful, range(AT_ONCE, len(doubtful), AT_ONCE)):
        rows, columns = (origins[which, k, None] + along for k in (0, 1))
        zois = image[rows[:, :, None], columns[:, None, :]]
        along_x = np.einsum("nij,i,j->n", np.diff(zois, axis=2) ** 2, weight, between)
        along_y = np.einsum("nij,i,j->n", np.diff(zois, axis=1) ** 2, between, weight)
        shown = np.stack([along_x, along_y], axis=1)
        out[which] = (shown > SHOWN_SHARE * energy[which, :2]).all(axis=1)
    return out


def _by_level(
    images: NDArray[np.float32], pattern: Pattern, mean: float, noise: NoiseModel | None
) -> NDArray[np.float32]:
    """Images times the grey level, the fourth the level itself, for a noise that grows with it; else empty."""
    if noise is None or noise.slope <= 0:
        return np.empty(0, np.float32)
    level = np.maximum(pattern.level + np.float32(mean), 0)
    height, width = level.shape
    out = np.zeros_like(images)
    out[:, :height, :width] = images[:, :height, :width] * level
    out[3, :height, :width] = level
    return out
