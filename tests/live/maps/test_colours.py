"""Colours, units and ticks of the strain maps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from live.maps.colours import (
    MICROSTRAIN,
    PERCENT,
    colour,
    diverging_table,
    nice_above,
    number,
    ramp,
    ticks,
    unit_for,
)


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
