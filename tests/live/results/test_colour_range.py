"""The range of colours by value, and the colour of a value in it."""

from __future__ import annotations

import numpy as np
import pytest

from live.results.maps.colours import colour, diverging_table, nice_above, ticks, unit_for
from live.results.maps.scale import AutoRange, ColourScale

RAMP = np.linspace(0.0, 1e-3, 101)


@pytest.mark.parametrize(
    ("kind", "values", "span"),
    [
        ("about zero", RAMP, (-1.2e-3, 1.2e-3)),  # 1.05 times the 98th percentile, rounded up
        ("about zero", -RAMP, (-1.2e-3, 1.2e-3)),
        ("from zero", 0.9 * RAMP, (0.0, 1e-3)),
        ("free", 3.0 + 100 * RAMP, (3.0, 3.1)),
    ],
)
def test_the_range_of_one_map(kind: str, values: np.ndarray, span: tuple[float, float]) -> None:
    assert AutoRange(kind).update(values) == pytest.approx(span)  # type: ignore[arg-type]


def test_two_percent_may_lie_beyond_the_colours() -> None:
    values = np.full(1000, 1e-3)
    values[:19] = 1.0
    assert AutoRange().update(values) == pytest.approx((-1.2e-3, 1.2e-3))
    values[:30] = 1.0
    assert AutoRange().update(values)[1] > 1


def test_noise_reaches_a_quarter_of_the_range() -> None:
    span = AutoRange().update(np.full(100, 1e-5), np.full(100, 1e-4))
    assert span == pytest.approx((-4e-4, 4e-4))


def test_the_colour_of_a_value_is_its_place_in_the_range() -> None:
    table = diverging_table()
    found = colour(np.array([[-1.0, -0.5, 0.5, 1.0, 7.0]]), 1.0)[0, :, :3]
    assert found.tolist() == table[[0, 64, 191, 255, 255]].tolist()
    scale = ColourScale.of("eyy", (-1e-3, 3e-3))
    middle = scale.colours(np.array([[1e-3, 3e-3, -1e-3]]), 255)[0]
    assert middle[:, :3].tolist() == table[[128, 255, 0]].tolist()


def test_blue_is_compression_and_red_is_tension() -> None:
    low, high = diverging_table()[[0, -1]]
    assert low[2] > low[0] and high[0] > high[2]


def test_round_numbers() -> None:
    assert [nice_above(v) for v in (1.0, 1.01, 1.3, 8.1, 0.021)] == [1.0, 1.2, 1.5, 10.0, 0.025]
    assert ticks(-1.0, 1.0) == [-1.0, -0.5, 0.0, 0.5, 1.0]
    assert [unit_for(v).name for v in (0.0099, 0.01)] == ["µm/m", "%"]
