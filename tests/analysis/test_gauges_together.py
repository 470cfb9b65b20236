"""All gauges of a field in one pass: the same as each of them alone, whatever was lost and whatever was corrected."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from analysis import KernelSettings, PhaseKernel, Roi, Status, StrainField, ZoiGrid
from analysis.evaluate import GAUGE_KINDS, AreaGauge, Gauge, GaugeSet, GaugeValue, TransverseGauge
from analysis.field import VALUES, Block, CommonError, part_of
from tests.accuracy.truth import Speckle, affine, digitise
from tests.analysis.gauges_alone import alone

GRID = ZoiGrid.cover(Roi(8, 8, 256, 160), 32, 8)
PATTERN, SHAPE = Speckle(2.0, 1, span=400), (176, 272)
PLACES = [((30.0, 30.0), (120.0, 100.0)), ((120.0, 40.0), (240.0, 150.0))]
DRAWN = [
    kind.of(f"{kind.kind} {axis} {k}", kind.from_handles(place), axis)
    for kind in GAUGE_KINDS.values()
    for axis in "xy"
    for k, place in enumerate(PLACES)
]
BOX = (100.0, 30.0, 110.0, 90.0)
GAUGES: list[Gauge] = [
    *DRAWN,
    *(AreaGauge(f"{how} {name}", BOX, value=name, statistic=how) for name in VALUES  # type: ignore[arg-type]
      for how in ("affine", "mean", "largest", "smallest")),
    TransverseGauge("whole", (0.0, 0.0, 272.0, 176.0), "y"),
    AreaGauge("beside", (900.0, 0.0, 9.0, 9.0)),
]  # fmt: skip


def measured(u: float, order: int = 1, seed: int = 2) -> StrainField:
    rng, settings = np.random.default_rng(seed), KernelSettings(order=order)  # type: ignore[arg-type]
    before, after = (
        digitise(PATTERN.at(*affine(SHAPE, u=at, dv_dy=2e-3 * at, du_dy=1e-3)), 12, 0.01, rng)
        for at in (0.0, u)
    )
    return PhaseKernel(before, GRID, settings, noise=41.0).measure(after, noise=41.0)


def without(field: StrainField, lost: np.ndarray, status: Status = Status.LOST) -> StrainField:
    parameters, covariance = np.array(field.parameters), np.array(field.covariance)
    parameters[:, lost], covariance[:, lost] = np.nan, np.nan
    statuses = np.where(lost, np.uint8(status), field.status)
    return replace(field, parameters=parameters, covariance=covariance, status=statuses)


def compare(together: dict[str, GaugeValue], field: StrainField) -> int:
    """How many have a value."""
    for gauge in GAUGES:
        found, wanted = together[gauge.name], alone(gauge, field)
        values = found.value, found.sigma, found.share
        assert values == pytest.approx(wanted, rel=1e-12, abs=1e-15, nan_ok=True), gauge.name
        assert math.isnan(found.value) == bool(found.reason), gauge.name
    return sum(not one.reason for one in together.values())


@pytest.fixture(scope="module")
def plain() -> StrainField:
    return measured(0.7)


@pytest.mark.parametrize("order", [1, 2])
def test_each_is_read_as_alone(order: int) -> None:
    field = measured(0.7, order)
    assert compare(GaugeSet(GAUGES).read(field), field) == len(GAUGES) - 1


def test_whichever_zois_are_lost(plain: StrainField) -> None:
    """The same set reads fields with single ZOIs, a block, an end and all of them lost, and with all of them again."""
    together, rng = GaugeSet(GAUGES), np.random.default_rng(3)
    rows, columns = np.indices(GRID.shape)
    some = [rng.random(GRID.shape) < share for share in (0.02, 0.02, 0.3, 0.6)]
    blocks = [(rows < 4) & (columns < 9), columns > 14, np.ones(GRID.shape, bool), np.zeros(GRID.shape, bool)]
    valid = []
    for lost in (*some, *blocks):
        field = without(plain, lost)
        valid.append(compare(together.read(field), field))
    assert valid[-2:] == [0, len(GAUGES) - 1] and 0 < valid[3] < valid[0]
    patternless = without(plain, blocks[0], Status.NO_PATTERN)
    compare(together.read(patternless), patternless)


def test_against_another_reference_on_another_grid_and_part(plain: StrainField) -> None:
    together, renewed = GaugeSet(GAUGES), measured(0.4, seed=9)
    masked = GRID.subset(active=np.indices(GRID.shape)[1] > 3)
    block = Block(slice(2, 17), slice(1, 25))
    fields = [
        plain,
        renewed,
        part_of(plain, Block(slice(0, 17), slice(0, 29)), masked),
        part_of(renewed, block),
    ]
    for field in [*fields, part_of(plain, block), plain]:
        compare(together.read(field), field)


@pytest.mark.parametrize("measure", ["engineering", "green", "hencky"])
def test_in_every_measure_of_strain(plain: StrainField, measure: str) -> None:
    field = replace(plain, measure=measure)  # type: ignore[arg-type]
    compare(GaugeSet(GAUGES).read(field), field)


def test_with_an_error_that_all_zois_have(plain: StrainField) -> None:
    shapes = np.random.default_rng(5).normal(0, 1, (3, 6, *GRID.shape))
    common = CommonError(shapes, np.diag([1e-6, 4e-6, 1e-7]))
    together = GaugeSet(GAUGES)
    for covariance in (common.covariance, 4 * common.covariance):
        field = replace(plain, common=replace(common, covariance=covariance))
        compare(together.read(field), field)
    assert together.read(field)["affine exx"].sigma > 1.5 * GaugeSet(GAUGES).read(plain)["affine exx"].sigma


def test_a_region_that_has_come_apart(plain: StrainField) -> None:
    """Across the middle of a gauge, and beside it; and put together again."""
    rows, together = np.indices(GRID.shape)[0], GaugeSet(GAUGES)
    area = next(one for one in GAUGES if one.name == "affine eyy").zois(GRID)[0]
    middle = int(np.mean(np.flatnonzero(area.any(axis=1))))
    for row, apart in ((middle, True), (0, False)):
        field = replace(plain, parts=np.where(rows > row, 2, 1).astype(np.uint8))
        found = together.read(field)
        assert (found["affine eyy"].reason == "the region has come apart") is apart
        assert not found["mean eyy"].reason and not found["whole"].reason
    compare(together.read(plain), plain)


def test_no_gauge_is_no_value(plain: StrainField) -> None:
    assert GaugeSet(()).read(plain) == {}
