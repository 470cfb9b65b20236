"""The strain noise of every ZOI and gauge of the test, predicted from one half of the frames against the other."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from acquire.errors import DataError
from analysis.field import StrainField
from live.check.ground import Bench
from live.measure import averaged, prepare
from live.setup import gauges_for
from live.specimen import with_auto_gauges

if TYPE_CHECKING:
    from live.setup import Config

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


def predicted(bench: Bench) -> Predicted:
    """Predict it."""
    grid = bench.ground.grid
    field = _half_on_half(bench)
    if field is None:
        return Predicted(np.full(grid.shape, np.nan), ())
    factor = math.sqrt((1 / bench.reference + 1 / bench.burst) / (2 / bench.half))
    both = np.sqrt((field.sigma_exx**2 + field.sigma_eyy**2) / 2)
    sigma = np.where(field.ok, factor * both, np.nan)
    return Predicted(sigma, tuple(_gauges(bench.ground.config, replace(field, grid=grid), factor)))


def _half_on_half(bench: Bench) -> StrainField | None:
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
