"""The range of a map, its unit, and its colours by value."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.field import Status
from live.results.maps.colours import colour, diverging_table, nice_above, sequential_table, ticks, unit_for
from live.results.maps.painting import FIELD_MAPS, FieldMaps
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


RAMP = np.linspace(0.0, 1e-3, 101)


@pytest.mark.parametrize(
    ("kind", "values", "span"),
    [
        ("about zero", RAMP, (-1.2e-3, 1.2e-3, True)),  # 1.05 times the 98th percentile, rounded up
        ("about zero", -RAMP, (-1.2e-3, 1.2e-3, True)),
        ("from zero", 0.9 * RAMP, (0.0, 1e-3, False)),
        ("free", 3.0 + 100 * RAMP, (3.0, 3.1, False)),
        ("free", 1.9 * RAMP - 9e-4, (-1.2e-3, 1.2e-3, True)),
    ],
)
def test_the_range_of_one_map(kind: str, values: np.ndarray, span: tuple[float, float, bool]) -> None:
    *ends, is_diverging = AutoRange(kind).update(values)  # type: ignore[arg-type]
    assert ends == pytest.approx(list(span[:2])) and is_diverging == span[2]


@pytest.mark.parametrize(
    ("low", "sigma", "is_diverging"),
    [
        (-0.05, 0.0, False),
        (-0.098, 0.0, False),
        (-0.102, 0.0, True),
        (-0.5, 0.124, True),
        (-0.5, 0.126, False),
    ],
)
@pytest.mark.parametrize("sign", [1, -1])
def test_colours_are_about_zero_where_values_lie_on_both_sides(
    sign: int, low: float, sigma: float, is_diverging: bool
) -> None:
    """The smaller end above a tenth of the larger, and above four sigma."""
    values = sign * np.concatenate([np.full(500, low), np.full(500, 1.0)])
    found = AutoRange("free").update(values, np.full(1000, sigma))
    assert found.is_diverging is is_diverging
    assert (found.low == -found.high) is is_diverging or sigma
    assert found.low <= values.min() and values.max() <= found.high


def test_noise_beyond_zero_is_no_part_of_the_range() -> None:
    values, sigmas = np.concatenate([np.full(500, -0.02), np.full(500, 1.0)]), np.full(1000, 0.01)
    assert AutoRange("free").update(values, sigmas) == ColourRange(0.0, 1.0)
    assert AutoRange("free").update(-values, sigmas) == ColourRange(-1.0, 0.0)
    assert AutoRange("free").update(3 * values, sigmas).low < 0, "more than noise"


def test_a_map_that_grows_to_one_side_becomes_sequential_after_a_while() -> None:
    auto = AutoRange("free", shrink_after=3)
    assert auto.update(2 * RAMP - 1e-3) == ColourRange(-1.2e-3, 1.2e-3, True)
    assert [auto.update(RAMP).is_diverging for _ in range(3)] == [True, True, False]
    assert auto.update(2 * RAMP - 1e-3).is_diverging, "and back at once"


def test_two_percent_may_lie_beyond_the_colours() -> None:
    values = np.full(1000, 1e-3)
    values[:19] = 1.0
    assert AutoRange().update(values)[:2] == pytest.approx((-1.2e-3, 1.2e-3))
    values[:30] = 1.0
    assert AutoRange().update(values)[1] > 1


def test_noise_reaches_a_quarter_of_the_range() -> None:
    span = AutoRange().update(np.full(100, 1e-5), np.full(100, 1e-4))
    assert span[:2] == pytest.approx((-4e-4, 4e-4))


def test_the_colour_of_a_value_is_its_place_in_the_range() -> None:
    table = diverging_table()
    found = colour(np.array([[-1.0, -0.5, 0.5, 1.0, 7.0]]), -1.0, 1.0, table)[0, :, :3]
    assert found.tolist() == table[[0, 64, 191, 255, 255]].tolist()
    table = sequential_table()
    scale = ColourScale.of("eyy", ColourRange(-1e-3, 3e-3))
    middle = scale.colours(np.array([[1e-3, 3e-3, -1e-3]]), 255)[0]
    assert middle[:, :3].tolist() == table[[128, 255, 0]].tolist()


def test_blue_is_compression_and_red_is_tension() -> None:
    low, high = diverging_table()[[0, -1]]
    assert low[2] > low[0] and high[0] > high[2]


def test_round_numbers() -> None:
    assert [nice_above(v) for v in (1.0, 1.01, 1.3, 8.1, 0.021)] == [1.0, 1.2, 1.5, 10.0, 0.025]
    assert ticks(-1.0, 1.0) == [-1.0, -0.5, 0.0, 0.5, 1.0]
    assert [unit_for(v).name for v in (0.0099, 0.01)] == ["µm/m", "%"]
