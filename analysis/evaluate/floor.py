"""The noise floor of a finished test: how many instants at its start are still, and how ZOIs scatter in them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.evaluate.curve import noise

Floats = NDArray[np.float64]

MIN_STILL_INSTANTS = 2
"""Still instants that a noise floor needs."""

_FORCE = 0.01  # of the range of the force
_MIN_RANGE = 10.0  # standard deviations of its noise that a force must range over; noise alone ranges over 9
_SIGMAS = 5.0


@dataclass(frozen=True, slots=True)
class NoiseFloor:
    """Standard deviation of single ZOIs in still instants.

    Attributes
    ----------
    measured, predicted : float
        In the unit of the map.
    """

    measured: float
    predicted: float


def still_phase(force: Floats, means: Mapping[str, tuple[Floats, Floats]] | None = None) -> int:
    """The number of instants at the start of a test in which nothing moves.

    They end before the first one whose force differs from the first value by more than 1 % of the range of the
    force, or is not known. The strains do not count there: instants chosen by their strain would lack the very
    scatter that is measured. Only where the force does not decide (it is not known at the first instant, or does
    not range over more than its noise) the still phase ends before the first mean strain beyond 5 of its
    standard uncertainties.

    Parameters
    ----------
    force : (T,) float64, N
        With one zero for all; NaN where it is not known.
    means : mapping of str to two (T,) float64, optional
        Mean strains with their standard uncertainties.
    """
    if _force_decides(force):
        return _leading(np.abs(force - force[0]) <= _FORCE * np.ptp(force[np.isfinite(force)]))
    within = [np.abs(mean) <= _SIGMAS * sigma for mean, sigma in (means or {}).values()]
    return _leading(np.all(within, axis=0)) if within else 0


def _force_decides(force: Floats) -> bool:
    known = force[np.isfinite(force)]
    return bool(len(force)) and math.isfinite(force[0]) and float(np.ptp(known)) > _MIN_RANGE * noise(known)


def _leading(good: NDArray[np.bool_]) -> int:
    return len(good) if good.all() else int(np.argmin(good))


def evenly(count: int, max_count: int) -> NDArray[np.intp]:
    """At most ``max_count`` of ``count`` places, from the first to the last."""
    return np.unique(np.linspace(0, count - 1, min(max_count, count)).round().astype(np.intp))


def noise_floor(maps: Iterable[tuple[Floats, Floats]], *, planes: bool = False) -> NoiseFloor | None:
    """Scatter over the ZOIs of each still instant; None where too few have a value.

    Parameters
    ----------
    maps : iterable of two (R, C) float64
        Values and their standard uncertainties, NaN where there are none.
    planes : bool
        Scatter about a plane in place of the mean: of a displacement, it leaves rigid motion, strain and the
        vibration of the rig out. What is left holds the noise of the pictures and of the reference, as the
        uncertainties do.
    """
    terms = 3 if planes else 1
    squares, expected, n = 0.0, 0.0, 0
    for values, sigma in maps:
        known = np.isfinite(values) & np.isfinite(sigma)
        count = int(known.sum())
        if count <= terms:
            continue
        rest = _without_plane(values, known) if planes else values[known] - values[known].mean()
        squares += float(rest @ rest) * count / (count - terms)
        expected += float((sigma[known] ** 2).sum())
        n += count
    return NoiseFloor(math.sqrt(squares / n), math.sqrt(expected / n)) if n else None


def _without_plane(values: Floats, known: NDArray[np.bool_]) -> Floats:
    y, x = np.nonzero(known)
    plane = np.stack([np.ones(len(x)), x, y], axis=1)
    factors = np.linalg.lstsq(plane, values[known], rcond=None)[0]
    return np.asarray(values[known] - plane @ factors)
