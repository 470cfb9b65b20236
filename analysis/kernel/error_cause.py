"""What made the error of a picture, from what is left of some ZOIs: noise, compression, bands, blur, filters.

Measured on twenty ways to spoil a real picture (``tests/accuracy/degraded.py``): blocks 1.9 to 2.9 where a codec was,
else 0.98 to 1.06; lines 18 to 19 for bands, else up to 3.1; correlation of neighbours up to 0.05 for noise, else 0.15
and more. The blur is that of the fit, px^2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.field.picture_error import Cause
from analysis.kernel.lines import inner, left_by_fit, lines_along, some
from analysis.kernel.solve import Solution
from analysis.picture.blocks import BLOCKS, blockiness

SAMPLE = 30
"""ZOIs that are looked at."""
BLUR, NEIGHBOURS = 0.25, 0.12
"""Growth of the variance of the blur, px^2; correlation of neighbouring pixels."""


def error_cause(solution: Solution, ok: NDArray[np.bool_]) -> Cause:
    """What the error of the deformed picture looks like; ``ok`` (A,) are the ZOIs that have a value."""
    if blockiness(solution.image) > BLOCKS:
        return "compression"
    which = some(ok, SAMPLE)
    left = left_by_fit(solution, which)
    if lines_along(left) is not None:
        return "bands"
    if abs(float(np.median(solution.found.nuisance[ok, 2]))) > BLUR:
        return "blur"
    within = inner(left)
    beside = (np.mean(within[:, 1:] * within[:, :-1]) + np.mean(within[:, :, 1:] * within[:, :, :-1])) / 2
    return "noise" if abs(beside) < NEIGHBOURS * np.mean(within**2) else "filter"
