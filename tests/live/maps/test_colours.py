"""Colours, ranges and ticks of the strain maps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from live.maps.colours import (
    MICROSTRAIN,
    PERCENT,
    AutoRange,
    colour,
    diverging_table,
    nice_above,
    number,
    ramp,
    ticks,
    unit_for,
)


def full(value: float) -> np.ndarray:
    return np.full((4, 4), value)


def test_the_table_runs_from_blue_over_near_white_to_red_without_jumps() -> None:
    table = diverging_table().astype(int)
    assert table.shape == (256, 3)
    assert table[0].argmax() == 2
    assert table[-1].argmax() == 0
    assert table[127:129].min() > 215
    assert np.abs(np.diff(table, axis=0)).max() <= 8
    luminance = table @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(luminance[:127]) > -0.5).all()
    assert (np.diff(luminance[129:]) < 0.5).all()


def test_rejected_is_transparent_and_the_ends_hold() -> None:
    rgba = colour(np.array([[-2.0, -1.0, 0.0, 1.0, 2.0, np.nan]]), 1.0, alpha=200)[0]
    assert rgba[:, 3].tolist() == [200] * 5 + [0]
    assert (rgba[0] == rgba[1]).all()
    assert (rgba[3] == rgba[4]).all()
    assert rgba[2, :3].min() > 215


def test_the_ramp_has_the_largest_value_on_top() -> None:
    bar = ramp(64, 3)
    assert bar.shape == (64, 3, 3)
    assert (bar[0, 0] == diverging_table()[-1]).all()
    assert (bar[-1, 0] == diverging_table()[0]).all()


@given(st.floats(1e-7, 1e7))
def test_nice_is_above_and_near(value: float) -> None:
    nice = nice_above(value)
    assert value * (1 - 1e-6) <= nice <= value * 1.35


@given(st.floats(-1e4, 1e4), st.floats(1e-3, 1e4))
def test_ticks_are_inside_and_a_few(low: float, span: float) -> None:
    marks = ticks(low, low + span, 6)
    assert 2 <= len(marks) <= 7
    slack = 1e-6 * (abs(low) + span)
    assert low - slack <= marks[0] <= marks[-1] <= low + span + slack


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (-2500.0, "−2 500"), (0.125, "0.125"), (12000.0, "12 000"), (3e9, "3e+09")],
)
def test_numbers_read_well(value: float, text: str) -> None:
    assert number(value) == text.replace(" ", "\u202f")


def test_percent_from_two_percent_on() -> None:
    assert unit_for(0.0199) == MICROSTRAIN
    assert unit_for(0.02) == PERCENT


def test_the_range_grows_at_once_and_shrinks_only_after_a_while() -> None:
    auto = AutoRange(patience=3)
    none = full(0.0)
    assert auto.update(full(1e-3), none) == 1.2e-3
    assert auto.update(full(-2.1e-3), none) == 2.5e-3
    assert [auto.update(full(1e-4), none) for _ in range(3)] == [2.5e-3, 2.5e-3, 1.2e-4]


def test_small_changes_do_not_move_the_range() -> None:
    auto = AutoRange(patience=3)
    limits = {auto.update(full(value), full(0.0)) for value in (1e-3, 0.9e-3, 1.1e-3, 0.7e-3) * 5}
    assert limits == {1.2e-3}


def test_noise_alone_does_not_fill_the_colours() -> None:
    rng = np.random.default_rng(1)
    limit = AutoRange().update(1e-4 * rng.normal(size=(30, 30)), full(1e-4))
    assert limit >= 4e-4


def test_a_fixed_range_and_an_empty_map() -> None:
    assert AutoRange(5e-3).update(full(1.0), full(0.0)) == 5e-3
    assert AutoRange().update(full(np.nan), full(np.nan)) > 0
