"""The mean values of each measured instant, kept in memory for the summary and the status line."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquire.load_cell import LoadLog
from live.measure.measurement import Measurement

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Instant:
    """Means over the valid ZOIs at one time; strains dimensionless, force in N.

    ``refused`` says why ZOIs have no value ("3 UNEVEN, 1 LOST"), empty where all have one.
    """

    t: float
    force: float
    exx: float
    eyy: float
    exy: float
    sigma_exx: float
    sigma_eyy: float
    sigma_exy: float
    largest: float
    zoi_sigma: float
    n_valid: int
    n_zoi: int
    refused: str
    noise_GL: float
    measure_s: float


def instant_of(measurement: Measurement) -> Instant:
    """The means of one measurement; ``largest`` is the strain of largest magnitude of any valid ZOI,
    ``zoi_sigma`` the median uncertainty of one ZOI's eyy."""
    field = measurement.field
    (exx, s_xx), (eyy, s_yy), (exy, s_xy) = (field.mean(name) for name in ("exx", "eyy", "exy"))
    valid = np.isfinite(field.exx)
    values = np.concatenate([field.exx[valid], field.eyy[valid]])
    return Instant(
        t=measurement.t,
        force=measurement.force,
        exx=exx,
        eyy=eyy,
        exy=exy,
        sigma_exx=s_xx,
        sigma_eyy=s_yy,
        sigma_exy=s_xy,
        largest=float(values[np.argmax(np.abs(values))]) if values.size else math.nan,
        zoi_sigma=float(np.median(field.sigma_eyy[valid])) if values.size else math.nan,
        n_valid=int(valid.sum()),
        n_zoi=int(field.grid.active.sum()),
        refused=", ".join(f"{n} {status.name}" for status, n in field.refused.items()),
        noise_GL=measurement.burst.noise,
        measure_s=measurement.measure_s,
    )


class History:
    """All instants so far."""

    def __init__(self) -> None:
        self.instants: list[Instant] = []

    def add(self, measurement: Measurement) -> Instant:
        """Keep the means of ``measurement``."""
        instant = instant_of(measurement)
        self.instants.append(instant)
        return instant

    def column(self, name: str) -> Array:
        """One quantity over time, (N,) float64."""
        return np.array([getattr(instant, name) for instant in self.instants], np.float64)

    def forces(self, loads: LoadLog) -> Array:
        """The force at each instant with all samples that have come by now, (N,) float64, N."""
        return np.array([loads.force_at(instant.t) for instant in self.instants], np.float64)

    def along(self, axis: str) -> tuple[Array, Array]:
        """Mean strain along and across the load."""
        names = ("eyy", "exx") if axis == "y" else ("exx", "eyy")
        return self.column(names[0]), self.column(names[1])
