"""The load log: what it interpolates and where it refuses."""

from __future__ import annotations

import math
import random
from bisect import bisect_left, bisect_right

import numpy as np
import pytest

from acquire.events import Event, EventKind
from acquire.load_cell import load_log
from acquire.load_cell.load_log import LoadLog
from acquire.load_sample import LoadFlag, LoadSample


def log_of(*pairs: tuple[float, float]) -> LoadLog:
    log = LoadLog()
    for t, force in pairs:
        log.append(LoadSample(t, force))
    return log


NAN = math.nan
RAMP = ((0.0, 10), (0.1, 20), (0.2, 30))


@pytest.mark.parametrize(
    ("pairs", "forces"),
    [
        pytest.param(RAMP, {0.0: 10, 0.05: 15, 0.1: 20, 0.15: 25, 0.2: 30}, id="between and on samples"),
        pytest.param(RAMP, dict.fromkeys((-0.01, 0.21, 5.0), NAN), id="unknown outside"),
        pytest.param((), {0.0: NAN}, id="unknown where nothing came"),
        pytest.param(
            ((0.0, 0), (0.1, 1), (0.5, 5), (0.6, 6)), {0.3: NAN, 0.55: 5.5}, id="a gap, and beside it"
        ),
        pytest.param(((0.0, 0), (0.25, 1)), {0.125: 0.5}, id="just the allowed gap is bridged"),
        pytest.param(((0.0, 8), (0.2501, 8)), {0.1: NAN}, id="and no longer one"),
        pytest.param(((0.0, 1), (0.1, 2), (0.1, 3), (0.2, 4)), {0.1: 2.0, 0.15: 3.5}, id="two at one time"),
    ],
)
def test_forces_between_samples(pairs: tuple[tuple[float, float], ...], forces: dict[float, float]) -> None:
    log = log_of(*pairs)
    assert [log.force_at(t) for t in forces] == pytest.approx([*forces.values()], nan_ok=True)


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


def test_a_time_that_goes_back_counts_as_the_last() -> None:
    log = log_of((1.0, 1), (0.5, 2))
    assert log.arrays()[0].tolist() == [1.0, 1.0]


def test_covers() -> None:
    log = log_of((0.0, 1), (1.0, 2))
    assert log.covers(1.0) and not log.covers(1.1)
    log.close()
    assert log.covers(1.1)


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


def test_an_empty_log_covers_nothing_and_has_no_latest() -> None:
    log = LoadLog()
    assert not log.covers(0.0) and len(log) == 0 and log.latest is None


@pytest.mark.parametrize(
    ("first", "last", "mean"),
    [(0.1, 0.2, (4.0, 2)), (0.0, 0.2, (3.0, 3)), (0.0, 0.19, (1.5, 2)), (0.3, 0.4, (NAN, 0))],
)
def test_a_mean_has_both_its_ends(first: float, last: float, mean: tuple[float, int]) -> None:
    assert log_of((0.0, 1), (0.1, 2), (0.2, 6)).mean(first, last) == pytest.approx(mean, nan_ok=True)


def test_a_mean_does_not_hide_an_overload() -> None:
    assert math.isnan(log_of((0.0, 1), (0.1, NAN)).mean(0, 1)[0])


def test_many_samples_at_once_are_as_one_by_one() -> None:
    times, forces = np.arange(5) * 0.1, np.array([0.0, 1.0, math.nan, 3.0, 4.0])
    one, many = LoadLog(), LoadLog()
    for t, force in zip(times, forces, strict=True):
        one.append(LoadSample(float(t), float(force)))
    many.extend(times, forces)
    at = [-0.1, 0.0, 0.05, 0.15, 0.35, 0.4, 0.5]
    np.testing.assert_array_equal([many.force_at(t) for t in at], [one.force_at(t) for t in at])
    assert len(many) == len(one) == 5 and many.latest == one.latest


# -- a load that is stamped late is looked up later, by as much ------------------------------------


def ramp(lag_s: float) -> LoadLog:
    """100 N a second, whose samples are stamped ``lag_s`` after the load they show."""
    log = LoadLog(lag_s=lag_s)
    for k in range(101):
        log.append(LoadSample(k / 100 + lag_s, float(k)))
    return log


@pytest.mark.parametrize("lag_s", [0.0, 0.03, 0.2])
def test_the_force_is_that_of_the_instant(lag_s: float) -> None:
    log = ramp(lag_s)
    assert log.force_at(0.505) == pytest.approx(50.5)
    raw = log.raw_force_at(0.505)
    assert math.isnan(raw) if lag_s == 0 else raw == pytest.approx(50.5 - 100 * lag_s)


def test_it_is_covered_once_the_samples_reach_past_the_lag() -> None:
    log = ramp(0.2)  # up to 1.2 s
    assert log.covers(1.0 - 1e-9) and not log.covers(1.0 + 1e-6)
    assert not math.isnan(log.force_at(1.0 - 1e-9)) and math.isnan(log.force_at(1.0 + 1e-6))
    log.close()
    assert log.covers(5.0)


# -- readings in memory and in a file, by value against a plain list -------------------------------


@pytest.fixture
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(load_log, "ROWS", 4)
    monkeypatch.setattr(load_log, "PIECE", 3)


@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize("seed", range(20))
def test_a_part_and_a_place_are_those_of_a_list(seed: int) -> None:
    rng, stored, times = random.Random(seed), load_log.StoredReadings(), list[float]()
    for k in range(rng.randrange(40)):
        times.append((times[-1] if times else 0.0) + rng.choice([0.0, 0.0, 1.0, 2.0]))
        stored.append(times[-1], float(k))
        assert (len(stored), stored.last_t) == (k + 1, times[-1])
    for t in np.arange(-1, 45, 0.5).tolist():
        assert (stored.before(t), stored.until(t)) == (bisect_left(times, t), bisect_right(times, t))
    first, stop = rng.randrange(45), rng.randrange(len(times) + 1)
    assert stored.part(first, stop).tolist() == [times[first:stop], [*map(float, range(first, stop))]]
    assert [stored.at(k) for k in range(len(times))] == [*zip(times, range(len(times)), strict=True)]


@pytest.mark.usefixtures("small_blocks")
def test_old_readings_are_in_a_file_and_the_forces_the_same() -> None:
    log, plain = LoadLog(max_gap_s=2.0), np.random.default_rng(1).normal(size=50)
    for k, force in enumerate(plain.tolist()):
        log.append(LoadSample(float(k), force))
    assert [type(block) for block in log._stored._filed] == [int] * 12
    at = np.linspace(0, 49, 491)
    assert [log.force_at(t) for t in at.tolist()] == pytest.approx(np.interp(at, range(50), plain), abs=1e-12)
    assert log.mean(3.5, 20.0) == (pytest.approx(plain[4:21].mean()), 17)
    pieces = [*log.pieces()]
    assert [len(t) for t, _ in pieces] == [3] * 16 + [2]
    assert (
        np.concatenate([force for _, force in pieces]).tolist() == plain.tolist() == log.arrays()[1].tolist()
    )
