"""Bursts of a still and of a loaded window, kept to be measured with many settings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquire.errors import DataError
from acquire.frame import Burst
from analysis.evaluate import FEWEST_STILL, evenly, still_phase
from live.replay import Material

_LOADED_FORCE = 0.98  # of the highest
MOST_STILL, MOST_LOADED = 8, 6
LEAST_STILL, LEAST_LOADED = FEWEST_STILL, 2

Seconds = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Windows:
    """Averaged bursts.

    Attributes
    ----------
    still, loaded : tuple of Burst
        At least two each; no still ones where there were none.
    """

    still: tuple[Burst, ...]
    loaded: tuple[Burst, ...]


NEVER: Seconds = (math.inf, -math.inf)
"""The still window of a test in which nothing was still."""


def take_windows(material: Material, still: Seconds | None, loaded: Seconds | None) -> Windows:
    """Read the bursts of both windows, s since the start; without one, as the force tells it; ``NEVER`` for none.

    Raises
    ------
    DataError
        There are not enough bursts in one, or no force tells it.
    """
    told = (still or still_window(material), loaded or _loaded(material))
    found: tuple[list[Burst], list[Burst]] = ([], [])
    for item in material.bursts:
        if not isinstance(item, Burst):
            raise DataError("the reference was renewed in this session; a study needs one without")
        t = item.t - material.start.monotonic
        for (low, high), bursts in zip(told, found, strict=True):
            if low <= t <= high:
                bursts.append(item)
        if t > max(high for _, high in told):
            break
    for name, bursts, least, (low, high) in zip(
        ("static", "loaded"), found, (LEAST_STILL, LEAST_LOADED), told, strict=True
    ):
        if len(bursts) < least and (low, high) != NEVER:
            raise DataError(
                f"{len(bursts)} bursts from {low:.3g} to {high:.3g} s, {least} are needed; give --{name} A,B"
            )
    return Windows(_spread(found[0], MOST_STILL), _spread(found[1], MOST_LOADED))


def _untold(option: str) -> DataError:
    return DataError(f"no force tells when it was still and when loaded; give --{option} A,B in seconds")


def _forces(material: Material, option: str) -> tuple[np.ndarray, np.ndarray]:
    t, force = material.loads.arrays()
    if not len(t) or not np.isfinite(force).any():
        raise _untold(option)
    return t - material.start.monotonic, force


def still_window(material: Material) -> Seconds:
    """The still phase by the force at the bursts, as report and batch find it once they are measured.

    Raises
    ------
    DataError
        No force tells it.
    """
    times = np.zeros(0) if material.times is None else material.times
    count = still_phase(material.loads.forces_one_zero(times.tolist()))
    if not count:
        raise _untold("static")
    return -math.inf, float(times[count - 1]) - material.start.monotonic


def _loaded(material: Material) -> Seconds:
    """About the highest force, for as long as it stays near it."""
    t, force = _forces(material, "loaded")
    high = np.abs(force) >= _LOADED_FORCE * np.nanmax(np.abs(force))
    top = low = int(np.nanargmax(np.abs(force)))
    while low > 0 and high[low - 1]:
        low -= 1
    while top + 1 < len(t) and high[top + 1]:
        top += 1
    return float(t[low]), float(t[top])


def _spread(bursts: Sequence[Burst], most: int) -> tuple[Burst, ...]:
    """At most ``most`` of them, evenly."""
    return tuple(bursts[row] for row in evenly(len(bursts), most))
