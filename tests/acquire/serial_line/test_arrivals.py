"""When the bytes of a message were sent, and which messages are late by their pace."""

from __future__ import annotations

import math
import random

import pytest

from acquire.serial_line.arrivals import ArrivalRate, ArrivalTimes

PERIOD = 0.0125


def test_a_byte_began_as_many_byte_times_ago_as_came_after_it() -> None:
    times = ArrivalTimes(0.001)
    times.received(10, 5.0)
    times.received(4, 6.0)
    assert times.began(0) == pytest.approx(4.990)
    assert times.began(9) == pytest.approx(4.999)
    assert times.began(10) == pytest.approx(5.996)


def test_many_reads_cost_no_memory() -> None:
    times = ArrivalTimes(0.0)
    for k in range(20_000):
        times.received(3, float(k))
    assert times.began(59_999) == 19_999.0
    assert len(times._reads) <= 4096


def paced(pace: ArrivalRate, count: int, start: float = 0.0) -> list[bool]:
    """Single messages at their pace."""
    return [late for k in range(count) for late in pace.late([start + PERIOD * (k + 1)])]


def test_pace() -> None:
    pace = ArrivalRate()
    assert not any(paced(pace, 200))
    assert pace.period == pytest.approx(PERIOD)
    assert pace.late([2.5 + 0.2] * 2) == [True, True]  # two after a pause of sixteen


@pytest.mark.parametrize("known_for", [0, 1, 10, 20, 200])
def test_a_backlog_is_late_however_early_it_comes(known_for: int) -> None:
    pace = ArrivalRate()
    assert not any(paced(pace, known_for))
    late = pace.late([PERIOD * known_for] * 160)
    assert late.count(True) >= 159
    pace.restart()
    assert pace.late([PERIOD * (known_for + 1)] * 2) == [True, False]


def test_a_fast_stream_in_large_reads_is_not_late() -> None:
    pace = ArrivalRate()
    late = [any(pace.late([0.016 * k] * 16)) for k in range(300)]
    assert all(late[:5]) and not any(late[40:])  # at first the pace is not known
    assert pace.late([0.016 * 300] * 400).count(True) == 400


@pytest.mark.parametrize("rate", [500, 3000, 20_000])
def test_a_stall_is_late_until_it_is_caught_up_with_however_it_is_read(rate: int) -> None:
    pace = ArrivalRate()
    paced(pace, 400)
    now, due, wrong = 9.0, 5.0 + PERIOD, 0
    while now - due > PERIOD:
        (late,) = pace.late([now])
        wrong += not late and now - due > 0.05 + PERIOD
        now, due = now + 1 / rate, due + PERIOD
    assert wrong == 0
    start = now - now % PERIOD
    assert sum(paced(pace, 100, start)) < 25


@pytest.mark.parametrize("speed", [0.5, 2.0, 10.0])
def test_another_pace_is_learned_in_seconds(speed: float) -> None:
    pace = ArrivalRate()
    paced(pace, 800)
    step, t = PERIOD / speed, 10.0
    late = [pace.late([t + step * k])[0] for k in range(round(10 / step))]
    assert not any(late[round(6 / step) :])
    assert pace.period == pytest.approx(step, rel=0.02)


@pytest.mark.parametrize("chunk_s", [0.016, 0.04])
def test_an_adapter_that_collects_bytes_makes_nothing_late(chunk_s: float) -> None:
    pace = ArrivalRate()
    late = [pace.late([math.ceil(PERIOD * k / chunk_s) * chunk_s])[0] for k in range(2000)]
    assert not any(late[100:])


def test_irregular_messages_are_not_all_late() -> None:
    rng, pace, t, late = random.Random(5), ArrivalRate(), 0.0, []
    for _ in range(3000):
        t += rng.expovariate(10.0)
        late += pace.late([t])
    assert sum(late) < 0.5 * len(late)


def test_no_byte_is_older_than_the_read_before_its_own_less_a_byte() -> None:
    times = ArrivalTimes(0.01)
    times.received(1, 1.0)
    times.received(10, 1.02)  # on the wire for 0.1 s, but 20 ms ago there was nothing
    assert times.began(1) == pytest.approx(0.99)
    assert times.began(10) == pytest.approx(1.01)


def period_after(*times: float) -> float:
    pace = ArrivalRate()
    for t in times:
        pace.late([t])
    return pace.period


def test_a_pace_is_known_from_two_groups_of_a_quarter_of_a_second_on() -> None:
    one = (0.0, 0.1, 0.2, 0.3)
    assert math.isnan(period_after(*one))
    assert period_after(*one, 0.4, 0.5, 0.6) == pytest.approx(0.1)
    assert period_after(*one, 0.4, 0.5, 0.6, 0.9, 1.2) == pytest.approx(0.2), "the median of four groups"


def test_groups_that_differ_by_half_keep_no_pace() -> None:
    """Of the quarter that is slowest and the quarter that is fastest, once there are eight."""
    fast, slow = [0.25 * k for k in range(5)], [0.25 * 4 + 0.4 * k for k in range(1, 5)]
    assert math.isnan(period_after(*fast, *slow))
    slow = [0.25 * 4 + 0.37 * k for k in range(1, 5)]
    assert period_after(*fast, *slow) == pytest.approx(0.31)


def slow_device() -> ArrivalRate:
    """It has sent twice a second for ten seconds."""
    pace = ArrivalRate()
    for k in range(21):
        pace.late([0.5 * k])
    return pace


@pytest.mark.parametrize(("delay_s", "late"), [(0.06, False), (0.45, False), (0.55, True)])
def test_a_slow_device_may_be_late_by_its_period(delay_s: float, late: bool) -> None:
    assert slow_device().late([10.5 + delay_s]) == [late]


def test_a_slow_device_that_paused_is_believed_after_more_than_its_period() -> None:
    pace = slow_device()
    assert [pace.late([t])[0] for t in (13.0, 13.5, 14.0, 14.5)] == [True, True, False, False]


def test_of_an_unknown_pace_only_the_last_message_of_a_read_is_not_late() -> None:
    pace = ArrivalRate()
    assert pace.late([0.0, 0.0, 0.0]) == [True, True, False] and pace.late([0.1]) == [False]
