"""What makes a modulus uncertain beyond the scatter and comes with the load: lens and sharpness."""

from __future__ import annotations

import math

import numpy as np

from analysis.evaluate.curve import Loading
from analysis.evaluate.elastic import MIN_POINTS, FittedLine

BLUR_STRAIN = 30e-6 / 0.5**2
"""Largest error of a strain by a change of sharpness, over the variance of the blur, 1/px^2 (docs/data/accuracy.md)."""
_CLEAR_BLUR = 3.0  # standard uncertainties of the rise of that variance with the strain


def lens_share(loading: Loading, line: FittedLine, strained: float) -> dict[str, float]:
    """The largest uncertainty of the strain by a corrected lens in the elastic interval, over ``strained``.

    All of it may come with the load: the error of a lens is the same in every picture of a motion.
    """
    sigma = loading.lens[line.first : line.last]
    return {"lens": float(np.nanmax(sigma)) / strained} if np.isfinite(sigma).any() else {}


def blur_share(loading: Loading, line: FittedLine) -> dict[str, float]:
    """What a change of sharpness that comes with the load may make of the strain; nothing where none is clear.

    The error grows with the variance of the blur, to ``BLUR_STRAIN`` at most: a limit, as of ``ErrorLimits``.
    """
    part = slice(line.first, line.last)
    blur, strain = loading.blur[part], loading.strain[part]
    known = np.isfinite(blur)
    n = int(known.sum())
    if n < MIN_POINTS:
        return {}
    x, y = (values[known] - values[known].mean() for values in (strain, np.copysign(blur**2, blur)))
    sxx = float(x @ x)
    slope = float(x @ y) / sxx
    rest = y - slope * x
    sigma = math.sqrt(float(rest @ rest) / (n - 2) / sxx)
    return {"blur": BLUR_STRAIN * abs(slope) / math.sqrt(3)} if abs(slope) > _CLEAR_BLUR * sigma else {}
