"""Filters for pictures of maps, on request; measured values are never touched, and titles name the filter.

The paper filters its strain maps "for cosmetic reasons": salt-and-pepper (median), then a Gaussian.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
PAPER_LOW_PASS = 9.0


def for_display(values: Floats, step: int, low_pass_px: float = PAPER_LOW_PASS, median: int = 3) -> Floats:
    """A map as the paper shows it: salt-and-pepper (median) filter, then a Gaussian low-pass.

    Parameters
    ----------
    values : (R, C), NaN where not measured; stays NaN there
    step : int, px
        Between the points of the map.
    low_pass_px : float, px
        sigma; 0: none.
    median : int
        Side of the median filter, points; 1: none.
    """
    from scipy.ndimage import gaussian_filter, generic_filter

    valid = np.isfinite(values)
    out = values.copy()
    if median > 1:
        out = np.where(
            valid, generic_filter(np.where(valid, values, np.nan), _nanmedian, median, mode="nearest"), np.nan
        )
    if low_pass_px > 0:
        weight = gaussian_filter(valid.astype(float), low_pass_px / step, mode="nearest")
        total = gaussian_filter(np.where(valid, out, 0.0), low_pass_px / step, mode="nearest")
        out = np.where(valid, total / np.maximum(weight, 1e-9), np.nan)
    return np.asarray(out)


def _nanmedian(values: Floats) -> float:
    good = values[np.isfinite(values)]
    return float(np.median(good)) if good.size else float("nan")
