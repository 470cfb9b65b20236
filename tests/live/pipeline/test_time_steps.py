"""Time steps by value, and the history and columns that keep them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from acquire.events import Event, EventKind
from acquire.files.block_file import BlockFile
from acquire.load_cell.load_log import LoadLog
from acquire.load_sample import LoadSample
from analysis import StrainField
from analysis.evaluate import GaugeValue
from live.pipeline import history
from live.pipeline.history import History, NumberColumn, TextColumn
from live.pipeline.measurement import AXIAL, TRANSVERSE, extension_along, strains_along, time_step_of
from tests.live.made_up import START, make_measurement
from tests.live.pipeline.test_reference import GRID, seen


def test_a_column_in_blocks_has_the_newest_two_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(history, "_ROWS", 4)
    column = NumberColumn("d", BlockFile())
    for value in range(11):
        column.append(float(value))
    assert [type(block) is int for block in column._blocks] == [True, False, False]
    assert [column[k] for k in range(11)] == list(range(11))
    assert column.copied(11).tolist() == list(range(11)) and column.copied(5).tolist() == [0, 1, 2, 3, 4]
    still = NumberColumn("i", BlockFile())
    for _ in range(9):
        still.append(7)
    assert [block.strides for block in still._blocks] == [(0,), (0,), (4,)]  # type: ignore[union-attr]
    assert still.copied(9).tolist() == [7.0] * 9
    texts = TextColumn(BlockFile())
    for k in range(9):
        texts.append("ab"[k % 2])
    assert [texts[k] for k in (0, 1, 4, 8)] == ["a", "b", "a", "a"] and texts._texts == ["a", "b"]


def test_the_strains_along_and_across_the_load() -> None:
    assert strains_along((), "x") == ("exx", "eyy") and strains_along((), "y") == ("eyy", "exx")
    assert strains_along((AXIAL,), "x") == (AXIAL, "eyy") and strains_along((TRANSVERSE,), "y") == (
        "eyy",
        TRANSVERSE,
    )
    assert (extension_along((), "x"), extension_along((AXIAL,), "x")) == ("extension_x", AXIAL)


def test_a_time_step_has_the_largest_strain_by_magnitude_with_its_sign() -> None:
    values = np.full((1, 10), 1e-3)
    values[0, 3], values[0, 7] = -4e-3, 3e-3
    one = StrainField.from_values(
        GRID, {"u": 2.0, "v": -1.0, "dv_dy": values, "du_dx": 2e-3}, {"du_dx": 1e-6, "dv_dy": 3e-6}
    )
    step = time_step_of(make_measurement(0).burst, one, 12.0, 0.25)
    assert (step.largest, step.u, step.v) == (pytest.approx(-4e-3), 2.0, -1.0)
    assert (step.zoi_sigma, step.n_valid, step.n_zoi) == (pytest.approx(3e-6), 10, 10)
    assert (step.force, step.measure_s, step.noise_GL, step.refused) == (12.0, 0.25, 2.5, "")
    lost = time_step_of(make_measurement(0).burst, seen(0.0, 0.0, 0), math.nan)
    assert math.isnan(lost.largest) and math.isnan(lost.zoi_sigma) and lost.refused == "10 LOST"


def test_the_least_share_is_of_the_region_and_of_gauges_that_have_a_value() -> None:
    step = replace(make_measurement(0).time_step, area_share=0.9)
    gauges = {"a": GaugeValue(0.0, 0.0, "", 0.8), "b": GaugeValue(math.nan, math.nan, "lost", 0.1)}
    assert step.least_share == 0.9 and replace(step, gauges=gauges).least_share == 0.8


def test_the_history_has_values_once_any_zoi_had_one() -> None:
    history = History()
    assert not history.has_values
    history.add(replace(make_measurement(0).time_step, n_valid=0))
    assert not history.has_values
    history.add(make_measurement(1).time_step)
    assert history.has_values


def test_what_was_tared_before_the_first_measurement_is_not_of_the_test() -> None:
    history, loads = History("y"), LoadLog()
    for k, step_N in ((0, 50.0), (2, 7.0)):
        loads.append(LoadSample(START + k, 10.0))
        loads.take_event(Event(START + k + 0.5, EventKind.TARE, "a cell", "", "info", {"step_N": step_N}))
    assert history.tared_in_mid_test(loads) == 0.0
    for t in (1.0, 3.0):
        history.add(replace(make_measurement(0).time_step, t=START + t))
    assert history.tared_in_mid_test(loads) == 7.0
