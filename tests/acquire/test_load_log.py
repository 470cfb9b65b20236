"""The load log: what it interpolates and where it refuses."""

from __future__ import annotations

import math

import numpy as np
import pytest

from acquire.events import Event, EventKind
from acquire.load_cell.load_log import LoadLog
from acquire.load_sample import LoadFlag, LoadSample


def log_of(*pairs: tuple[float, float]) -> LoadLog:
    log = LoadLog(max_gap_s=0.25)
    for t, force in pairs:
        log.append(LoadSample(t, force))
    return log


@pytest.mark.parametrize(
    ("t", "force"),
    [(0.0, 10.0), (0.05, 15.0), (0.1, 20.0), (0.15, 25.0), (0.2, 30.0)],
    ids=["first", "between", "on a sample", "between again", "last"],
)
def test_interpolates(t: float, force: float) -> None:
    assert log_of((0.0, 10), (0.1, 20), (0.2, 30)).force_at(t) == pytest.approx(force)


@pytest.mark.parametrize("t", [-0.01, 0.21, 5.0])
def test_unknown_outside(t: float) -> None:
    assert math.isnan(log_of((0.0, 10), (0.1, 20), (0.2, 30)).force_at(t))


def test_unknown_when_empty() -> None:
    assert math.isnan(LoadLog().force_at(0.0))


def test_unknown_across_a_gap_but_not_beside_it() -> None:
    log = log_of((0.0, 0), (0.1, 1), (0.5, 5), (0.6, 6))
    assert math.isnan(log.force_at(0.3))
    assert log.force_at(0.55) == pytest.approx(5.5)


def test_a_gap_of_just_the_allowed_length_is_bridged() -> None:
    assert log_of((0.0, 0), (0.25, 1)).force_at(0.125) == 0.5


def test_unknown_beside_an_overload() -> None:
    log = LoadLog()
    log.append(LoadSample(0.0, 1.0))
    log.append(LoadSample(0.1, math.nan, flags=LoadFlag.OVERLOAD))
    log.append(LoadSample(0.2, 3.0))
    assert math.isnan(log.force_at(0.05)) and math.isnan(log.force_at(0.15))
    assert log.force_at(0.2) == 3.0


@pytest.mark.parametrize(
    "between",
    [LoadSample(0.1, math.nan, flags=LoadFlag.ERROR), LoadSample(0.1, 99.0, flags=LoadFlag.STALE)],
    ids=["garbage", "stale"],
)
def test_what_is_no_force_at_a_known_time_leaves_no_mark(between: LoadSample) -> None:
    log = LoadLog()
    log.append(LoadSample(0.0, 1.0))
    log.append(between)
    log.append(LoadSample(0.2, 3.0))
    assert log.force_at(0.1) == pytest.approx(2.0)
    assert len(log) == 3


def test_two_samples_at_one_time() -> None:
    log = log_of((0.0, 1), (0.1, 2), (0.1, 3), (0.2, 4))
    assert log.force_at(0.1) == 2.0
    assert log.force_at(0.15) == pytest.approx(3.5)


def test_a_time_that_goes_back_counts_as_the_last() -> None:
    log = log_of((1.0, 1), (0.5, 2))
    assert log.arrays()[0].tolist() == [1.0, 1.0]


def test_covers() -> None:
    log = log_of((0.0, 1), (1.0, 2))
    assert log.covers(1.0) and not log.covers(1.1)
    log.close()
    assert log.covers(1.1)


def test_mean_and_number() -> None:
    log = log_of((0.0, 1), (0.1, 2), (0.2, 6))
    assert log.mean(0.1, 0.2) == (4.0, 2)
    value, n = log.mean(0.3, 0.4)
    assert math.isnan(value) and n == 0


def test_mean_does_not_hide_an_overload() -> None:
    assert math.isnan(log_of((0.0, 1), (0.1, math.nan)).mean(0, 1)[0])


def test_latest_and_arrays() -> None:
    log = log_of((0.0, 1), (0.1, 2))
    assert log.latest is not None and log.latest.force == 2
    np.testing.assert_array_equal(log.arrays(), [[0.0, 0.1], [1, 2]])


def late(t: float, force: float, flags: LoadFlag = LoadFlag.NONE) -> LoadSample:
    return LoadSample(t, force, flags=flags | LoadFlag.STALE)


