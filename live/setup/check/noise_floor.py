"""The strain noise of one ZOI, predicted and measured on the still specimen, for several ZOIs and bursts.

One half of the frames is the reference, as in the test; bursts from the other half are measured against
it. What comes out is noise: the scatter over ZOIs is *measured*, the kernel's own uncertainty *predicted*.
From too few frames it is predicted alone.

The strain noise of every ZOI and gauge of the test, predicted from one half of the frames against the other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from acquire.frame import Burst
from analysis.field import StrainField
from analysis.picture.pattern import gauge_length, l10_strain
from live.config.gauges import gauges_for
from live.pipeline.reference import averaged, prepare
from live.setup.check.sample import CheckSample
from live.setup.placement import with_auto_gauges

if TYPE_CHECKING:
    from analysis import PhaseKernel, StrainField, ZoiGrid
    from live.config.loading import Config

SIZES, ORDERS, BURSTS = (32, 48, 64, 96), (1, 2), (1, 2, 4, 8, 16)
MOST_BURSTS, MOST_ZOIS, FEWEST_ZOIS = 4, 200, 3


@dataclass(frozen=True, slots=True)
class StrainNoise:
    """Strain noise of one ZOI of a burst of ``burst`` frames, dimensionless; NaN: not measured."""

    burst: int
    predicted: float
    measured: float

    @property
    def known(self) -> float:
        """As measured, else as predicted."""
        return self.measured if math.isfinite(self.measured) else self.predicted


@dataclass(frozen=True, slots=True)
class ZoiFloor:
    """One size and order of ZOIs.

    Attributes
    ----------
    zoi : int, px
    order : int
    l10, vsg : float, px
        l_10% of the strain; side of the virtual strain gauge.
    zois : int
        ZOIs that were measured; 0: none fits, or none has pattern.
    noises : tuple of StrainNoise
        By growing burst; empty where ``zois`` is 0.
    reference : int
        Frames of the reference that the figures hold for.
    """

    zoi: int
    order: int
    l10: float
    vsg: float
    zois: int
    noises: tuple[StrainNoise, ...]
    reference: int

    def of(self, burst: int) -> StrainNoise | None:
        """The noise for a burst."""
        return next((noise for noise in self.noises if noise.burst == burst), None)


def noise_floors(
    bench: CheckSample,
    sizes: Sequence[int] = SIZES,
    orders: Sequence[int] = ORDERS,
    bursts: Sequence[int] = BURSTS,
) -> tuple[ZoiFloor, ...]:
    """The table, by size and order."""
    lengths = sorted(set(bursts))
    bench_bursts = {n: list(_bursts(bench, n)) for n in lengths}
    reference = bench.mean(0, bench.half)
    return tuple(
        _floor(bench, size, order, reference, bench_bursts)
        for size in sorted(set(sizes))
        for order in sorted(set(orders))
        if not (order > 1 and bench.settings.estimator == "phase")
    )


def _bursts(bench: CheckSample, n: int) -> Iterator[Burst]:
    """Bursts of n frames from the second half, from its whole length; of too few frames the first alone."""
    if bench.shots.few:
        yield from [bench.mean(0, 1)] if n == 1 else []
        return
    room = len(bench.shots) - bench.half
    count = min(room // n, MOST_BURSTS)
    for k in range(count):
        yield bench.mean(bench.half + k * (room // count), n)


def _floor(
    bench: CheckSample, size: int, order: int, reference: Burst, bursts: dict[int, list[Burst]]
) -> ZoiFloor:
    window = bench.settings.window
    lengths = l10_strain(size, window), gauge_length(size, window)
    nothing = ZoiFloor(size, order, *lengths, 0, (), bench.reference)
    grid = _grid(bench, size)
    if grid is None:
        return nothing
    settings = replace(bench.settings, order=order)
    try:
        kernel, _ = prepare(reference, grid, settings, bench.noise)
    except DataError:
        return nothing
    start: StrainField | None = None
    noises, zois = [], 0
    for n, taken in bursts.items():
        fields = [_measured(kernel, burst, bench.noise, start) for burst in taken]
        start = fields[-1] if fields else start
        zois = max([zois, *(field.n_valid for field in fields)])
        noises.append(_noise(fields, n, bench))
    known = tuple(_filled(noises, bench))
    return replace(nothing, zois=zois, noises=known) if zois >= FEWEST_ZOIS else nothing


def _measured(kernel: PhaseKernel, burst: Burst, noise: float, start: StrainField | None) -> StrainField:
    return kernel.measure(burst.mean, start=start, noise=averaged(noise, burst.n))


def _grid(bench: CheckSample, size: int) -> ZoiGrid | None:
    """ZOIs all over the region, half overlapping at most, not more than are needed."""
    from analysis import Roi, ZoiGrid

    inside = bench.ground.inside
    y, x = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    roi = Roi(int(x[0]), int(y[0]), int(x[-1] - x[0]) + 1, int(y[-1] - y[0]) + 1)
    if min(roi.width, roi.height) < size:
        return None
    step = size // 2
    grid = ZoiGrid.cover(roi, size, step, mask=inside)
    if grid.n_active > MOST_ZOIS:
        step = math.ceil(step * math.sqrt(grid.n_active / MOST_ZOIS))
        grid = ZoiGrid.cover(roi, size, step, mask=inside)
    return grid if grid.n_active >= FEWEST_ZOIS else None


def _noise(fields: list[StrainField], n: int, bench: CheckSample) -> StrainNoise:
    """Predicted and, from frames enough, measured; brought to the reference of the test."""
    useful = [field for field in fields if field.n_valid >= FEWEST_ZOIS]
    if not useful:
        return StrainNoise(n, math.nan, math.nan)
    scale = math.sqrt(_share(bench.reference, n) / _share(bench.half, n))
    predicted = _rms([field.sigma(name)[field.ok] for field in useful for name in ("exx", "eyy")])
    measured = math.nan
    if not bench.shots.few:
        measured = math.sqrt(float(np.mean([_scatter(f, name) for f in useful for name in ("exx", "eyy")])))
    return StrainNoise(n, scale * predicted, scale * measured)


def _share(reference: int, burst: int) -> float:
    return 1 / reference + 1 / burst


def _scatter(field: StrainField, name: str) -> float:
    """Variance over ZOIs about their mean, and the variance that the mean itself takes away."""
    values = field.value(name)[field.ok]
    return float(values.var()) + field.mean(name)[1] ** 2


def _rms(parts: list[NDArray[Any]]) -> float:
    return math.sqrt(float(np.mean(np.concatenate(parts) ** 2)))


def _filled(noises: list[StrainNoise], bench: CheckSample) -> Iterator[StrainNoise]:
    """Bursts longer than the half that is there are predicted from the longest that was measured."""
    seen: StrainNoise | None = None
    for noise in noises:
        if math.isfinite(noise.predicted):
            seen = noise
            yield noise
        elif seen is not None:
            ratio = _share(bench.reference, noise.burst) / _share(bench.reference, seen.burst)
            yield StrainNoise(noise.burst, seen.predicted * math.sqrt(ratio), math.nan)


Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class GaugeNoise:
    """Predicted strain noise of a gauge for one burst of the test; NaN with the reason."""

    name: str
    sigma: float
    reason: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Predicted:
    """For a burst of the test.

    Attributes
    ----------
    sigma : (R, C) float64
        Of each ZOI, exx and eyy in the mean; NaN without pattern.
    gauges : tuple of GaugeNoise
        Those of the test, and the mean of all ZOIs along the load; empty without pattern.
    """

    sigma: Floats
    gauges: tuple[GaugeNoise, ...]

    @property
    def able(self) -> NDArray[np.bool_]:
        """(R, C): which ZOIs can be measured."""
        return np.isfinite(self.sigma)


def predicted(bench: CheckSample) -> Predicted:
    """Predict it."""
    grid = bench.ground.grid
    field = _half_on_half(bench)
    if field is None:
        return Predicted(np.full(grid.shape, np.nan), ())
    factor = math.sqrt((1 / bench.reference + 1 / bench.burst) / (2 / bench.half))
    both = np.sqrt((field.sigma_exx**2 + field.sigma_eyy**2) / 2)
    sigma = np.where(field.ok, factor * both, np.nan)
    return Predicted(sigma, tuple(_gauges(bench.ground.config, replace(field, grid=grid), factor)))


def _half_on_half(bench: CheckSample) -> StrainField | None:
    """The second half of the frames against the first; None where there is no pattern."""
    first, second = bench.halves()
    try:
        kernel, _ = prepare(first, bench.ground.zois, bench.settings, bench.noise)
    except DataError:
        return None
    # What stands still is where it was; only what is not found there is searched for.
    still = StrainField.from_values(kernel.grid, {})
    return kernel.measure(second.mean, start=still, noise=averaged(bench.noise, bench.half))


def _gauges(config: Config, field: StrainField, factor: float) -> Iterator[GaugeNoise]:

    if not field.n_valid:
        return
    along = "exx" if config.specimen.first_axis == "x" else "eyy"
    yield GaugeNoise("", factor * field.mean(along)[1])
    config = with_auto_gauges(config, field.grid)
    for gauge in gauges_for(config.gauges, config.specimen.first_axis, field.grid):
        value = gauge.measure(field)
        yield GaugeNoise(gauge.name, factor * value.sigma, value.reason)
