"""What the pipeline gives: a measurement with its field, the means of it, and the force matched in time.

The means over the valid ZOIs are computed once for all who use them.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Container, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquire.frame import Burst
from acquire.load_cell.load_log import LoadLog
from acquire.text import Message, joined
from analysis.evaluate import COME_APART, REGION, AreaStrain, GaugeSet, GaugeValue
from analysis.field import StrainField, area_share, mean_blur
from analysis.optics import ApparentMotion, LensReading
from live.config.figures import LIVE

AXIAL, TRANSVERSE = "axial", "transverse"
"""Gauges of these names are the strain along and across the load."""
NO_GAUGES: Mapping[str, GaugeValue] = MappingProxyType({})
HOLD_S = 2.0
"""Measurements wait for their force at most this long, in measured time."""


@dataclass(frozen=True, slots=True)
class TimeStep:
    """The strain of the region at one time, in the measure of the field; force in N, u and v in px.

    Attributes
    ----------
    t : float, s
        Monotonic.
    force : float, N
        At ``t``; NaN where no load is known (yet).
    exx, eyy, exy, sigma_exx, sigma_eyy, sigma_exy : float
        Of the affine field through all valid ZOIs (``analysis.evaluate.AreaStrain``), and standard uncertainties.
    u, v : float, px
        Means.
    largest : float
        The strain of largest magnitude of any valid ZOI.
    zoi_sigma : float
        Median standard uncertainty of one ZOI's eyy.
    n_valid, n_zoi : int
    refused : str
        Why ZOIs have no value ("3 UNEVEN, 1 LOST"), empty where all have one.
    noise_GL : float
        Of one frame, from the burst; NaN where it cannot be estimated.
    measure_s : float, s
        Time the kernel took; 0.0 where it was not measured.
    latency_s : float, s
        From the stamp of the burst's last frame to this result; NaN in a replay.
    gauges : mapping of name to GaugeValue
        In the order of the configuration.
    force_raw : float, N
        As stamped, where ``force`` is corrected for a lag of the load; else NaN.
    zero : float, N
        What tares have subtracted from ``force`` by then.
    extension_x, extension_y, sigma_extension_x, sigma_extension_y : float
        (L - L0)/L0 between strips at the two ends of the region, along x and along y.
    uneven_exx, uneven_eyy : float
        Variation of the strain over the region (``analysis.evaluate.Unevenness``).
    misfit : float
        That variation over what noise makes of it.
    blur, sigma_blur : float, px
        Of the picture since its reference (``analysis.field.Blur``); negative: sharper.
    sigma_lens_exx, sigma_lens_eyy : float
        What of ``sigma_exx`` and ``sigma_eyy`` the uncertainty of a corrected lens makes; NaN without.
    area_share : float
        Of the region that its strains stand for, where a block of ZOIs was lost (``analysis.field.area_share``).
    n_parts : int
        Parts that the region has come apart into (``StrainField.parts``); beyond 1 its strains are NaN.
    width_s : float, s
        Of the time that the burst is a mean over (``mean_width``).
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
    extension_x: float = math.nan
    extension_y: float = math.nan
    sigma_extension_x: float = math.nan
    sigma_extension_y: float = math.nan
    uneven_exx: float = math.nan
    uneven_eyy: float = math.nan
    misfit: float = math.nan
    blur: float = math.nan
    sigma_blur: float = math.nan
    sigma_lens_exx: float = math.nan
    sigma_lens_eyy: float = math.nan
    area_share: float = 1.0
    n_parts: int = 1
    width_s: float = 0.0

    @property
    def apart(self) -> str:
        """Why the region has no strain although its ZOIs have; "" where it has one."""
        return COME_APART if self.n_parts > 1 else ""

    @property
    def lost_share(self) -> float:
        """Share of the ZOIs without a value."""
        return 1 - self.n_valid / max(self.n_zoi, 1)

    @property
    def least_share(self) -> float:
        """The smallest share of an area that the strains of the region and of the gauges stand for."""
        return min(self.area_share, *(gauge.share for gauge in self.gauges.values() if not gauge.reason), 1.0)

    def axial(self, axis: str) -> tuple[float, float]:
        """Strain along the load, which runs along ``axis`` ("x" or "y"), and its standard uncertainty."""
        name, _ = strains_along(self.gauges, axis)
        if name == AXIAL:
            return self.gauges[name].value, self.gauges[name].sigma
        return getattr(self, name), getattr(self, f"sigma_{name}")

    def strains(self, axis: str) -> dict[str, tuple[float, float, str]]:
        """Value, sigma and why there is none: of ``axial``, of the region, of gauges; of ``burst`` the valid share."""
        why = self.refused or Message("no ZOI has a value")
        region = {
            one.plain: (getattr(self, one.plain), getattr(self, f"sigma_{one.plain}", math.nan), why)
            for one in LIVE
        }
        gauges = {f"gauge_{name}": (one.value, one.sigma, one.reason) for name, one in self.gauges.items()}
        along, _ = strains_along(self.gauges, axis)
        found = {**region, **gauges}
        burst = (1 - self.lost_share, math.nan, "")
        return {"axial": found[f"gauge_{along}" if along == AXIAL else along], "burst": burst, **found}


