"""What a frame needs of every ZOI beside its fit, compiled: residual, covariances, share of saturated pixels."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.compiled.loops import helper, inlined, part, read_only, shared
from analysis.compiled.shares import in_shares, part_of

RUN = 1024
"""ZOIs whose covariances are scaled at a time."""
MIN_NOISE_GAIN, MAX_NOISE_GAIN = 0.1, 5.0
"""The gain by which the noise of the deformed image is divided, and that of the reference multiplied: limits."""
MIN_AREA = 0.05
"""Area of a pixel of the reference in the deformed image, px: limit."""


class ExpectedNoise(NamedTuple):
    """Variance a pixel that the noise of both images makes.

    The fit subtracts the reference as recorded, and scales its contrast by the filtered one, in which there is
    little noise. At the frequencies of the pattern the filter passes all, and the noise is scaled too.

    Attributes
    ----------
    left : (A,), GL^2
        In the difference of the images.
    felt : (A,), GL^2
        At the frequencies of the pattern: it disturbs the parameters.
    """

    left: NDArray[np.float64]
    felt: NDArray[np.float64]

    @property
    def share(self) -> NDArray[np.float64]:
        """Left over felt, (A,)."""
        return np.asarray(self.left / self.felt)


@helper
def expect(gain: Any, kept: Any, reference: Any, current: Any, least: Any, out: ExpectedNoise) -> None:
    """What noise makes of the difference of the images, written to ``out``; NaN where the gain is.

    Parameters
    ----------
    gain : (A,)
    kept : tuple of two floats
        What the filter keeps of the noise of a pixel in that pixel, and of its variance.
    reference, current : (A,), GL^2
        Variance a pixel of the two images.
    least : float, GL^2
        What rounding leaves.
    out : ExpectedNoise
    """
    for z in range(len(reference)):
        scale = min(max(gain[z], -MAX_NOISE_GAIN), MAX_NOISE_GAIN) if gain[z] == gain[z] else np.nan
        more = scale - 1
        left = (1 + more * (2 * kept[0] + more * kept[1])) * reference[z] + current[z]
        felt = scale**2 * reference[z] + current[z]
        out.left[z] = least if left < least else left
        out.felt[z] = least if felt < least else felt


@helper
def weigh(
    measured: Any, left: Any, freedom: Any, gain: Any, reference: Any, current: Any, share: Any, values: Any,
    residual: Any, from_reference: Any, whole: Any,
) -> None:  # fmt: skip
    """What is left over what noise explains, and the variance that scales the unit covariances.

    Parameters
    ----------
    measured : (A,) bool
    left : (A,), GL^2
        Weighted sum of squares that the fit leaves.
    freedom, gain : (A,)
    reference, current : (A,), GL^2
        Variance a pixel of the two images.
    share : (A,)
        ``ExpectedNoise.share``.
    values : (A, modes)
        Parameters: the noise of a picture that is stretched is a mean over more pixels (``area``).
    residual : (A,) float32, written
    from_reference, whole : (A,) float32, GL^2, written
        In grey levels of the reference; NaN where nothing was measured.
    """
    for z in range(len(measured)):
        residual[z] = left[z] / freedom[z] / (share[z] * (gain[z] ** 2 * reference[z] + current[z]))
        from_reference[z] = np.nan
        whole[z] = np.nan
        if measured[z]:
            from_reference[z] = reference[z]
            whole[z] = reference[z] + current[z] / (max(gain[z], MIN_NOISE_GAIN) ** 2 * area(values, z))


@inlined
def area(values: Any, z: int) -> Any:
    """Pixels of the deformed image to one of the reference at ZOI ``z``: det F, F = I + grad u.

    At the frequencies of a pattern, which both images have, white noise of the deformed one is so many times less.
    """
    half = values.shape[1] // 2
    stretch = (1 + values[z, 1]) * (1 + values[z, half + 2]) - values[z, 2] * values[z, half + 1]
    return MIN_AREA if stretch < MIN_AREA else stretch


@helper
def weigh_blur(unit: Any, whole: Any, out: Any) -> None:
    """The uncertainty of the blur of each ZOI, (A,) float32, px^2, written to ``out``; NaN where nothing was measured.

    ``unit`` (A,) is its variance for noise of 1 GL, ``whole`` as in ``weigh``.
    """
    for z in range(len(out)):
        out[z] = math.sqrt(max(unit[z] * whole[z], 0.0)) if whole[z] == whole[z] else np.nan


@shared
def scale(unit: Any, colour: Any, from_reference: Any, whole: Any, out_reference: Any, out: Any) -> None:
    """The unit covariances (21, N) times ``colour`` (21,) and two variances (N,) each, written to the last two."""
    in_shares(_scale_share, (unit, colour, from_reference, whole, out_reference, out))


@part
def _scale_share(
    unit: Any, colour: Any, from_reference: Any, whole: Any, out_reference: Any, out: Any, share: int
) -> None:
    count = unit.shape[1]
    first, end = part_of((count + RUN - 1) // RUN, share)
    for run in range(first, end):
        a = run * RUN
        b = min(a + RUN, count)
        for k in range(len(unit)):
            _products(unit[k, a:b], colour[k], from_reference[a:b], out_reference[k, a:b])
            _products(unit[k, a:b], colour[k], whole[a:b], out[k, a:b])


@part
def _products(a: Any, factor: Any, b: Any, out: Any) -> None:
    for n in range(out.size):
        i = np.uintp(n)
        out[i] = factor * a[i] * b[i]


def clipped_share(
    clipped: NDArray[np.bool_], first: NDArray[np.int64], line: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Share of the window weight of each ZOI on marked pixels, (A,).

    Parameters
    ----------
    clipped : (H, W) bool
    first : (A, 2) int64
        First row and column; ZOIs are moved into the image where they stick out.
    line : (n,) float64
        The window along one side.
    """
    marked = read_only(np.ascontiguousarray(clipped).view(np.uint8))
    out = np.empty(len(first))
    clipped_shares(marked, first, (line / line.sum()).astype(np.float32), out)
    return out


@shared
def clipped_shares(marked: Any, first: Any, weight: Any, out: Any) -> None:
    """See ``clipped_share``; ``marked`` (H, W) uint8, ``out`` (A,) written."""
    in_shares(_clipped_share, (marked, first, weight, out))


@part
def _clipped_share(marked: Any, first: Any, weight: Any, out: Any, share: int) -> None:
    size = weight.size
    begin, end = part_of(len(first), share)
    for z in range(begin, end):
        top = min(max(first[z, 0], 0), marked.shape[0] - size)
        left = min(max(first[z, 1], 0), marked.shape[1] - size)
        total = 0.0
        for y in range(size):
            row = marked[top + y, left : left + size]
            any_marked = np.uint8(0)
            for x in range(size):  # in vectors, and as a rule there is none
                any_marked |= row[x]
            if any_marked == 0:
                continue
            along = np.float32(0)
            for x in range(size):
                along += weight[x] * np.float32(row[x])
            total += weight[y] * along
        out[z] = total
