"""The strain noise on the still specimen: a table over sizes, orders and bursts, and that of each ZOI and gauge.

One half of the frames is the reference, as in the test; bursts of the other half are measured against it. The result
is noise: the scatter over ZOIs is *measured*, the uncertainty of the kernel *predicted*. Too few frames give the
prediction only.
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
from analysis.evaluate import AreaStrain, GaugeSet
from analysis.field import StrainField
from analysis.picture.pattern import gauge_length, l10_strain
from live.config.gauges import gauges_for, partly
from live.pipeline.guards import picture_words
from live.pipeline.reference import averaged, prepare, repetition_text
from live.setup.check.sample import CheckSample
from live.setup.grid import with_auto_gauges

if TYPE_CHECKING:
    from analysis import PhaseKernel, ZoiGrid
    from live.config.loading import Config

SIZES, ORDERS, BURSTS = (32, 48, 64, 96), (1, 2), (1, 2, 4, 8, 16)
MAX_BURSTS, MAX_ZOIS, MIN_ZOIS = 4, 200, 3


@dataclass(frozen=True, slots=True)
class StrainNoise:
    """Strain noise of one ZOI of a burst of ``burst`` frames, dimensionless; NaN: not measured."""

    burst: int
    predicted: float
    measured: float

    @property
    def known(self) -> float:
        """The measured noise, else the predicted one."""
        return self.measured if math.isfinite(self.measured) else self.predicted


@dataclass(frozen=True, slots=True)
class ZoiFloor:
    """The noise of one size and order of ZOIs.

    Attributes
    ----------
    zoi : int, px
    order : int
    l10, vsg : float, px
        l_10% of the strain; side of the virtual strain gauge.
    zois : int
        Number of measured ZOIs; 0: none fits, or none has pattern.
    noises : tuple of StrainNoise
        Ordered by burst; empty if ``zois`` is 0.
    reference : int
        Frames of the reference for which the figures hold.
    """

    zoi: int
    order: int
    l10: float
    vsg: float
    zois: int
    noises: tuple[StrainNoise, ...]
    reference: int

    def of(self, burst: int) -> StrainNoise | None:
        """The noise for a burst; None if it is not in the table."""
        return next((noise for noise in self.noises if noise.burst == burst), None)


def noise_floors(
    sample: CheckSample,
    sizes: Sequence[int] = SIZES,
    orders: Sequence[int] = ORDERS,
    bursts: Sequence[int] = BURSTS,
) -> tuple[ZoiFloor, ...]:
    """The table, ordered by size and order."""
    lengths = sorted(set(bursts))
    taken = {n: list(_bursts(sample, n)) for n in lengths}
    reference = sample.mean(0, sample.half)
    return tuple(
        _floor(sample, size, order, reference, taken)
        for size in sorted(set(sizes))
        for order in sorted(set(orders))
        if not (order > 1 and sample.settings.estimator == "phase")
    )


def _bursts(sample: CheckSample, n: int) -> Iterator[Burst]:
    """Bursts of n frames, spread over the second half; of too few frames only the first."""
    if sample.stack.few:
        yield from [sample.mean(0, 1)] if n == 1 else []
        return
    available = len(sample.stack) - sample.half
    count = min(available // n, MAX_BURSTS)
    for k in range(count):
        yield sample.mean(sample.half + k * (available // count), n)


def _floor(
    sample: CheckSample, size: int, order: int, reference: Burst, bursts: dict[int, list[Burst]]
) -> ZoiFloor:
    window = sample.settings.window
    lengths = l10_strain(size, window), gauge_length(size, window)
    nothing = ZoiFloor(size, order, *lengths, 0, (), sample.reference)
    grid = _grid(sample, size)
    if grid is None:
        return nothing
    settings = replace(sample.settings, order=order)
    try:
        kernel, _ = prepare(reference, grid, settings, sample.noise)
    except DataError:
        return nothing
    start: StrainField | None = None
    noises, zois = [], 0
    for n, taken in bursts.items():
        fields = [_measured(kernel, burst, sample.noise, start) for burst in taken]
        start = fields[-1] if fields else start
        zois = max([zois, *(field.n_valid for field in fields)])
        noises.append(_noise(fields, n, sample))
    known = tuple(_filled(noises, sample))
    return replace(nothing, zois=zois, noises=known) if zois >= MIN_ZOIS else nothing


def _measured(kernel: PhaseKernel, burst: Burst, noise: float, start: StrainField | None) -> StrainField:
    return kernel.measure(burst.mean, start=start, noise=averaged(noise, burst.n))


def _grid(sample: CheckSample, size: int) -> ZoiGrid | None:
    """ZOIs all over the region, at most half overlapping, at most some MAX_ZOIS."""
    from analysis import Roi, ZoiGrid

    inside = sample.check_region.inside
    y, x = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    roi = Roi(int(x[0]), int(y[0]), int(x[-1] - x[0]) + 1, int(y[-1] - y[0]) + 1)
    if min(roi.width, roi.height) < size:
        return None
    step = size // 2
    grid = ZoiGrid.cover(roi, size, step, mask=inside)
    if grid.n_active > MAX_ZOIS:
        step = math.ceil(step * math.sqrt(grid.n_active / MAX_ZOIS))
        grid = ZoiGrid.cover(roi, size, step, mask=inside)
    return grid if grid.n_active >= MIN_ZOIS else None


def _noise(fields: list[StrainField], n: int, sample: CheckSample) -> StrainNoise:
    """Predicted and, from enough frames, measured noise, scaled to the reference of the test."""
    useful = [field for field in fields if field.n_valid >= MIN_ZOIS]
    if not useful:
        return StrainNoise(n, math.nan, math.nan)
    scale = math.sqrt(_share(sample.reference, n) / _share(sample.half, n))
    predicted = _rms([field.sigma(name)[field.ok] for field in useful for name in ("exx", "eyy")])
    measured = math.nan
    if not sample.stack.few:
        measured = math.sqrt(float(np.mean([_scatter(f, name) for f in useful for name in ("exx", "eyy")])))
    return StrainNoise(n, scale * predicted, scale * measured)


def _share(reference: int, burst: int) -> float:
    return 1 / reference + 1 / burst


def _scatter(field: StrainField, name: str) -> float:
    """Variance over the ZOIs: about their mean, plus the variance of that mean."""
    values = field.value(name)[field.ok]
    return float(values.var()) + field.mean(name)[1] ** 2


def _rms(parts: list[NDArray[Any]]) -> float:
    return math.sqrt(float(np.mean(np.concatenate(parts) ** 2)))


def _filled(noises: list[StrainNoise], sample: CheckSample) -> Iterator[StrainNoise]:
    """Bursts longer than the available half, predicted from the longest measured one."""
    longest: StrainNoise | None = None
    for noise in noises:
        if math.isfinite(noise.predicted):
            longest = noise
            yield noise
        elif longest is not None:
            ratio = _share(sample.reference, noise.burst) / _share(sample.reference, longest.burst)
            yield StrainNoise(noise.burst, longest.predicted * math.sqrt(ratio), math.nan)


@dataclass(frozen=True, slots=True)
class GaugeNoise:
    """Predicted strain noise of a gauge for one burst; NaN with the reason. ``part``: what lies off the region."""

    name: str
    sigma: float
    reason: str = ""
    part: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class PredictedNoise:
    """The predicted strain noise for one burst of the test.

    Attributes
    ----------
    sigma : (R, C) float64
        Of each ZOI, mean of exx and eyy; NaN without pattern.
    gauges : tuple of GaugeNoise
        The gauges of the test, and the mean of all ZOIs along the load; empty without pattern.
    picture : str
        What the picture shows beyond its noise, in words; "": nothing.
    repetition : str
        What repeats in the pattern, and what that allows; empty where nothing does.
    """

    sigma: NDArray[np.float64]
    gauges: tuple[GaugeNoise, ...]
    picture: str = ""
    repetition: str = ""

    @property
    def measurable(self) -> NDArray[np.bool_]:
        """(R, C): the ZOIs that can be measured."""
        return np.isfinite(self.sigma)


def predict_noise(sample: CheckSample) -> PredictedNoise:
    """Predict the strain noise of each ZOI and gauge of the test."""
    grid = sample.check_region.grid
    field, repetition = _half_on_half(sample)
    if field is None:
        return PredictedNoise(np.full(grid.shape, np.nan), ())
    factor = math.sqrt((1 / sample.reference + 1 / sample.burst) / (2 / sample.half))
    both = np.sqrt((field.sigma_exx**2 + field.sigma_eyy**2) / 2)
    sigma = np.where(field.ok, factor * both, np.nan)
    return PredictedNoise(
        sigma,
        tuple(_gauges(sample.check_region.config, replace(field, grid=grid), factor)),
        picture_words(field),
        repetition,
    )


def _half_on_half(sample: CheckSample) -> tuple[StrainField | None, str]:
    """The second half of the frames against the first, None without pattern; and what repeats in the pattern."""
    first, second = sample.halves()
    try:
        kernel, _ = prepare(first, sample.check_region.zois, sample.settings, sample.noise)
    except DataError:
        return None, ""
    # The specimen stands still: the fit begins at zero motion, and only failed ZOIs are searched.
    still = StrainField.from_values(kernel.grid, {})
    field = kernel.measure(second.mean, start=still, noise=averaged(sample.noise, sample.half))
    return field, repetition_text(kernel.period)


def _gauges(config: Config, field: StrainField, factor: float) -> Iterator[GaugeNoise]:
    if not field.n_valid:
        return
    along = "exx" if config.specimen.first_axis == "x" else "eyy"
    region = AreaStrain.of(field)
    yield GaugeNoise("", factor * (math.nan if region is None else region.sigma(along)))
    config = with_auto_gauges(config, field.grid)
    gauges = gauges_for(config.gauges, config.specimen.first_axis, field.grid)
    for gauge, value in zip(gauges, GaugeSet(gauges).read(field).values(), strict=True):
        part = partly(gauge, field.grid)
        yield GaugeNoise(gauge.name, factor * value.sigma, value.reason, part)
