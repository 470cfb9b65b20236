"""Which ZOIs can be believed: a status for each from its own numbers, in a compiled loop.

The limits are in ``validity``.
"""

from __future__ import annotations

import math
from typing import Any

from numba import prange

from analysis.compiled.loops import helper, parallel
from analysis.field import Status
from analysis.fit.iteration import CONVERGED, LEFT_IMAGE
from analysis.fit.validity import (
    BENDING_CHANCE,
    BENDING_SHARE,
    CHANCE,
    LEAST_GAIN,
    LOST_SHARE,
    MODEL_SHARE,
    MOST_GAIN,
    NOISE_FACTOR,
    UNKNOWN_NOISE_FACTOR,
)

OK, OUTSIDE, LOST, UNEVEN = int(Status.OK), int(Status.OUTSIDE), int(Status.LOST), int(Status.UNEVEN)
NOT_CONVERGED, POOR_MATCH = int(Status.NOT_CONVERGED), int(Status.POOR_MATCH)


@parallel
def judge(
    state: Any, left: Any, expected: Any, signal: Any, gain: Any, pixels: Any, noise_known: bool,
    bending: Any, unit: Any, noise: Any, values: Any, lever: Any, limit: Any, out: Any,
) -> None:  # fmt: skip
    """Write a status for each measured ZOI.

    Parameters
    ----------
    state : (A,) uint8, of ``gauss_newton``
    left, expected : (A,), GL^2
        Variance a pixel that the fit leaves, and expected from the noise of both images.
    signal : (A,), GL^2
        Variance of the pattern in the reference.
    gain : (A,)
    pixels : (A,)
        Effective number of independent pixels of each ZOI.
    noise_known : bool
        Whether ``expected`` stands on noise that was given.
    bending : (A,), px^2
        See ``shapes.bent``.
    unit : (A, 2), px^2 per GL^2
        Variance of u and of v from noise of 1 GL, of a ZOI without anything else to find.
    noise : (2,)
        ``shapes.Shapes.noise``.
    values : (A, 6 or 12), px units
    lever : float, px
        Width of the window that makes a displacement of a strain.
    limit : float, px
        What the displacement at the centre may be wrong by.
    out : (A,) uint8, written
    """
    for z in prange(len(out)):
        chance = NOISE_FACTOR + CHANCE * math.sqrt(2 / max(pixels[z], 1.0))
        if not noise_known:
            chance = max(chance, UNKNOWN_NOISE_FACTOR)
        allowed = chance * expected[z]
        pattern = signal[z] * min(gain[z], 1.0) ** 2
        if state[z] == LEFT_IMAGE:
            out[z] = OUTSIDE
        elif not left[z] <= allowed + LOST_SHARE * pattern:
            out[z] = LOST
        elif state[z] != CONVERGED:
            out[z] = NOT_CONVERGED
        elif not (LEAST_GAIN < gain[z] < MOST_GAIN and left[z] <= allowed + MODEL_SHARE * pattern):
            out[z] = POOR_MATCH
        else:
            variance = max(expected[z], left[z])
            stretch = stretch_of(values, z, lever)
            bends = _bends(bending[z], variance * unit[z, 0], variance * unit[z, 1], noise, stretch, limit)
            out[z] = UNEVEN if bends else OK


@helper
def _bends(bending: Any, of_u: Any, of_v: Any, noise: Any, stretch: Any, limit: Any) -> bool:
    """Whether the displacement jumps, or bends so much that the centre is wrong.

    ``stretch``, px, is the displacement that the strain makes over the width of the window: where a
    specimen necks the strain is steep, but small beside itself; across a crack it is not.
    """
    mean = (of_u + of_v) * noise[0]
    spread = math.sqrt(2 * noise[1] * (of_u**2 + of_v**2))
    allowed = limit**2 + (BENDING_SHARE * stretch) ** 2
    return not bending <= mean + BENDING_CHANCE * spread + allowed


@helper
def stretch_of(values: Any, z: int, lever: Any) -> Any:
    """Magnitude of the Green-Lagrange strain of ZOI ``z`` times ``lever`` px."""
    half = values.shape[1] // 2
    du_dx, du_dy = values[z, 1], values[z, 2]
    dv_dx, dv_dy = values[z, half + 1], values[z, half + 2]
    xx = du_dx + (du_dx**2 + dv_dx**2) / 2
    yy = dv_dy + (du_dy**2 + dv_dy**2) / 2
    xy = (du_dy + dv_dx + du_dx * du_dy + dv_dx * dv_dy) / 2
    return lever * math.sqrt(xx**2 + yy**2 + 2 * xy**2)
