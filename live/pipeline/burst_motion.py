"""What the motion during a burst does to its strain: the mean of its frames is that at its time only at a steady rate.

The mean of a burst during T, in which the strain rate changes by r at s after its middle, is off by
``r (T/2 - |s|)^2 / (2 T)``, at most ``r T / 8``. From the bursts before, its strain is then off by as much or more:
that is the bound which is taken as its standard uncertainty, where noise does not explain it. At a steady rate
nothing is added: blur that is alike on both sides does not shift a picture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from acquire.frame import Burst
from analysis.field import CommonError, StrainField

CERTAIN = 3.0
"""A change of the strain rate is one beyond so many of its standard uncertainties."""
STRAINS = ("exx", "eyy", "exy")


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    t: float
    field: StrainField
    means: dict[str, tuple[float, float]]


class BurstMotion:
    """Adds to each field, in the order of time, what an uneven motion during its burst can do to it."""

    def __init__(self) -> None:
        self._before: list[_Seen] = []

    def apply(self, field: StrainField, burst: Burst) -> StrainField:
        """``field`` with the error in common to all its ZOIs; as it is where its burst has no duration."""
        here = _Seen(burst.t, field, {name: field.mean(name) for name in STRAINS})
        before, self._before = self._before, [*self._before[-1:], here]
        if burst.duration <= 0 or len(before) < 2 or not before[0].t < before[1].t < here.t:
            return field
        ahead = (here.t - before[1].t) / (before[1].t - before[0].t)
        shares = (ahead, -1 - ahead, 1.0)  # of the three: how far the last is off a straight line
        unexplained = 0.0
        for name in STRAINS:
            off, noise = 0.0, 0.0
            for share, seen in zip(shares, (*before, here), strict=True):
                off += share * seen.means[name][0]
                noise += (share * seen.means[name][1]) ** 2
            if abs(off) > CERTAIN * math.sqrt(noise):  # NaN: never
                unexplained = max(unexplained, 1 - CERTAIN**2 * noise / off**2)
        if not unexplained:
            return field
        affine = (_affine(seen.field) * share for share, seen in zip(shares, (*before, here), strict=True))
        error = CommonError(np.nan_to_num(sum(affine))[None], np.array([[unexplained]]))
        return replace(field, common=error.beside(field.common))


def _affine(field: StrainField) -> np.ndarray:
    """(6, R, C): u, du_dx, du_dy, v, dv_dx, dv_dy of each ZOI."""
    half = len(field.parameters) // 2
    return np.concatenate([field.parameters[:3], field.parameters[half : half + 3]])
