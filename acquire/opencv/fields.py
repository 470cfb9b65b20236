"""Whether the odd and even rows of a picture are of two moments, as those of an interlaced film are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_PART = 512  # px: of the middle of the picture, which is enough
_LEAST = 1e-6  # of the gradients: less is no picture
_EXPLAINED = 0.01  # of what differs between the rows: less is noise, or a pattern too fine to tell


def rows_apart(image: NDArray[np.generic]) -> float:
    """Shift between the odd rows and the mean of the even ones beside them, px; 0 where no shift explains them.

    From the gradients of both, by least squares; to 0.01 px on a speckle of 1 px radius or more, 0 on a finer one.
    """
    height, width = image.shape
    top, left = max(height - _PART, 0) // 2, max(width - _PART, 0) // 2
    part = image[top : top + _PART, left : left + _PART].astype(np.float64)
    if min(part.shape) < 4:
        return 0.0
    n = (len(part) - 1) // 2
    above, odd, below = part[0 : 2 * n : 2], part[1 : 2 * n : 2], part[2 : 2 * n + 1 : 2]
    mean = (above + below) / 2
    gx, gy, rest = np.gradient((mean + odd) / 2, axis=1), (below - above) / 2, mean - odd
    normal = np.array([[np.sum(gx * gx), np.sum(gx * gy)], [np.sum(gx * gy), np.sum(gy * gy)]])
    if np.linalg.det(normal) <= _LEAST * np.trace(normal) ** 2:
        return 0.0
    right = np.array([np.sum(gx * rest), np.sum(gy * rest)])
    shift = np.linalg.solve(normal, right)
    return float(np.hypot(*shift)) if shift @ right > _EXPLAINED * np.sum(rest**2) else 0.0
