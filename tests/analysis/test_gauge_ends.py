"""Which ZOIs are the ends of a gauge, and its value and sigma where they are not alike."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest

from analysis.evaluate import (
    AreaGauge,
    CircleGauge,
    ExtensionGauge,
    GaugeSet,
    GaugeValue,
    LineGauge,
    RegionStrips,
    StripGauge,
    TransverseGauge,
    ZoiGauge,
    distance,
    facing,
    inside_polygon,
)
from analysis.evaluate.gauges.readings import MIN_SHARE
from analysis.field import PAIR_INDEX, CommonError, Roi, Status, StrainField, ZoiGrid

GRID = ZoiGrid.cover(
    Roi(0, 0, 32 + 16 * 10, 32 + 16 * 11), 32, 16
)  # 12 rows, 11 columns; centres 15.5 + 16 k
SHEARED = {"du_dx": -3e-4, "du_dy": 5e-3, "dv_dx": 5e-3, "dv_dy": 1e-3}
Axis = Literal["x", "y"]


def field(grid: ZoiGrid = GRID, status: np.ndarray | None = None) -> StrainField:
    x, y = np.meshgrid(grid.x, grid.y)
    g = SHEARED
    values = {"u": g["du_dx"] * x + g["du_dy"] * y, "v": g["dv_dx"] * x + g["dv_dy"] * y, **g}
    return StrainField.from_values(grid, values, 1e-2, status)


def extension_of(found: StrainField, along: Axis) -> GaugeValue:
    (value,) = GaugeSet([RegionStrips(along)]).read(found).values()
    return value


def zois_of(grid: ZoiGrid, along: Axis) -> tuple[np.ndarray, ...]:
    return RegionStrips(along).zois(grid)


def along_line(direction: tuple[float, float]) -> float:
    """The strain of the sheared field along a direction."""
    way = np.array(direction) / math.hypot(*direction)
    gradient = np.array([[SHEARED["du_dx"], SHEARED["du_dy"]], [SHEARED["dv_dx"], SHEARED["dv_dy"]]])
    return float(np.linalg.norm(way + gradient @ way)) - 1


def test_a_corner_on_the_height_of_a_point_counts_once() -> None:
    corners = ((0.0, -2.0), (2.0, 0.0), (0.0, 2.0), (-2.0, 0.0))
    x = np.array([-3.0, -1.9, 0.0, 1.9, 3.0])
    assert inside_polygon(x, np.zeros(5), corners).tolist() == [False, True, True, True, False]
    assert inside_polygon(np.zeros(3), np.array([-2.5, 1.5, 2.5]), corners).tolist() == [False, True, False]


@pytest.mark.parametrize("along", ["x", "y"])
def test_the_strips_of_a_grid_are_the_sixths_of_what_is_active(along: Axis) -> None:
    """Two of twelve rows and of eleven columns; one of the eight and the seven within a border that is off."""
    k = "yx".index(along)
    count, of = GRID.shape[k], np.indices(GRID.shape)[k]
    first, last = zois_of(GRID, along)
    assert np.array_equal(first, of < 2) and np.array_equal(last, of >= count - 2)
    first, last = zois_of(GRID.subset(active=(of >= 2) & (of < count - 2)), along)
    assert np.array_equal(first, of == 2) and np.array_equal(last, of == count - 3)
    nothing = zois_of(GRID.subset(active=np.zeros(GRID.shape, bool)), along)
    assert not any(end.any() for end in nothing)


@pytest.mark.parametrize("along", ["x", "y"])
def test_an_end_that_lost_one_side_is_read_where_both_have_values(along: Axis) -> None:
    """In a sheared field a line that leans would show another strain."""
    status = np.zeros(GRID.shape, int)
    strip = zois_of(GRID, along)[0]
    across = np.indices(GRID.shape)["xy".index(along)]
    status[strip & (across < 5)] = Status.LOST
    found = extension_of(field(status=status), along)
    straight = (1.0, 0.0) if along == "x" else (0.0, 1.0)
    assert found.value == pytest.approx(along_line(straight), rel=1e-9)
    status[strip & (across < 8)] = Status.LOST
    assert extension_of(field(status=status), along).reason.startswith("end 1: ")


def test_ends_that_have_values_beside_each_other_alone_have_no_line() -> None:
    """Of twelve rows the first end has the lower six left, the other one the upper six."""
    rows, status = np.indices(GRID.shape)[0], np.zeros(GRID.shape, int)
    for end, lost in zip(zois_of(GRID, "x"), (rows < 6, rows >= 6), strict=True):
        status[end & lost] = Status.LOST
    found = extension_of(field(status=status), "x")
    assert found.reason == "the ZOIs with a value at its two ends do not face each other"


def test_strips_that_hardly_face_each_other_are_read_whole() -> None:
    """A specimen that leans: its upper end is left of its lower one."""
    rows, columns = np.indices(GRID.shape)
    leaning = GRID.subset(active=np.abs(columns - rows * 0.8) < 2.1)
    first, last = zois_of(leaning, "y")
    assert facing([first, last], "y") is None
    x, y = np.meshgrid(GRID.x, GRID.y)
    direction = (x[last].mean() - x[first].mean(), y[last].mean() - y[first].mean())
    assert extension_of(field(leaning), "y").value == pytest.approx(along_line(direction), rel=1e-9)


@pytest.mark.parametrize("along", ["x", "y"])
def test_strips_face_each_other_by_half_of_the_shorter_one(along: str) -> None:
    def strip(row: int, *columns: int) -> np.ndarray:
        mask = np.zeros((3, 12), bool)
        mask[row, columns[0] : columns[1]] = True
        return mask if along == "y" else mask.T

    found = facing([strip(0, 0, 4), strip(2, 2, 12)], along)
    assert found is not None
    assert np.array_equal(found[0], strip(0, 2, 4)) and np.array_equal(found[1], strip(2, 2, 4))
    assert facing([strip(0, 0, 4), strip(2, 3, 12)], along) is None
    assert MIN_SHARE == 0.5


@pytest.mark.parametrize("along", ["x", "y"])
def test_an_end_is_a_step_wide_at_least(along: Axis) -> None:
    """A sixth of 60 px would lie between the centres at 15.5 and 31.5, and at 63.5 and 79.5."""
    box = (16.5, 0.0, 60.0, 200.0) if along == "x" else (0.0, 16.5, 200.0, 60.0)
    place = np.meshgrid(GRID.x, GRID.y)["xy".index(along)]
    first, last = ExtensionGauge("e", box, along).zois(GRID)
    assert set(place[first]) == {31.5} and set(place[last]) == {63.5}


def test_the_distance_of_two_ends() -> None:
    ends = np.zeros((2, *GRID.shape), bool)
    ends[0, 0, 0] = ends[1, 4, 3] = True
    assert distance(GRID, list(ends)) == 80.0
    assert math.isnan(distance(GRID, [ends[0]])) and math.isnan(distance(GRID, [ends[0], ends[1] & False]))


def test_the_sigma_of_a_line_has_what_u_and_v_have_in_common() -> None:
    """Along (0.6, 0.8), of two single ZOIs that do not overlap, 80 px apart."""
    covariance = np.zeros((21, *GRID.shape), np.float32)
    for pair, value in (((0, 0), 4e-6), ((0, 3), 1e-6), ((3, 3), 9e-6)):
        covariance[PAIR_INDEX[pair]] = value
    still = StrainField.from_values(GRID, {}, 1e-3)
    gauge = LineGauge("g", (15.5, 15.5), (63.5, 79.5), 1.0)
    variance = 0.36 * 4e-6 + 2 * 0.48 * 1e-6 + 0.64 * 9e-6
    found = gauge.measure(replace(still, covariance=covariance))
    assert found.sigma == pytest.approx(math.sqrt(2 * variance) / 80, rel=1e-6)


def test_an_error_that_all_zois_have_counts_along_the_line() -> None:
    shapes = np.zeros((1, 6, *GRID.shape))
    shapes[0, 0] = GRID.x  # all are longer along x by one share
    common = CommonError(shapes, np.array([[4e-8]]))
    plain = field()
    for end, share in (((175.5, 15.5), 2e-4), ((15.5, 175.5), 0.0)):
        gauge = LineGauge("g", (15.5, 15.5), end, 1.0)
        alone, both = gauge.measure(plain).sigma, gauge.measure(replace(plain, common=common)).sigma
        assert both == pytest.approx(math.hypot(alone, share), rel=1e-3)


def test_the_share_of_a_gauge_is_that_of_its_worse_end() -> None:
    gauge = LineGauge("g", (47.5, 47.5), (127.5, 143.5), 17.0)
    first, last = gauge.zois(GRID)
    assert first.sum() == last.sum() == 5
    for end in (first, last):
        status = np.zeros(GRID.shape, int)
        status[tuple(np.argwhere(end)[0])] = Status.LOST
        assert gauge.measure(field(status=status)).share == pytest.approx(0.8)
    assert gauge.measure(field()).share == 1.0


def test_a_point_is_one_zoi_and_what_is_off_is_none() -> None:
    assert np.argwhere(ZoiGauge("p", (40.0, 66.0)).zois(GRID)[0]).tolist() == [[3, 2]]
    off = GRID.subset(active=np.indices(GRID.shape)[0] > 1)
    assert AreaGauge("a", (0.0, 0.0, 200.0, 64.0)).zois(off)[0].sum() == 2 * 11


def test_drawn_at_the_rim_of_the_picture_or_without_a_way() -> None:
    assert AreaGauge.from_handles([(30, -4), (40, 10)]) == {"box": (30, 0, 10, 10)}
    assert CircleGauge.from_handles([(5, 5), (5, 5)]) == {"centre": (5, 5), "radius_px": 0.1}
    for gauge in (LineGauge("g", (9, 9), (60, 9)), StripGauge("g", (9, 9), (60, 9))):
        lines = np.concatenate([np.array(line) for line in gauge.outline(32)])
        assert (lines[:, 1].min(), lines[:, 1].max()) == pytest.approx((9 - 16, 9 + 16), abs=0.2)


@pytest.mark.parametrize(("axis", "value"), [("x", "exx"), ("y", "eyy")])
def test_a_gauge_is_along_the_load_where_nothing_else_is_given(axis: Axis, value: str) -> None:
    box: dict[str, Any] = {"box": (1, 2, 3, 4)}
    across: Axis = "y" if axis == "x" else "x"
    assert TransverseGauge.of("g", box, axis) == TransverseGauge("g", (1, 2, 3, 4), across)
    assert ZoiGauge.of("g", {"at": (1, 2), "value": "exy"}, axis) == ZoiGauge("g", (1, 2), "exy")
    assert ZoiGauge.of("g", {"at": (1, 2), "value": None}, axis) == ZoiGauge("g", (1, 2), value)
    assert ExtensionGauge.of("g", box, axis) == ExtensionGauge("g", (1, 2, 3, 4), axis)
    assert AreaGauge.of("g", box, axis) == AreaGauge("g", (1, 2, 3, 4), value=value)
    assert CircleGauge.of("g", {"centre": (9, 9), "radius_px": 5.0}, axis).value == value  # type: ignore[attr-defined]
    assert StripGauge.of("g", {"start": (1, 1), "end": (9, 9)}, axis).value == value  # type: ignore[attr-defined]


def test_lengths_have_bounds_and_words_are_chosen() -> None:
    lengths = [LineGauge.parameters()["radius_px"], CircleGauge.parameters()["radius_px"]]
    for one in (*lengths, StripGauge.parameters()["width_px"]):
        assert (one.kind, one.low, one.high) == ("length", 0.1, 1e5)
    assert TransverseGauge.parameters()["along"].choices == ("x", "y")
    assert AreaGauge.parameters()["statistic"].choices == ("affine", "mean", "largest", "smallest")
    assert AreaGauge.parameters()["value"].choices == ("exx", "eyy", "exy", "gamma_xy")
