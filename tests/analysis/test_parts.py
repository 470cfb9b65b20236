"""ZOIs that move otherwise than all around them have no value, and a region that has come apart has no strain."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from acquire.events import Event
from analysis import Roi, Status, StrainField, ZoiGrid
from analysis.evaluate import COME_APART, AreaGauge, AreaStrain, ExtensionGauge
from analysis.field import Block, part_of
from analysis.follow.parts import coherent
from live.pipeline.guards import PartsGuard
from live.pipeline.measurement import TimeStep, region_strains
from tests.live.made_up import make_measurement

GRID = ZoiGrid.cover(Roi(0, 0, 400, 320), 32, 8)
X, Y = np.meshgrid(GRID.x - GRID.x.mean(), GRID.y - GRID.y.mean())
SIGMA_PX, SIGMA = 0.005, 5e-4
Map = NDArray[np.float64]


def field_of(seed: int = 1, status: NDArray[np.uint8] | None = None, **values: Map) -> StrainField:
    """A field with the noise of its sigmas."""
    rng = np.random.default_rng(seed)
    names = ("u", "v", "du_dx", "du_dy", "dv_dx", "dv_dy")
    sigmas = {name: SIGMA_PX if name in ("u", "v") else SIGMA for name in names}
    noisy = {n: values.get(n, 0 * X) + rng.normal(0, sigmas[n], X.shape) for n in names}
    return StrainField.from_values(GRID, noisy, sigmas, status)


def bent(k: float = 2e-5) -> dict[str, Map]:
    return {"u": -2 * k * X * Y, "v": k * X**2, "du_dx": -2 * k * Y, "du_dy": -2 * k * X, "dv_dx": 2 * k * X}


def broken(jump: float, rows: slice = np.s_[18:22], slope: float = 0.0) -> StrainField:
    """Two halves, the lower one ``jump`` px down, and ZOIs without a value between them."""
    status = np.zeros(X.shape, np.uint8)
    status[rows] = Status.POOR_MATCH
    below = np.indices(X.shape)[0] >= 20
    return field_of(status=status, v=jump * below + slope * Y, dv_dy=slope + 0 * X)


@pytest.mark.parametrize("at", [(0, 0), (0, 20), (15, 0), (20, 30), (17, 2)])
@pytest.mark.parametrize(("name", "jump"), [("u", 252.0), ("v", -3.5), ("v", 0.3)])
def test_a_zoi_that_was_found_elsewhere_has_no_value(at: tuple[int, int], name: str, jump: float) -> None:
    values = bent()
    values[name] = np.array(values[name])
    values[name][at] += jump
    field = coherent(field_of(**values))
    assert np.argwhere(~field.ok).tolist() == [list(at)]
    assert field.status[at] == Status.LOST and np.isnan(field.u[at]) and np.isnan(field.sigma_v[at])
    assert field.parts is None


def test_wrong_neighbours_do_not_pull() -> None:
    values = {"u": 0.01 * X, "du_dx": 0.01 + 0 * X}
    rng = np.random.default_rng(5)
    wrong = rng.random(X.shape) < 0.15
    values["u"] = values["u"] + wrong * rng.uniform(-250, 250, X.shape)
    field = coherent(field_of(**values))
    assert (field.ok & wrong).sum() == 0
    assert (~field.ok & ~wrong).sum() <= 2


def scattered(size: float, reach: int = 1) -> StrainField:
    """ZOIs side by side, one of 20 found elsewhere; errors of ``size`` px, alike in ``reach`` x ``reach`` ZOIs."""
    rng, grid = np.random.default_rng(8), ZoiGrid.cover(Roi(0, 0, 480, 480), 8, 8)
    error = np.kron(rng.normal(0, size, (60 // reach,) * 2), np.ones((reach, reach)))
    elsewhere = rng.uniform(50, 250, grid.shape) * (rng.random(grid.shape) < 0.05)
    found = rng.normal(0, SIGMA_PX, grid.shape) + error + elsewhere
    return coherent(StrainField.from_values(grid, {"u": found}, {"u": SIGMA_PX, "v": SIGMA_PX}))


def test_what_is_left_widens_the_uncertainty_of_means_where_many_stood_out() -> None:
    none, some, wide = (scattered(*case).mean("u")[1] for case in ((0,), (0.04,), (0.04, 3)))
    alone = math.hypot(SIGMA_PX, 0.04 / math.sqrt(2)) / SIGMA_PX  # v has no such error: half of the variance
    assert none == pytest.approx(SIGMA_PX / math.sqrt(3600 * 0.95), rel=0.02)
    assert some == pytest.approx(alone * none, rel=0.1)
    assert wide > 1.4 * some


def test_noise_bending_and_a_crack_between_zois_change_no_verdict() -> None:
    for values in ({}, bent(), {"v": 0.4 * (Y > 0)}):
        field = field_of(**values)
        assert coherent(field).ok.all()
        assert np.array_equal(coherent(field).v, field.v)


def test_halves_that_jump_have_come_apart_and_have_no_common_strain() -> None:
    field = coherent(broken(50.0))
    assert field.n_parts() == 2 and AreaStrain.of(field) is None
    found = region_strains(field)
    assert all(math.isnan(found[name]) for name in ("exx", "eyy", "exy", "sigma_eyy"))
    assert found["extension_y"] == pytest.approx(50 / (GRID.step * 33), rel=0.1)
    upper = np.indices(X.shape)[0] < 18
    half = AreaStrain.of(field, upper)
    assert half is not None and abs(half.value("eyy")) < 5 * half.sigma("eyy")


@pytest.mark.parametrize(
    ("share", "parts"), [(0.26, 2), (-0.3, 2), (2.0, 2), (0.24, 1), (-0.2, 1), (0.01, 1)]
)
def test_a_jump_of_a_quarter_of_a_zoi_parts_and_a_crack_does_not(share: float, parts: int) -> None:
    assert coherent(broken(share * GRID.size)).n_parts() == parts


@pytest.mark.parametrize("field", [
    broken(0.0), broken(0.0, slope=0.02), broken(0.02), broken(3 * 0.05 * 8, slope=0.05),
    field_of(**bent(1e-4)), broken(0.0, np.s_[10:30]),
])  # fmt: skip
def test_a_shaded_strip_bending_and_a_neck_do_not_come_apart(field: StrainField) -> None:
    assert coherent(field).parts is None


def test_a_gauge_within_a_part_has_its_strain_and_one_across_says_why_not() -> None:
    field = coherent(broken(50.0))
    within, across = AreaGauge("a", (40, 20, 300, 100)), AreaGauge("b", (40, 20, 300, 280))
    assert abs(within.measure(field).value) < 1e-3
    assert math.isnan(across.measure(field).value) and across.measure(field).reason == COME_APART
    assert ExtensionGauge("c", (40, 20, 300, 280)).measure(field).value > 0.1


def test_a_block_of_a_grid_is_whole_where_the_grid_is_not() -> None:
    field = coherent(broken(50.0))
    rows, columns = X.shape
    assert part_of(field, Block(slice(0, 18), slice(0, columns))).n_parts() == 1
    assert part_of(field, Block(slice(0, rows), slice(0, columns))).n_parts() == 2


def test_the_guard_says_once_that_it_is_apart_and_when_it_is_whole() -> None:
    events: list[Event] = []
    guard, whole = PartsGuard(events.append), make_measurement(number=1).time_step
    apart = replace(whole, n_parts=2)
    steps: list[TimeStep] = [whole, apart, apart, replace(apart, n_valid=0, n_parts=1), whole]
    for step in steps:
        guard.check(field_of(), step)
    assert [event.level for event in events] == ["warning", "info"]
    assert events[0].text.startswith(COME_APART)