def test_a_late_overload_leaves_no_force_beside_it() -> None:
    """Three lines every 0.3 s, of which the first two waited; the middle one was an overload."""
    log = LoadLog(max_gap_s=0.5)
    for t in (0.0, 0.3, 0.6, 0.9):
        log.append(late(t, 10.0))
        if t == 0.6:
            log.append(late(t, math.nan, LoadFlag.OVERLOAD))
        log.append(LoadSample(t, 10.0))
    assert log.force_at(0.15) == 10.0 and log.force_at(0.75) == 10.0
    assert all(math.isnan(log.force_at(t)) for t in (0.301, 0.45, 0.599, 0.6))
    assert math.isnan(log.mean(0.3, 0.5)[0]) and math.isnan(log.mean(0.5, 0.7)[0])


def test_late_garbage_and_late_values_leave_no_mark() -> None:
    log = log_of((0.0, 1.0), (0.1, 1.0))
    log.append(late(0.15, math.nan, LoadFlag.ERROR))
    log.append(late(0.15, 99.0))
    log.append(LoadSample(0.2, 1.0))
    assert log.force_at(0.15) == 1.0


def test_lines_that_were_never_read_may_have_been_anything() -> None:
    log = log_of((0.0, 1.0), (0.1, 1.0))
    log.append(late(0.15, math.nan))
    log.append(LoadSample(0.2, 1.0))
    assert log.force_at(0.05) == 1.0
    assert math.isnan(log.force_at(0.12)) and math.isnan(log.force_at(0.17))


def test_tares_are_summed_up() -> None:
    log = log_of((0.0, 100.0), (1.0, 0.0), (2.0, 5.0), (3.0, 105.0))
    for t, data in ((0.5, {"step_N": 100.0}), (2.5, {"step_N": -100.0}), (2.6, {"step_N": None}), (2.7, {})):
        log.take_event(Event(t, EventKind.TARE, "a cell", "", "info", data))
    log.take_event(Event(0.1, EventKind.NOTE, "operator", "", "info", {"step_N": 7.0}))
    assert [log.zero_at(t) for t in (0.4, 0.5, 2.0, 2.5, 9.0)] == [0.0, 100.0, 100.0, 0.0, 0.0]


@pytest.mark.parametrize(("gap_s", "known"), [(0.25, True), (0.2501, False)])
def test_a_quarter_of_a_second_is_bridged_where_nothing_is_said(gap_s: float, known: bool) -> None:
    log = LoadLog()
    for t in (0.0, gap_s):
        log.append(LoadSample(t, 8.0))
    assert math.isnan(log.force_at(0.1)) != known


def test_across_a_tare_forces_count_from_the_zero_of_the_first() -> None:
    log = log_of((0.0, 100.0), (0.2, 100.0), (0.4, 0.0), (0.6, 10.0))
    log.take_event(Event(0.3, EventKind.TARE, "a cell", "", "info", {"step_N": 100.0}))
    assert log.forces_one_zero([0.1, 0.5]).tolist() == pytest.approx([100.0, 105.0])
    assert log.forces_one_zero([0.5, 0.1]).tolist() == pytest.approx([5.0, 0.0])
    assert log.forces_one_zero([]).shape == (0,)


def test_samples_stamped_before_their_load_are_waited_for_no_shorter() -> None:
    log = LoadLog(lag_s=-0.2)
    for k in range(11):
        log.append(LoadSample(k / 10, float(k)))
    assert log.covers(1.0) and not log.covers(1.1)
    assert log.force_at(1.0) == pytest.approx(8.0)


def test_an_empty_log_covers_nothing_and_a_mean_has_both_its_ends() -> None:
    log = LoadLog()
    assert not log.covers(0.0) and len(log) == 0 and log.latest is None
    log = log_of((0.0, 1.0), (0.1, 2.0), (0.2, 6.0))
    assert log.mean(0.0, 0.2) == (3.0, 3) and log.mean(0.0, 0.19) == (1.5, 2)


def test_many_samples_at_once_are_as_one_by_one() -> None:
    times, forces = np.arange(5) * 0.1, np.array([0.0, 1.0, math.nan, 3.0, 4.0])
    one, many = LoadLog(), LoadLog()
    for t, force in zip(times, forces, strict=True):
        one.append(LoadSample(float(t), float(force)))
    many.extend(times, forces)
    at = [-0.1, 0.0, 0.05, 0.15, 0.35, 0.4, 0.5]
    np.testing.assert_array_equal([many.force_at(t) for t in at], [one.force_at(t) for t in at])
    assert len(many) == len(one) == 5 and many.latest == one.latest
