"""The means of one measured field over its valid ZOIs, computed once for all who want them."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from acquire.frame import Burst
    from analysis.evaluate import GaugeValue
    from analysis.field import StrainField

AXIAL, TRANSVERSE = "axial", "transverse"
"""Gauges of these names are the strain along and across the load."""


@dataclass(frozen=True, slots=True)
class Instant:
    """Means over the valid ZOIs at one time; strains are small strains, force in N, u and v in px.

    Attributes
    ----------
    t : float, s
        Monotonic.
    force : float, N
        At ``t``; NaN where no load is known (yet).
    exx, eyy, exy, sigma_exx, sigma_eyy, sigma_exy : float
        Means and the standard uncertainties of the means.
    u, v : float, px
    largest : float
        The strain of largest magnitude of any valid ZOI.
    zoi_sigma : float
        Median standard uncertainty of one ZOI's eyy.
    n_valid, n_zoi : int
    refused : str
        Why ZOIs have no value ("3 UNEVEN, 1 LOST"), empty where all have one.
    noise_GL : float
        Of one frame, from the burst; NaN where it tells nothing.
    measure_s : float, s
        Time the kernel took; 0.0 where nobody measured it.
    latency_s : float, s
        From the stamp of the burst's last frame to this result; NaN in a replay.
    gauges : mapping of name to GaugeValue
        In the order of the configuration.
    force_raw : float, N
        As stamped, where a lag of the load was taken off ``force``; else NaN.
    zero : float, N
        What tares have taken off ``force`` by then.
    """

    t: float
    force: float
    exx: float
    eyy: float
    exy: float
    sigma_exx: float
    sigma_eyy: float
    sigma_exy: float
    u: float
    v: float
    largest: float
    zoi_sigma: float
    n_valid: int
    n_zoi: int
    refused: str
    noise_GL: float
    measure_s: float
    latency_s: float = math.nan
    gauges: Mapping[str, GaugeValue] = field(default_factory=dict)
    force_raw: float = math.nan
    zero: float = 0.0

    def axial(self, axis: str) -> tuple[float, float]:
        """Strain along the load, which runs along ``axis`` ("x" or "y"), and its standard uncertainty."""
        name, _ = strains_along(self.gauges, axis)
        if name == AXIAL:
            return self.gauges[name].value, self.gauges[name].sigma
        return getattr(self, name), getattr(self, f"sigma_{name}")


def strains_along(gauges: Container[str], axis: str) -> tuple[str, str]:
    """What is read as strain along and across the load, which runs along ``axis`` ("x" or "y").

    The gauges ``AXIAL`` and ``TRANSVERSE`` where they are among ``gauges``, else the mean strains.
    """
    along, across = ("exx", "eyy") if axis == "x" else ("eyy", "exx")
    return AXIAL if AXIAL in gauges else along, TRANSVERSE if TRANSVERSE in gauges else across


def instant_of(burst: Burst, field: StrainField, force: float, measure_s: float = 0.0) -> Instant:
    """The means of ``field``, measured from ``burst``."""
    (exx, s_xx), (eyy, s_yy), (exy, s_xy) = (field.mean(name) for name in ("exx", "eyy", "exy"))
    valid = field.ok
    values = np.concatenate([field.exx[valid], field.eyy[valid]])
    return Instant(
        t=burst.t,
        force=force,
        exx=exx,
        eyy=eyy,
        exy=exy,
        sigma_exx=s_xx,
        sigma_eyy=s_yy,
        sigma_exy=s_xy,
        u=ordered_mean(field.u[valid]),
        v=ordered_mean(field.v[valid]),
        largest=float(values[np.argmax(np.abs(values))]) if values.size else math.nan,
        zoi_sigma=float(np.median(field.sigma_eyy[valid])) if values.size else math.nan,
        n_valid=int(valid.sum()),
        n_zoi=int(field.grid.active.sum()),
        refused=", ".join(f"{n} {status.name}" for status, n in field.refused.items()),
        noise_GL=burst.noise,
        measure_s=measure_s,
    )


def ordered_mean(values: np.ndarray) -> float:
    """The mean of finite values, NaN of none: the same bits wherever they lie in memory.

    numpy's own sum takes them in an order that depends on their alignment.
    """
    return float(np.cumsum(values, dtype=np.float64)[-1]) / values.size if values.size else math.nan
