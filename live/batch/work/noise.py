"""The noise of a test as measured while nothing moved, beside the one that is predicted."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from live.results import Strain

STILL = 0.01  # of the range of the force
LEAST, MOST = 2, 8  # instants looked at


def still_instants(force: NDArray[np.float64]) -> int:
    """How many instants lie before the force, (T,) N, leaves its first value; 0 where it does not tell."""
    known = np.isfinite(force)
    if not known.any() or not known[0]:
        return 0
    left = np.abs(force - force[0]) > STILL * (np.nanmax(force) - np.nanmin(force))
    left |= ~known
    return int(np.argmax(left)) if left.any() else 0


def measured_noise(results: Path, force: NDArray[np.float64]) -> dict[str, Any]:
    """Standard deviation of one ZOI's eyy over the ZOIs of still instants, and how many instants those are."""
    count = still_instants(force)
    if count < LEAST:
        return {"still_instants": count}
    with Strain.open(results) as strain:
        maps = strain.maps("eyy", slice(0, count, math.ceil(count / MOST)))
    variances = [np.var(one, ddof=1) for one in (map_[np.isfinite(map_)] for map_ in maps) if one.size > 1]
    noise = math.sqrt(float(np.mean(variances))) if variances else math.nan
    return {"still_instants": count, "strain_noise_measured": noise}
