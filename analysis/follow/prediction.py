"""Where each ZOI will be in the next frame (``alpha_beta`` has the arithmetic)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.field import Motion
from analysis.follow.alpha_beta import advance

Floats = NDArray[np.float64]


def motion_after(before: Motion, values: Floats, guess: Floats, sigma: Floats, lever: float) -> Motion:
    """What this frame says of the next one, given what the one before said of this.

    Parameters
    ----------
    before : Motion
    values, guess : (A, modes)
        Measured and predicted for this frame; modes are u, du_dx, du_dy, ..., v, dv_dx, ...; NaN
        where a ZOI was or is lost.
    sigma : (A,), px
        Uncertainty of u and v from the noise of one frame.
    lever : float, px
        What makes the uncertainty of a gradient one of a displacement.
    """
    motion = Motion(before.index, np.empty_like(values), np.empty_like(values), np.empty_like(before.age))
    advance(values, guess, before.change, before.age, sigma, lever, motion.change, motion.ahead, motion.age)
    return motion
