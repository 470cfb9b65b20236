"""The still phase of a finished test and the noise floor measured in it, for report, comparison and batch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.evaluate import MIN_STILL_INSTANTS, NoiseFloor, evenly, noise_floor, still_phase
from live.results.reader import Strain

MAX_INSTANTS = 64
"""Still instants that are read; more do not improve the noise floor."""

_MEANS = ("exx", "eyy", "exy")
_DISPLACEMENTS = ("u", "v")


@dataclass(frozen=True, slots=True)
class StillPhase:
    """The beginning of a test, before anything moves.

    Attributes
    ----------
    time_steps : int
    floors : mapping of str to NoiseFloor
        Of u, v (px), exx, eyy and exy; empty with too few instants; a map with too few ZOIs is left out.
    """

    time_steps: int
    floors: dict[str, NoiseFloor]


def still_phase_of(strain: Strain, names: Sequence[str] = (*_DISPLACEMENTS, *_MEANS)) -> StillPhase:
    """The still phase of ``strain``, with the noise floors of the maps ``names``; raises DataError as ``maps``."""
    means = {name: (_column(strain, name), _column(strain, f"sigma_{name}")) for name in _MEANS}
    count = still_phase(strain.force_one_zero, means)
    if count < MIN_STILL_INSTANTS:
        return StillPhase(count, {})
    rows = evenly(count, MAX_INSTANTS).tolist()
    floors = {name: noise_floor(_maps(strain, name, rows), planes=name in _DISPLACEMENTS) for name in names}
    return StillPhase(count, {name: floor for name, floor in floors.items() if floor is not None})


def _column(strain: Strain, name: str) -> NDArray[np.float64]:
    return np.asarray(strain.values[name], np.float64)


def _maps(
    strain: Strain, name: str, rows: list[int]
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    for row in rows:
        values, sigma = (np.asarray(strain.maps(map_, row), np.float64) for map_ in (name, f"sigma_{name}"))
        yield values, sigma
