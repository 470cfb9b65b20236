"""The range of a map, its unit, the colours of a field while it is measured, and those of statuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.field import Status
from live.results.maps.colours import diverging_table, sequential_table
from live.results.maps.field_maps import FIELD_MAPS, FieldMaps
from live.results.maps.scale import (
    AutoRange,
    ColourRange,
    ColourScale,
    range_kind,
    status_colours,
    status_legend,
)
from tests.live.made_up import make_field, make_grid


def full(value: float) -> np.ndarray:
    return np.full((4, 4), value)


def test_the_range_grows_at_once_and_shrinks_only_after_a_while() -> None:
    auto = AutoRange(shrink_after=3)
    none = full(0.0)
    assert auto.update(full(1e-3), none) == (-1.2e-3, 1.2e-3, True)
    assert auto.update(full(-2.1e-3), none) == (-2.5e-3, 2.5e-3, True)
    assert [auto.update(full(1e-4), none)[1] for _ in range(3)] == [2.5e-3, 2.5e-3, 1.2e-4]


def test_small_changes_do_not_move_the_range() -> None:
    auto = AutoRange(shrink_after=3)
    limits = {auto.update(full(value), full(0.0))[1] for value in (1e-3, 0.9e-3, 1.1e-3, 0.7e-3) * 5}
    assert limits == {1.2e-3}


def test_noise_alone_does_not_fill_the_colours() -> None:
    rng = np.random.default_rng(1)
    noise = 1e-4 * rng.normal(size=(30, 30))
    assert AutoRange().update(noise, full(1e-4))[1] >= 4e-4
    low, high, _ = AutoRange("free").update(1.0 + noise, full(1e-4))
    assert low <= 1 - 4e-4 < 1 + 4e-4 <= high


def test_a_fixed_range_and_an_empty_map() -> None:
    assert AutoRange(fixed=5e-3).update(full(1.0), full(0.0)) == (-5e-3, 5e-3, True)
    assert AutoRange("from zero", 5e-3).update(full(1.0)) == (0, 5e-3, False)
    for kind in ("about zero", "from zero", "free"):
        low, high, _ = AutoRange(kind).update(full(np.nan), full(np.nan))
        assert low < high
        low, high, _ = AutoRange(kind).update(full(0.0))
        assert low < high


def test_a_free_range_lies_over_the_values_and_shrinks_late() -> None:
    auto, wide, small = AutoRange("free"), np.linspace(0, 1, 100), np.linspace(0, 0.1, 100)
    first = auto.update(wide)
    assert first[0] <= 0.02 and first[1] >= 0.98
    assert auto.update(small) == first
    for _ in range(30):
        last = auto.update(small)
    assert last[1] < 0.2
    assert auto.update(full(np.nan)) == last


@pytest.mark.parametrize(
    ("name", "kind"),
    [("eyy", "free"), ("du_dx", "free"), ("u", "free"), ("blur", "from zero"), ("sigma_v", "from zero"),
     ("sigma", "from zero"), ("residual", "from zero")],
)  # fmt: skip
def test_where_the_colours_lie(name: str, kind: str) -> None:
    assert range_kind(name) == kind


def test_the_colours_run_from_one_end_of_the_scale_to_the_other() -> None:
    for name, span in (
        ("eyy", ColourRange(-1e-3, 1e-3, True)), ("sigma_eyy", ColourRange(0.0, 2e-5)), ("u", ColourRange(3.0, 5.0)),
    ):  # fmt: skip
        scale, table = (
            ColourScale.of(name, span),
            diverging_table() if span.is_diverging else sequential_table(),
        )
        ends = scale.colours(np.array([[span.low, span.high, np.nan]]))[0]
        assert (ends[0, :3] == table[0]).all() and (ends[1, :3] == table[-1]).all(), name
        assert ends[2, 3] == 0


def test_units() -> None:
    assert ColourScale.of("eyy", ColourRange(-0.03, 0.03, True)) == ColourScale(-3.0, 3.0, "%", 100.0, True)
    assert ColourScale.of("sigma_eyy", ColourRange(0.0, 2e-5)) == ColourScale(0.0, 20.0, "µm/m", 1e6)
    assert ColourScale.of("v", ColourRange(1.0, 2.0)) == ColourScale(1.0, 2.0, "px", 1.0)
    assert ColourScale.of("v", ColourRange(1.0, 2.0), "mm", -0.5) == ColourScale(-1.0, -0.5, "mm", -0.5)
    assert ColourScale.of("exy", ColourRange(-1e-3, 1e-3), factor=-1.0) == ColourScale(
        -1000.0, 1000.0, "µm/m", -1e6
    )
    assert ColourScale.of("residual", ColourRange(0.0, 3.0)).unit == "chi²"


def test_every_map_has_colours_and_a_scale_or_a_legend() -> None:
    grid = make_grid()
    field = make_field(grid, 1e-3)
    painted = FieldMaps("y", is_symmetric=True).paint(field, FIELD_MAPS)
    assert set(painted) == set(FIELD_MAPS)
    valid = field.ok
    for name, one in painted.items():
        assert one.rgba.shape == (*grid.shape, 4)
        assert (one.rgba[valid][:, 3] > 0).all(), name
        assert (one.scale is None) == (name == "status")
    scale = painted["eyy"].scale
    assert scale is not None and scale.low == -scale.high and scale.high >= 1000 and scale.unit == "µm/m"
    assert painted["e1"].scale == scale  # tension along y: the largest principal strain
    assert painted["sigma"].scale is not None and painted["sigma"].scale.low == 0


def test_the_principal_strains_are_of_the_measure_that_is_shown() -> None:
    field = replace(make_field(make_grid(), 0.1), measure="green")
    maps = FieldMaps("y").paint(field, ("eyy", "e1"))
    np.testing.assert_array_equal(maps["e1"].rgba, maps["eyy"].rgba)


def test_colours_over_the_values_there_are() -> None:
    grid = make_grid()
    maps = FieldMaps("y")
    scale = maps.paint(make_field(grid, 1e-3), ("eyy",))["eyy"].scale
    assert scale is not None and 0 < scale.low <= 1000 <= scale.high < 1100
    fixed = FieldMaps("y", 0.01).paint(make_field(grid, 1e-3), ("eyy",))["eyy"].scale
    assert fixed is not None and (fixed.low, fixed.high) == (-1.0, 1.0) and fixed.unit == "%"


def test_statuses_have_one_colour_each_and_a_legend() -> None:
    statuses = np.array([[*Status, 99, Status.OK]], np.uint8)
    cells, legend = status_colours(statuses)[0], status_legend(statuses)
    assert cells[Status.NOT_MEASURED, 3] == 0
    shown = {one.name: one for one in legend}
    assert "NOT_MEASURED" not in shown and shown["OK"].count == 2 and shown["status 99"].count == 1
    for status in Status:
        if status != Status.NOT_MEASURED:
            assert tuple(cells[status, :3]) == shown[status.name].rgb
            assert shown[status.name].text == status.text
    assert len({one.rgb for one in legend}) == len(legend), "a colour stands for one status"