def strains_along(gauges: Container[str], axis: str) -> tuple[str, str]:
    """Names of the strains along and across the load, which runs along ``axis`` ("x" or "y").

    The gauges ``AXIAL`` and ``TRANSVERSE`` where they are among ``gauges``, else the strains of the region.
    """
    along, across = ("exx", "eyy") if axis == "x" else ("eyy", "exx")
    return AXIAL if AXIAL in gauges else along, TRANSVERSE if TRANSVERSE in gauges else across


def extension_along(gauges: Container[str], axis: str) -> str:
    """Name of the extension of the test: the gauge ``AXIAL`` where it is among ``gauges``, else between strips."""
    return AXIAL if AXIAL in gauges else f"extension_{axis}"


def region_strains(field: StrainField, extensions: Mapping[str, GaugeValue] | None = None) -> dict[str, Any]:
    """The strains of a ``TimeStep`` by their names; NaN where no ZOI has a value, or the region has come apart.

    The ``extensions`` between strips (``analysis.evaluate.REGION``) stay: parts of a specimen have them, too.
    """
    area, names = AreaStrain.of(field), ("exx", "eyy", "exy")
    found: dict[str, Any] = dict.fromkeys((*names, *(f"sigma_{name}" for name in names)), math.nan)
    if area is not None:
        uneven = area.unevenness()
        found |= {"uneven_exx": uneven.exx, "uneven_eyy": uneven.eyy, "misfit": uneven.misfit}
        for name in names:
            found |= {name: area.value(name), f"sigma_{name}": area.sigma(name)}
    for name, extension in (extensions or GaugeSet(REGION).read(field)).items():
        found |= {name: extension.value, f"sigma_{name}": extension.sigma}
    return found


def time_step_of(
    burst: Burst, field: StrainField, force: float, measure_s: float = 0.0,
    extensions: Mapping[str, GaugeValue] | None = None,
) -> TimeStep:  # fmt: skip
    """The strains of ``field``, measured from ``burst``; see ``region_strains``."""
    valid = field.ok
    values = np.concatenate([field.exx[valid], field.eyy[valid]])
    blur = mean_blur(field)
    return TimeStep(
        t=burst.t,
        force=force,
        **region_strains(field, extensions),
        u=ordered_mean(field.u[valid]),
        v=ordered_mean(field.v[valid]),
        largest=float(values[np.argmax(np.abs(values))]) if values.size else math.nan,
        zoi_sigma=float(np.median(field.sigma_eyy[valid])) if values.size else math.nan,
        n_valid=int(valid.sum()),
        n_zoi=int(field.grid.active.sum()),
        refused=joined(
            ", ", (Message("{n} {name}", n, Message(status.name)) for status, n in field.refused.items())
        ),
        noise_GL=burst.noise,
        measure_s=measure_s,
        blur=blur.px,
        sigma_blur=blur.sigma,
        area_share=area_share(field),
        n_parts=field.n_parts(),
        width_s=float(mean_width(burst.duration, burst.n)),
    )


def mean_width(duration: ArrayLike, n: ArrayLike) -> NDArray[np.float64]:
    """The time that the mean of ``n`` even pictures, the last ``duration`` after the first, stands for.

    That of an even mean with the same second moment: its share of a vibration is the same.
    """
    count = np.maximum(np.asarray(n, np.float64), 1)
    return np.asarray(np.asarray(duration) * np.sqrt((count + 1) / np.maximum(count - 1, 1)), np.float64)


def ordered_mean(values: np.ndarray) -> float:
    """The mean of finite values, NaN of none: the same bits wherever they are in memory.

    The order of numpy's own sum depends on the alignment of the values.
    """
    return float(np.cumsum(values, dtype=np.float64)[-1]) / values.size if values.size else math.nan


