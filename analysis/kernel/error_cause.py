"""What made the error of a picture, from what is left of some ZOIs: noise, compression, bands, blur, filters.

Measured on twenty ways to spoil a real picture (``tests/accuracy/degraded.py``): blocks 1.9 to 2.9 where a codec was,
else 0.98 to 1.06; lines 18 to 19 for bands, else up to 3.1; correlation of neighbours up to 0.05 for noise, else 0.15
and more. The blur is that of the fit, px^2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.field.picture_error import Cause
from analysis.kernel.solve import Solution
from analysis.picture.blocks import BLOCKS, blockiness

SAMPLE = 30
"""ZOIs that are looked at."""
LINES, BLUR, NEIGHBOURS = 8.0, 0.25, 0.12
Pixels = NDArray[np.float64]


def error_cause(solution: Solution, ok: NDArray[np.bool_]) -> Cause:
    """What the error of the deformed picture looks like; ``ok`` (A,) are the ZOIs that have a value."""
    if blockiness(solution.image) > BLOCKS:
        return "compression"
    which = np.flatnonzero(ok)
    left = _left(solution, which[:: max(1, len(which) // SAMPLE)])
    variance = float(np.mean(left**2))
    if max(_line_share(left, 1), _line_share(left, 2)) > LINES * variance:
        return "bands"
    if abs(float(np.median(solution.found.nuisance[ok, 2]))) > BLUR:
        return "blur"
    beside = (np.mean(left[:, 1:] * left[:, :-1]) + np.mean(left[:, :, 1:] * left[:, :, :-1])) / 2
    return "noise" if abs(beside) < NEIGHBOURS * variance else "filter"


def _line_share(left: Pixels, axis: int) -> float:
    """Variance of the means of lines times their length: for white noise the variance of a pixel."""
    return float(np.mean(left.mean(axis=axis) ** 2)) * int(left.shape[axis])


def _left(solution: Solution, which: NDArray[np.intp]) -> Pixels:
    """What is left of some ZOIs without their rims, (N, n, n)."""
    from analysis.fit.iteration import warp_zois

    ready, size = solution.reference.prepared, solution.reference.grid.size
    p = np.ascontiguousarray(solution.found.p[which][:, solution.reference.affine])
    warped = np.empty((len(which), size, size), np.float32)
    warp_zois(solution.picture, solution.table, ready.origins[which], size, p, warped)
    places = [np.s_[top : top + size, left : left + size] for top, left in ready.origins[which]]
    raw, level = (np.stack([ready.images[k][place] for place in places]).astype(np.float64) for k in (3, 2))
    gain = solution.found.nuisance[which, 0][:, None, None]
    inner = slice(size // 8, -(size // 8))
    left = (warped - raw - (gain - 1) * level)[:, inner, inner]
    return left - left.mean(axis=(1, 2), keepdims=True)
