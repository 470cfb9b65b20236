"""Bursts of a still and of a loaded window, kept to be measured with many settings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquire.errors import DataError
from acquire.frame import Burst
from live.replay import Material

_STILL_FORCE = 0.01  # of the range of the force
_LOADED_FORCE = 0.98  # of the highest
MOST_STILL, MOST_LOADED = 8, 6
LEAST_STILL, LEAST_LOADED = 2, 2

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
    told = (still or _still(material), loaded or _loaded(material))
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


def _forces(material: Material, option: str) -> tuple[np.ndarray, np.ndarray]:
    t, force = material.loads.arrays()
    if not len(t) or not np.isfinite(force).any():
        raise DataError(f"no force tells when it was still and when loaded; give --{option} A,B in seconds")
    return t - material.start.monotonic, force


def _still(material: Material) -> Seconds:
    """Until the force has left its first value."""
    t, force = _forces(material, "static")
    first = force[np.isfinite(force)][0]
    left = np.abs(force - first) > _STILL_FORCE * (np.nanmax(force) - np.nanmin(force))
    return (-math.inf, float(t[int(np.argmax(left))]) if left.any() else float(t[-1]))


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
    rows = np.unique(np.linspace(0, len(bursts) - 1, min(most, len(bursts))).round().astype(int))
    return tuple(bursts[row] for row in rows)
