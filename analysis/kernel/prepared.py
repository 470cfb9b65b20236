"""A reference made ready: filtered pattern, normal matrices and which ZOIs can be measured."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis.field import Status, profile
from analysis.fit.kernel_args import NormalArgs, ReferenceImages, WindowRows
from analysis.fit.noise_bias import noise_bias
from analysis.fit.validity import CLIPPED_SHARE, SHOWN_SHARE, has_pattern, information, least_information
from analysis.kernel.images import (
    NoiseModel,
    continue_rim,
    padded_room,
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
ROWS_OF_ZOIS = 4
"""Sides of a ZOI, of which second differences are made at a time."""


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
    cross : (A + 1, P, 14) float32
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
    least_noise : float, GL
        As given.
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
    least_noise: float
    bias: NDArray[np.float32]


def prepare_reference(
    image: NDArray[np.float32],
    origins: NDArray[np.int64],
    size: int,
    settings: KernelSettings,
    noise: NoiseModel | None,
    clipped: NDArray[np.bool_] | None = None,
    least_noise: float = 0.0,
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
    least_noise : float, GL
        What is below it is no pattern, however little noise there is.
    """
    mean = float(image.mean(dtype=np.float64))
    std = None if noise is None else float(np.sqrt(noise.variance(mean)))
    images = padded_room(4, image.shape)
    grad_x, grad_y, level, recorded = images[:, : image.shape[0], : image.shape[1]]
    pattern = filtered_pattern(image, std, settings.interpolant, (grad_x, grad_y, level))
    np.subtract(image, np.float32(mean), out=recorded)
    continue_rim(images, 2, image.shape)
    line = profile(settings.window, size)
    level_from = np.float32(mean) if noise is not None and noise.slope > 0 else None
    out, shapes = _fits(images, level_from, origins, line, settings.order)
    energy = out.energy
    share, over_noise = information(
        out.inverse[:-1], energy[:, :2].astype(np.float64), pattern.left_gradient, line
    )
    status = _measurable(pattern, out.covariance, energy, max(rounding_variance(image), least_noise**2))
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
        covariance_level=None if level_from is None else out.covariance_level,
        freedom=np.maximum(out.freedom.astype(np.float64), 1e-3),
        weight=float(line.sum() ** 2),
        signal=np.maximum(energy[:, 2].astype(np.float64), 0),
        information=over_noise,
        level=energy[:, 3].astype(np.float64) + mean,
        status=status,
        blur=out.blur,
        least_noise=least_noise,
        bias=noise_bias(out.inverse[:-1], out.taken, pattern.own_noise, float(line.sum() ** 2), size),
    )


def _fits(
    images: NDArray[np.float32],
    level_from: np.float32 | None,
    origins: NDArray[np.int64],
    line: NDArray[np.float64],
    order: int,
) -> tuple[NormalArgs, Shapes]:
    """The linear fit of each ZOI, and the shapes that it cannot follow.

    ``level_from`` is the mean grey level, for a noise that grows with the level; None: it does not. Second differences
    are made of the rows of some ZOIs at a time: those of all would take more memory than all else, which was new.
    """
    from analysis.compiled.vectors import whole
    from analysis.fit.sensitivity import columns, parameter_scale, prepare, square_rows
    from analysis.fit.shapes import N_HELD, shapes_of

    size = len(line)
    table, units = columns(order), parameter_scale(order, size)
    half = len(units) // 2
    affine = units[[0, 1, 2, half, half + 1, half + 2]]
    shapes = shapes_of(line, whole(size))
    window = WindowRows(shapes.powers, square_rows(line, whole(size)), shapes.mix)
    out = NormalArgs.empty(len(origins), len(table), 2 * N_HELD, level_from is not None)
    for which in _near_each_other(origins, size):
        tops = origins[which, 0]
        first = int(tops.min())
        channels = with_second_differences(images, first, int(tops.max()) + size + 1)
        by_level = np.empty(0, np.float32) if level_from is None else _by_level(channels, level_from)
        prepare(
            ReferenceImages(channels.ravel(), by_level.ravel(), channels[0].size, channels.shape[2]),
            origins[which] - (first, 0), size, window, table, affine, NormalArgs(*(of[which] for of in out)),
        )  # fmt: skip
    return out, shapes


def _near_each_other(origins: NDArray[np.int64], size: int) -> Iterator[slice]:
    """ZOIs (A, 2), which come row by row, in parts whose first rows lie within ``ROWS_OF_ZOIS``."""
    down = np.maximum.accumulate(origins[:, 0])
    ends = np.flatnonzero(np.diff((down - down[:1]) // (ROWS_OF_ZOIS * size))) + 1
    return (slice(*ends) for ends in pairwise([0, *ends.tolist(), len(origins)]) if len(origins))


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


def _by_level(images: NDArray[np.float32], mean: np.float32) -> NDArray[np.float32]:
    """Images (7, N, pitch) times the grey level, the fourth the level itself, for a noise that grows with it."""
    level = np.maximum(images[2] + mean, 0)
    out = np.asarray(images * level, np.float32)
    out[3] = level
    return out