@dataclass(frozen=True, slots=True, eq=False)
class PlateReading:
    """What plates measured of the camera's part in one burst.

    Attributes
    ----------
    raw : StrainField
        Of the specimen, before the correction.
    motion : ApparentMotion
        What was removed.
    sigma_scale : float
        Standard uncertainty of its scale.
    corrected : bool
        False: the plates could not be used, and the last motion was removed.
    """

    raw: StrainField
    motion: ApparentMotion
    sigma_scale: float
    corrected: bool

    def raw_strain(self, name: str) -> float:
        """A strain of the region before the correction; NaN where no ZOI has a value."""
        area = AreaStrain.of(self.raw)
        return math.nan if area is None else area.value(name)


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """A burst, its strain field, and the means of that with the force at its time.

    Attributes
    ----------
    number : int
        0, 1, 2 ... of the measured bursts.
    burst : Burst
    field : StrainField
    time_step : TimeStep
    plates : PlateReading or None
        Where there are plates, and ``field`` is corrected by them.
    lens : LensReading or None
        Where a lens is corrected.
    as_measured : StrainField or None
        What the kernel gave, of specimen and plates, before any correction.
    """

    number: int
    burst: Burst
    field: StrainField
    time_step: TimeStep
    plates: PlateReading | None = None
    lens: LensReading | None = None
    as_measured: StrainField | None = None

    @classmethod
    def of(
        cls, number: int, burst: Burst, field: StrainField, force: float, measure_s: float = 0.0,
        gauges: Mapping[str, GaugeValue] = NO_GAUGES, plates: PlateReading | None = None,
        extensions: Mapping[str, GaugeValue] | None = None,
    ) -> Measurement:  # fmt: skip
        """Compute the means, beside the values of ``gauges``; see ``region_strains``.

        ``force`` (N) is NaN where it is not known, ``measure_s`` (s) the time of the kernel.
        """
        step = replace(time_step_of(burst, field, force, measure_s, extensions), gauges=gauges)
        return cls(number, burst, field, step, plates)

    def with_lens(self, lens: LensReading | None) -> Measurement:
        """The same with what a corrected lens made."""
        if lens is None:
            return self
        step = replace(self.time_step, sigma_lens_exx=lens.sigma_exx, sigma_lens_eyy=lens.sigma_eyy)
        return replace(self, lens=lens, time_step=step)

    @property
    def t(self) -> float:
        """Time of the burst in monotonic seconds."""
        return self.burst.t

    @property
    def force(self) -> float:
        """Force at that time, N; NaN where no load is known (yet)."""
        return self.time_step.force

    def with_latency(self, latency_s: float) -> Measurement:
        """The same with its latency, from the stamp of the last frame."""
        return replace(self, time_step=replace(self.time_step, latency_s=latency_s))

    def with_force(self, force: float, raw: float = math.nan, zero: float = 0.0) -> Measurement:
        """The same with its force; ``raw`` as stamped, where a lag is corrected; ``zero`` by tares."""
        return replace(self, time_step=replace(self.time_step, force=force, force_raw=raw, zero=zero))


class ForceMatching:
    """Holds measurements until their force is final, so that files and curves agree with a replay.

    The force at a time is final when the load log reaches past it, or after ``hold_s`` of measured time.

    Parameters
    ----------
    loads : LoadLog
    hold_s : float, s
    """

    def __init__(self, loads: LoadLog, hold_s: float = HOLD_S) -> None:
        self._loads, self._hold_s = loads, hold_s
        self._held: deque[Measurement] = deque()

    def __len__(self) -> int:
        """Measurements that still wait."""
        return len(self._held)

    def add(self, measurement: Measurement) -> list[Measurement]:
        """Take one measurement; those whose force is final by now, in order, with it."""
        self._held.append(measurement)
        matched = []
        while self._held and self._is_final(self._held[0], measurement.t):
            matched.append(self._with_force(self._held.popleft()))
        return matched

    def flush(self) -> list[Measurement]:
        """All that still wait, with the force where it is known."""
        held, self._held = self._held, deque()
        return [self._with_force(measurement) for measurement in held]

    def _is_final(self, measurement: Measurement, newest_t: float) -> bool:
        return self._loads.covers(measurement.t) or newest_t - measurement.t > self._hold_s

    def _with_force(self, measurement: Measurement) -> Measurement:
        t = measurement.t
        return measurement.with_force(
            self._loads.force_at(t), self._loads.raw_force_at(t), self._loads.zero_at(t)
        )
