"""When a sample was taken: line speed, the device's own clock, late and old messages."""

from __future__ import annotations

import math
import random

import pytest

from acquire.clock import DeviceClock
from acquire.serial_line.arrivals import ArrivalRate, ArrivalTimes


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


def test_the_device_clock_takes_jitter_away() -> None:
    rng, clock = random.Random(1), DeviceClock()
    errors = []
    for k in range(2000):
        true = 50.0 + 0.0125 * k
        t = clock.stamp(12.5 * k, true + rng.expovariate(1 / 0.004)).t
        errors.append(t - true)
    assert max(errors[50:]) - min(errors[50:]) < 0.003, "before the rate is known"
    assert max(errors[800:]) - min(errors[800:]) < 0.0005
    assert 0.003 < clock.jitter_s < 0.007


@pytest.mark.parametrize("drift", [100e-6, -100e-6, 0.0])
def test_drift_is_followed_and_estimated(drift: float) -> None:
    rng, clock = random.Random(2), DeviceClock()
    for k in range(8000):
        true = 50.0 + 0.0125 * k
        t = clock.stamp(12.5 * k * (1 + drift), true + rng.expovariate(1 / 0.002)).t
    assert t - true == pytest.approx(0.0, abs=0.002)
    assert clock.drift == pytest.approx(drift, abs=3e-5)


def test_drift_is_unknown_at_first() -> None:
    clock = DeviceClock()
    assert math.isnan(clock.drift) and math.isnan(clock.jitter_s)
    clock.stamp(0.0, 1.0)
    assert math.isnan(clock.drift)


@pytest.mark.parametrize("uptime_ms", [70.0, 300.0, 5000.0, 4e9], ids=lambda ms: f"up for {ms} ms")
def test_a_restart_is_doubted_until_it_has_settled(uptime_ms: float) -> None:
    clock = DeviceClock()
    for k in range(10):
        clock.stamp(uptime_ms + 10 * k, 1.0 + 0.01 * k)
    stamps = [clock.stamp(10.0 * k, 1.11 + 0.01 * k) for k in range(80)]
    doubtful = [stamp.doubtful for stamp in stamps]
    assert doubtful == [True] * doubtful.index(False) + [False] * (80 - doubtful.index(False))
    assert 0.49 <= 0.01 * doubtful.index(False) <= 0.52
    assert [s.t for s in stamps] == pytest.approx([1.11 + 0.01 * k for k in range(80)], abs=1e-3)
    assert clock.jumps == 1


def test_a_single_wrong_stamp_is_doubted_alone() -> None:
    clock = DeviceClock()
    stamps = [clock.stamp(3.6e6 if k == 5 else 10.0 * k, 1.0 + 0.01 * k) for k in range(10)]
    assert [s.doubtful for s in stamps] == [k == 5 for k in range(10)]
    assert clock.jumps == 0


def test_late_messages_keep_their_own_stamps() -> None:
    clock = DeviceClock()
    for k in range(1000):
        clock.stamp(10.0 * k, 1.0 + 0.01 * k)
    stamps = [clock.stamp(10.0 * k, 14.0) for k in range(1000, 1200)]
    assert not any(s.doubtful for s in stamps)
    assert [s.t for s in stamps] == pytest.approx([1.0 + 0.01 * k for k in range(1000, 1200)], abs=1e-3)


def test_a_device_that_lost_time_is_tied_anew_in_the_end() -> None:
    clock = DeviceClock()
    for k in range(10):
        clock.stamp(10.0 * k, 1.0 + 0.01 * k)
    for k in range(10, 1000):
        last = clock.stamp(10.0 * k, 3.0 + 0.01 * k)
    assert clock.jumps == 1 and last.t == pytest.approx(3.0 + 9.99, abs=1e-3)


PERIOD = 0.0125


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


def test_the_clock_of_a_device_may_be_slow_by_its_bound_before_its_rate_is_known() -> None:
    """By 2 %, of a ceramic resonator; what comes later than that was delayed."""
    clock = DeviceClock()
    clock.stamp(0.0, 100.0)
    assert clock.stamp(1000.0, 101.1).t == pytest.approx(101.02)
    assert clock.stamp(2000.0, 101.9).t == pytest.approx(101.9), "and at once where it comes earlier"
    assert clock.jitter_s == pytest.approx(0.08 / math.sqrt(3))
    clock = DeviceClock(3e-4)
    clock.stamp(0.0, 100.0)
    assert clock.stamp(1000.0, 101.1).t == pytest.approx(101.0003)


def test_the_drift_is_told_from_fifteen_seconds_on() -> None:
    clock = DeviceClock()
    for k in range(15):
        clock.stamp(1000.0 * k * (1 + 1e-4), 100.0 + k)
    assert math.isnan(clock.drift)
    for k in range(15, 17):
        clock.stamp(1000.0 * k * (1 + 1e-4), 100.0 + k)
    assert clock.drift == pytest.approx(1e-4, rel=1e-3)


@pytest.mark.parametrize(("late_s", "doubtful"), [(0.49, False), (3.0, False), (-0.49, False), (-0.51, True)])
def test_a_message_half_a_second_early_is_an_old_one(late_s: float, doubtful: bool) -> None:
    clock = DeviceClock()
    for k in range(10):
        clock.stamp(100.0 * k, 100.0 + 0.1 * k)
    assert clock.stamp(1000.0, 101.0 + late_s).doubtful == doubtful


def test_a_stamp_that_goes_back_is_doubted_however_little() -> None:
    clock = DeviceClock()
    clock.stamp(1000.0, 100.0)
    assert clock.stamp(999.0, 100.0).doubtful and clock.jumps == 0
    assert not clock.stamp(1001.0, 100.001).doubtful


def test_a_clock_is_tied_to_the_least_delayed_of_the_first_messages() -> None:
    clock = DeviceClock()
    clock.begin([(1000.0, 51.0), (1100.0, 51.01), (1200.0, 51.5)])
    assert clock.stamp(1000.0, 51.0).t == pytest.approx(50.91)


def test_a_new_pace_is_one_that_is_kept_to_a_tenth_of_a_second() -> None:
    for wobble_s, jumps in ((0.05, 1), (0.15, 0)):
        clock = DeviceClock()
        clock.stamp(50_000.0, 100.0)
        for k in range(20):
            clock.stamp(100.0 * k, 200.0 + 0.1 * k + wobble_s * (k % 2))
        assert clock.jumps == jumps


def test_messages_that_stay_late_are_believed_for_five_seconds() -> None:
    clock = DeviceClock()
    for k in range(10):
        clock.stamp(100.0 * k, 100.0 + 0.1 * k)
    doubtful = [clock.stamp(100.0 * k, 102.0 + 0.1 * k).doubtful for k in range(10, 70)]
    assert doubtful.index(True) == pytest.approx(50, abs=1)
    assert doubtful[-1] is False and clock.jumps == 1
