"""Virtual gauges: the ZOIs they take, their values in known fields, and their sigma against their scatter."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import pytest

from analysis import Roi, Status, StrainField, ZoiGrid
from analysis.evaluate import (
    GAUGE_KINDS,
    AreaGauge,
    CircleGauge,
    ExtensionGauge,
    Gauge,
    LineGauge,
    StripGauge,
    TransverseGauge,
    ZoiGauge,
)
from tests.accuracy.gauges import line, point, ratio
from tests.accuracy.truth import Speckle, affine

GRID = ZoiGrid.cover(Roi(0, 0, 208, 176), 32, 16)
LINE = LineGauge("axial", (90.0, 30.0), (90.0, 140.0))
EVERY = (
    ZoiGauge("point", (80, 80), "eyy"),
    AreaGauge("mean", (40, 40, 90, 60)),
    AreaGauge("largest", corners=((40, 40), (150, 50), (90, 130)), statistic="largest"),
    LINE,
    LineGauge("skew", (40.0, 40.0), (150.0, 130.0), 20.0),
    TransverseGauge("width", (30, 30, 130, 80), "x"),
)


def field(status: np.ndarray | None = None, **gradients: float) -> StrainField:
    x, y = np.meshgrid(GRID.x, GRID.y)
    g = {n: gradients.get(n, 0.0) for n in ("du_dx", "du_dy", "dv_dx", "dv_dy")}
    values = {"u": 3 + g["du_dx"] * x + g["du_dy"] * y, "v": -2 + g["dv_dx"] * x + g["dv_dy"] * y, **g}
    return StrainField.from_values(GRID, values, 1e-2, status)


def test_a_uniform_strain_is_met_exactly() -> None:
    found = {g.name: g.measure(field(du_dx=-3e-4, dv_dy=1e-3)) for g in EVERY}
    for name in ("point", "mean", "largest", "axial"):
        assert found[name].value == pytest.approx(1e-3, rel=1e-9), name
    assert found["width"].value == pytest.approx(-3e-4, rel=1e-9)
    assert all(one.sigma > 0 and not one.reason for one in found.values())


def test_an_extensometer_does_not_see_a_rotation() -> None:
    c, s = math.cos(0.2), math.sin(0.2)
    turned = field(du_dx=c - 1, du_dy=-s, dv_dx=s, dv_dy=c - 1)
    for gauge in EVERY[3:]:
        assert gauge.measure(turned).value == pytest.approx(0, abs=1e-12)


def test_what_a_gauge_takes() -> None:
    (box,) = AreaGauge("", (40, 40, 32, 16)).zois(GRID)
    assert box.sum() == 2
    (triangle,) = AreaGauge("", corners=((0, 0), (208, 0), (0, 176))).zois(GRID)
    assert not triangle[-1, -1] and triangle[0, 0]
    first, second = LINE.zois(GRID)
    assert first.sum() >= 3 and not (first & second).any()
    left, right = TransverseGauge("", (0, 0, 207, 176), "y").zois(GRID)
    assert np.flatnonzero(left.any(axis=1)).max() < np.flatnonzero(right.any(axis=1)).min()
    # However small its radius, an end is at least the nearest ZOI.
    assert [end.sum() for end in LineGauge("", (50, 50), (90, 90), 0.1).zois(GRID)] == [1, 1]


def lost(*, share: float) -> np.ndarray:
    """The upper part of the grid is lost."""
    status = np.zeros(GRID.shape, int)
    status[: round(share * GRID.shape[0])] = Status.LOST
    return status


def test_lost_zois_give_a_reason() -> None:
    broken = field(lost(share=0.5), dv_dy=1e-3)
    for gauge, message in (
        (ZoiGauge("", (80, 20)), "1 of 1 ZOIs have no value (1 LOST)"),
        (AreaGauge("", (0, 0, 200, 60)), "ZOIs have no value"),
        (LINE, "end 1: "),
        (TransverseGauge("", (0, 0, 200, 200), "y"), "end 1: "),
    ):
        found = gauge.measure(broken)
        assert math.isnan(found.value) and math.isnan(found.sigma)
        assert message in found.reason
    some = lost(share=0.0)
    some[3, 4] = Status.UNEVEN
    whole = AreaGauge("", (0, 0, 200, 200)).measure(field(some, dv_dy=1e-3))
    assert whole.value == pytest.approx(1e-3)


def test_a_gauge_beside_the_grid_names_where_the_grid_is() -> None:
    for gauge in (
        ZoiGauge("", (500, 80)),
        AreaGauge("", (500, 0, 9, 9)),
        LineGauge("", (0, 0), (80, 500)),
    ):
        found = gauge.measure(field())
        assert "no ZOI is there; their centres reach from 15.5, 15.5 to 191.5" in found.reason
    same = LineGauge("", (80, 80), (81, 80), 1).measure(field())
    assert "make the gauge longer" in same.reason


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ZoiGauge("a", (0, 0), "ezz"), "gauge a: unknown value 'ezz'; known: u, v"),
        (lambda: AreaGauge("a", corners=((0, 0), (1, 1))), "at least 3 corners"),
        (lambda: AreaGauge("a", (0, 0, 9, 9), statistic="median"), "known: affine, mean, largest"),  # type: ignore[arg-type]
        (lambda: LineGauge("a", (3, 3), (3, 3)), "one point"),
        (lambda: LineGauge("a", (3, 3), (3, 9), 0), "radius must be positive"),
        (lambda: TransverseGauge("a", (0, 0, 0, 5)), "must be positive"),
        (lambda: TransverseGauge("a", (0, 0, 5, 0)), "must be positive"),
        (lambda: CircleGauge("a", (9, 9), 0.0), "gauge a: the radius"),
        (lambda: StripGauge("a", (9, 9), (9, 9)), "gauge a: the two ends"),
        (lambda: StripGauge("a", (9, 9), (19, 9), 0.0), "gauge a: the width"),
        (lambda: TransverseGauge("a", (0, 0, 5, 5), "z"), "along is x or y"),  # type: ignore[arg-type]
    ],
)
def test_impossible_gauges_are_refused(make, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_far_ends_are_independent_and_near_ones_are_not() -> None:
    one = 1e-2 * math.sqrt(2)
    far = LineGauge("", (15.5, 79.5), (175.5, 79.5), 1).measure(field())
    assert far.sigma == pytest.approx(one / 160, rel=1e-6)
    near = LineGauge("", (79.5, 79.5), (95.5, 79.5), 1).measure(field())
    assert near.sigma < 0.96 * one / 16


def test_sigma_is_the_scatter() -> None:
    pattern, shape = Speckle(2.0, 1, span=400), (176, 272)
    zois = ZoiGrid.cover(Roi(8, 8, 256, 160), 32, 16)
    kinds = {"point": point("eyy"), "line": line(100, 30), "long": line(160, 0)}
    moved = pattern.at(*affine(shape, u=0.3, du_dx=1e-3))
    gauges = [gauge for some in kinds.values() for gauge in some]
    z = ratio(gauges, zois, (pattern.at(*affine(shape)), moved), pairs=16)
    for name, part in zip(kinds, np.split(z, np.cumsum([len(some) for some in kinds.values()])[:-1], axis=1),
                          strict=True):  # fmt: skip
        assert np.sqrt(np.mean(part**2)) == pytest.approx(1, abs=0.15), name


def test_the_zois_of_a_circle_and_of_a_strip() -> None:
    x, y = np.meshgrid(GRID.x, GRID.y)
    circle = CircleGauge("g", (96.0, 80.0), 40.0).zois(GRID)[0]
    assert np.array_equal(circle, GRID.active & (np.hypot(x - 96, y - 80) <= 40)) and circle.sum() > 8
    # Along the diagonal: the distance from the line, and the place along it, decide.
    strip = StripGauge("g", (40.0, 40.0), (120.0, 120.0), 30.0).zois(GRID)[0]
    off, along = (x - y) / math.sqrt(2), (x + y) / math.sqrt(2)
    inside = (np.abs(off) < 15) & (along > 40 * math.sqrt(2)) & (along < 120 * math.sqrt(2))
    assert np.array_equal(strip, GRID.active & inside) and strip.sum() > 5
    whole = StripGauge("g", (40.0, 80.0), (120.0, 80.0)).outline(32)[0]
    assert np.ptp([corner[1] for corner in whole]) == 32, "as wide as a ZOI"


@pytest.mark.parametrize("kind", GAUGE_KINDS.values(), ids=GAUGE_KINDS)
class TestEveryKind:
    """What configuration, view and page take from the class of a kind."""

    DRAWN = ((60.0, 40.0), (130.0, 110.0))

    def test_it_is_made_of_what_is_dragged_and_of_its_own_handles(self, kind: type[Gauge]) -> None:
        gauge = kind.of("g", kind.from_handles(self.DRAWN), "y")
        assert kind.of("g", kind.from_handles(gauge.handles()), "y") == gauge
        assert kind.of("g", {**kind.from_handles(self.DRAWN), "of another": 1}, "y") == gauge
        assert set(kind.from_handles(self.DRAWN)) <= set(kind.parameters())

    def test_it_takes_zois_and_reads_a_strain(self, kind: type[Gauge]) -> None:
        gauge = kind.of("g", kind.from_handles(self.DRAWN), "y")
        assert all(mask.any() and mask.dtype == bool for mask in gauge.zois(GRID))
        found = gauge.measure(field(du_dx=1e-3, dv_dy=1e-3))
        assert found.value == pytest.approx(1e-3, rel=1e-9) and found.sigma > 0
        assert math.isnan(gauge.measure(field(lost(share=1.0))).value)

    def test_its_outline_follows_its_handles(self, kind: type[Gauge]) -> None:
        gauge = kind.of("g", kind.from_handles(self.DRAWN), "y")
        moved = kind.of("g", kind.from_handles([(x + 7, y + 3) for x, y in gauge.handles()]), "y")
        for before, after in zip(gauge.outline(32), moved.outline(32), strict=True):
            assert len(before) > 1
            np.testing.assert_allclose(np.array(after) - before, [(7, 3)] * len(before), atol=0.2)

    def test_it_names_what_it_needs(self, kind: type[Gauge]) -> None:
        with pytest.raises(ValueError, match=f"a gauge of kind '{kind.kind}' needs '"):
            kind.of("g", {}, "y")
        assert kind.label and kind.hint and kind.default_name.isidentifier()
        assert kind.gesture in ("click", "line", "box")


def test_a_box_is_drawn_in_whole_px_within_the_picture() -> None:
    assert AreaGauge.from_handles([(30.4, 20.2), (-3.0, 10.6)]) == {"box": (0, 11, 30, 9)}
    assert AreaGauge.from_handles([(5, 5), (5, 5)]) == {"box": (5, 5, 1, 1)}
    corners = ((1.0, 2.0), (9.0, 2.0), (4.0, 8.0))
    assert AreaGauge.from_handles(AreaGauge("g", corners=corners).handles()) == {"corners": corners}
    assert LineGauge.from_handles([(1.234, 5), (9, 7.77)]) == {"start": (1.2, 5), "end": (9, 7.8)}


@pytest.mark.parametrize("along", ["x", "y"])
def test_the_ends_of_a_strip_are_thirds_across_the_load_and_sixths_along_it(along: Literal["x", "y"]) -> None:
    zois = ZoiGrid.cover(Roi(0, 0, 160, 160), 16, 4)
    place = np.meshgrid(zois.x, zois.y)["xy".index(along)]
    across = np.meshgrid(zois.x, zois.y)["yx".index(along)]
    box = (20.0, 70.0, 120.0, 12.0) if along == "x" else (70.0, 20.0, 12.0, 120.0)
    inside = (across >= 70) & (across <= 82)
    for gauge, end in ((TransverseGauge("t", box, along), 40.0), (ExtensionGauge("e", box, along), 20.0)):
        first, last = gauge.zois(zois)
        np.testing.assert_array_equal(first, inside & (place >= 20) & (place <= 20 + end))
        np.testing.assert_array_equal(last, inside & (place >= 140 - end) & (place <= 140))
    assert ExtensionGauge("e", box, along).length == pytest.approx(100.0)


@pytest.mark.parametrize(("statistic", "value"), [("smallest", -3e-3), ("largest", 2e-3), ("mean", 0.0)])
def test_the_extremes_of_an_area(statistic: str, value: float) -> None:
    """Where a ZOI has no value it is neither."""
    grid = ZoiGrid.cover(Roi(0, 0, 96, 64), 32, 16)
    strain, status = np.zeros(grid.shape), np.zeros(grid.shape, int)
    strain[0, 1], strain[1, 2], strain[2, 0], strain[2, 4] = -3e-3, 2e-3, 1e-3, 9.0
    status[2, 4] = Status.POOR_MATCH
    sigmas = np.arange(15.0).reshape(grid.shape) * 1e-6 + 1e-6
    field = StrainField.from_values(grid, {"du_dx": strain}, sigmas, status)
    gauge = AreaGauge("", (0, 0, 96, 64), value="exx", statistic=statistic)  # type: ignore[arg-type]
    found = gauge.measure(field)
    assert found.value == pytest.approx(value, abs=1e-12)
    place = {"smallest": (0, 1), "largest": (1, 2)}.get(statistic)
    assert place is None or found.sigma == pytest.approx(field.sigma("exx")[place])
