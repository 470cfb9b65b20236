"""A rolling shutter: lines are read one after the other, so that motion at v px/s shows v T / H as strain along them.

The picture is stamped at its middle line. The velocity is that of the mean displacement since the burst before, so it
holds for rigid motion, not for the strain rate within the picture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from analysis.field import CommonError, StrainField
from analysis.optics.plane import affine_values


@dataclass(frozen=True, slots=True)
class _Place:
    """Mean displacement at a time: t in s, u and v in px with standard uncertainties."""

    t: float
    u: tuple[float, float]
    v: tuple[float, float]


class ShutterCorrection:
    """Removes the shutter from each field, in the order of time.

    Parameters
    ----------
    readout_s : float, s
        From the first line of the picture to the last.
    height : int
        Lines of the picture.
    sigma_s : float, s
        Standard uncertainty of ``readout_s``.
    """

    def __init__(self, readout_s: float, height: int, sigma_s: float = 0.0) -> None:
        self._relative = sigma_s / readout_s if readout_s else 0.0
        self._a_line = readout_s / max(height - 1, 1)
        self._middle = (height - 1) / 2
        self._last: _Place | None = None

    def apply(self, field: StrainField, t: float) -> StrainField:
        """``field`` of a burst at ``t`` (s) as if all lines were read at once; as it is where nothing was measured."""
        here, last = _Place(t, field.mean("u"), field.mean("v")), self._last
        if not math.isfinite(here.u[0]):
            return field
        self._last = here
        if last is None or t <= last.t:
            return field
        (vx, sx), (vy, sy) = (
            _rate(now, before, t - last.t) for now, before in ((here.u, last.u), (here.v, last.v))
        )
        return self._removed(field, (vx, vy), (sx, sy))

    def _removed(
        self, field: StrainField, velocity: tuple[float, float], sigma: tuple[float, float]
    ) -> StrainField:
        _, _, _, v, dv_dx, dv_dy = affine_values(field)
        late = self._a_line * (field.grid.y[:, None] + v - self._middle)
        along_x, along_y = self._a_line * dv_dx, self._a_line * (1 + dv_dy)
        moved = np.array([late, along_x, along_y])
        half, parameters = len(field.parameters) // 2, field.parameters.copy()
        parameters[:3] -= velocity[0] * moved
        parameters[half : half + 3] -= velocity[1] * moved
        shapes = np.zeros((3, 6, *field.grid.shape))
        shapes[0, :3] = shapes[1, 3:] = np.nan_to_num(moved)
        shapes[2] = velocity[0] * shapes[0] + velocity[1] * shapes[1]  # of the readout time, relative
        error = CommonError(shapes, np.diag(np.square([*sigma, self._relative])))
        return replace(field, parameters=parameters, common=error.beside(field.common))


def _rate(now: tuple[float, float], before: tuple[float, float], seconds: float) -> tuple[float, float]:
    """Change of a value and its standard uncertainty over a time."""
    return (now[0] - before[0]) / seconds, math.hypot(now[1], before[1]) / seconds
