"""The range of colours by value, and the colour of a value in it."""

from __future__ import annotations

import numpy as np
import pytest

from live.results.maps.colours import colour, diverging_table, nice_above, sequential_table, ticks, unit_for
from live.results.maps.scale import AutoRange, ColourRange, ColourScale

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
