"""Grids, covariances and parts of fields by value."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.field import Block, Roi, Status, StrainField, ZoiGrid, area_share, part_of
from analysis.field.part import PartSums
from analysis.field.uncertainty import PAIR_INDEX, CommonError, stretched

GRID = ZoiGrid.cover(Roi(20, 40, 96, 64), 32, 16)  # 3 rows, 5 columns


@pytest.mark.parametrize(("missing", "active"), [(10, True), (11, False)])
def test_a_zoi_is_covered_by_99_percent_of_its_weight(missing: int, active: bool) -> None:
    """Of 1024 pixels that weigh alike."""
    mask = np.ones((32, 32), np.uint8)
    mask[5, :missing] = 0
    grid = ZoiGrid.cover(Roi(0, 0, 32, 32), 32, 32, mask, window="uniform")  # type: ignore[arg-type]
    assert grid.active[0, 0] == active
    assert grid.coverage(mask, "uniform")[0, 0] == pytest.approx(1 - missing / 1024)  # type: ignore[arg-type]


def test_the_coverage_is_the_weight_of_the_window_where_the_mask_is() -> None:
    mask = np.random.default_rng(2).random((110, 120)) < 0.7
    weight = GRID.weights() / GRID.weights().sum()
    expected = [
        [float((weight * mask[y : y + 32, x : x + 32]).sum()) for x in GRID.first_x] for y in GRID.first_y
    ]
    assert GRID.coverage(mask) == pytest.approx(np.array(expected), rel=1e-9)


def test_the_smallest_grids_and_what_does_not_fit() -> None:
    assert ZoiGrid.cover(Roi(0, 0, 9, 8), 3, 1).shape == (6, 7)
    for roi in (Roi(0, 0, 31, 99), Roi(0, 0, 99, 31)):
        with pytest.raises(ValueError, match="does not fit"):
            ZoiGrid.cover(roi, 32, 8)
    for shape in ((104, 115), (103, 116)):
        with pytest.raises(ValueError, match="does not reach over the region of interest 20,40,96,64"):
            GRID.coverage(np.ones(shape, bool))
    assert (GRID.coverage(np.ones((104, 116), bool)) > 0.999).all()
    with pytest.raises(ValueError, match="every must be at least 1, got 0"):
        GRID.subset(every=0)


def test_what_is_off_stays_off() -> None:
    every, some = GRID.subset(every=2), GRID.subset(active=np.indices(GRID.shape)[1] < 3)
    assert every.subset(active=some.active).n_active == some.subset(every=2).n_active == 4


def covariances() -> tuple[np.ndarray, np.ndarray]:
    """One matrix (6, 6), and it packed for a grid of one ZOI."""
    whole = np.cov(np.random.default_rng(0).normal(size=(6, 40)))
    packed = np.zeros((21, 1, 1), np.float32)
    for pair, k in PAIR_INDEX.items():
        packed[k] = whole[pair]
    return whole, packed


@pytest.mark.parametrize("place", [1, 2, 4, 5])
@pytest.mark.parametrize("size", [0.0101, -0.0101, 0.0099, -0.0099])
def test_covariances_go_with_a_stretch_beyond_one_percent(place: int, size: float) -> None:
    whole, packed = covariances()
    parameters = np.zeros((6, 1, 1))
    parameters[place], parameters[0] = size, 7.0
    found = stretched((packed, packed), parameters)
    if abs(size) < 0.01:
        assert found[0] is packed
        return
    du_dx, du_dy, dv_dx, dv_dy = parameters[[1, 2, 4, 5], 0, 0]
    turn = np.kron([[1 + du_dx, du_dy], [dv_dx, 1 + dv_dy]], np.eye(3))
    expected = turn @ whole @ turn.T
    for one in found:
        for pair, k in PAIR_INDEX.items():
            assert one[k, 0, 0] == pytest.approx(expected[pair], rel=1e-5, abs=1e-7)


def test_a_common_error_is_part_of_what_the_later_picture_adds() -> None:
    common = CommonError(np.full((1, 6, *GRID.shape), 2.0), np.array([[9e-6]]))
    field = replace(StrainField.from_values(GRID, {}, 4e-3), common=common)
    for part in ("all", "current"):
        assert field.sigma("u", part) == pytest.approx(np.hypot(4e-3, 6e-3))  # type: ignore[arg-type]
    assert field.sigma("u", "reference") == pytest.approx(replace(field, common=None).sigma("u", "reference"))
    assert field.mean("u")[1] == pytest.approx(np.hypot(replace(field, common=None).mean("u")[1], 6e-3))


@pytest.mark.parametrize(("lost", "share"), [((3, 3), 1 - 9 / 100), ((2, 4), 1.0)])
def test_nine_zois_side_by_side_are_a_block(lost: tuple[int, int], share: float) -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 160, 160), 16, 16)
    status = np.zeros(grid.shape, np.uint8)
    status[: lost[0], : lost[1]] = Status.LOST
    assert area_share(StrainField.from_values(grid, {}, status=status)) == pytest.approx(share)


@pytest.mark.parametrize(("lost", "share"), [(2, 1.0), (3, 0.9)])
def test_a_tenth_of_a_smaller_area_is_a_block(lost: int, share: float) -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 160, 160), 16, 16)
    status, area = np.zeros(grid.shape, np.uint8), np.indices(grid.shape)[0] < 3
    status[1, :lost], status[5:, :] = Status.LOST, Status.LOST
    assert area_share(StrainField.from_values(grid, {}, status=status), area) == pytest.approx(share)


class Whole:
    """The sums of a whole grid that give back what they are asked."""

    def factor(self, name: str, where: np.ndarray) -> float:
        return float(np.flatnonzero(where).sum()) if name == "exx" else 0.0

    def information(self, at: np.ndarray) -> Any:
        return at

    unit_variances = information

    def variance(self, at: np.ndarray, weights: np.ndarray) -> float:
        return float(at @ weights)

    def kept(self, key: Hashable, make: Callable[[], Any]) -> Any:
        return key, make()


def test_the_sums_of_a_part_are_those_of_its_places_on_the_whole_grid() -> None:
    """Rows 1 and 2, columns 2 to 4 of 5: places 7, 8, 9 and 12, 13, 14."""
    block = Block(slice(1, 3), slice(2, 5))
    part = part_of(replace(StrainField.from_values(GRID, {}), sums=Whole()), block).sums
    assert isinstance(part, PartSums)
    where = np.array([[True, False, False], [False, False, True]])
    assert part.factor("exx", where) == 7 + 14
    at = np.array([0, 2, 3])
    assert list(part.information(at)) == list(part.unit_variances(at)) == [7, 9, 12]
    assert part.variance(at, np.array([1.0, 10.0, 100.0])) == 7 + 90 + 1200
    assert part.kept("key", lambda: 5) == ((1, 3, 2, 5, "key"), 5)


def test_the_pattern_of_a_gauge_counts_where_it_is_active() -> None:
    """Places 7, 8 and 9 of row 1, and 12 to 14 of row 2; ``Whole`` has their sum as the factor."""
    grid = GRID.subset(active=np.isin(np.arange(15).reshape(GRID.shape), (7, 8, 9, 12, 13, 14)))
    plain = StrainField.from_values(grid, {}, 1e-3)
    field = replace(plain, sums=Whole())
    for where, factor in ((None, 63), (np.indices(GRID.shape)[0] < 2, 24)):
        assert field.mean("exx", where)[1] == pytest.approx(factor * plain.mean("exx", where)[1])


def test_zois_of_a_part_that_are_off_have_no_value() -> None:
    block = Block(slice(1, 3), slice(2, 5))
    own = block.of(GRID)
    assert own.roi == Roi(20 + 32, 40 + 16, 64, 48) and own.shape == (2, 3)
    common = CommonError(np.arange(6.0 * 15).reshape(1, 6, *GRID.shape), np.eye(1))
    field = replace(
        StrainField.from_values(GRID, {"u": np.arange(15.0).reshape(GRID.shape)}, 1e-3),
        blur=np.ones((2, *GRID.shape), np.float32),
        common=common,
    )
    off = own.subset(active=np.array([[True, True, False], [True, True, True]]))
    part = part_of(field, block, off)
    assert part.blur is not None and part.common is not None
    assert np.array_equal(part.common.variance("u"), common.variance("u")[1:3, 2:5])
    for values in (part.u, part.sigma_u, part.residual, part.blur[0], part.blur[1]):
        assert np.array_equal(np.isfinite(values), off.active)
    assert np.array_equal(part_of(field, block).u, [[7, 8, 9], [12, 13, 14]])
    assert part.status[0, 2] == Status.NOT_MEASURED and part.n_valid == 5 and part.refused == {}
