"""A device's clock: jitter, rate, turns, restarts and pauses, and what it counts; by value, on made times."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from acquire.clock import ClockUnit, DeviceClock
from acquire.load_sample import LoadFlag
from tests.acquire.serial_line.fake_port import FakeLine

Times = NDArray[np.float64]
MS = 1e-3


def ticking(count: int, step_ms: float = 10.0, began: float = 1.0) -> DeviceClock:
    """A clock that has had so many stamps without jitter."""
    clock = DeviceClock()
    for k in range(count):
        clock.stamp(step_ms * k, began + step_ms * MS * k)
    return clock


def test_it_takes_jitter_away() -> None:
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


def test_the_drift_is_told_from_fifteen_seconds_on() -> None:
    clock = DeviceClock()
    assert math.isnan(clock.drift) and math.isnan(clock.jitter_s)
    for k in range(17):
        assert math.isnan(clock.drift) or k > 15
        clock.stamp(1000.0 * k * (1 + 1e-4), 100.0 + k)
    assert clock.drift == pytest.approx(1e-4, rel=1e-3)


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
    clock = ticking(1000)
    stamps = [clock.stamp(10.0 * k, 14.0) for k in range(1000, 1200)]
    assert not any(s.doubtful for s in stamps)
    assert [s.t for s in stamps] == pytest.approx([1.0 + 0.01 * k for k in range(1000, 1200)], abs=1e-3)


def test_messages_that_stay_late_are_believed_for_five_seconds_and_tied_anew() -> None:
    clock = ticking(10, 100.0)
    stamps = [clock.stamp(100.0 * k, 3.0 + 0.1 * k) for k in range(10, 70)]
    doubtful = [stamp.doubtful for stamp in stamps]
    assert doubtful.index(True) == pytest.approx(50, abs=1)
    assert doubtful[-1] is False and clock.jumps == 1
    assert stamps[-1].t == pytest.approx(3.0 + 6.9, abs=1e-3)


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


@pytest.mark.parametrize(("late_s", "doubtful"), [(0.49, False), (3.0, False), (-0.49, False), (-0.51, True)])
def test_a_message_half_a_second_early_is_an_old_one(late_s: float, doubtful: bool) -> None:
    assert ticking(10, 100.0).stamp(1000.0, 2.0 + late_s).doubtful == doubtful


def test_a_stamp_that_goes_back_is_doubted_however_little() -> None:
    clock = DeviceClock()
    clock.stamp(1000.0, 100.0)
    assert clock.stamp(999.0, 100.0).doubtful and clock.jumps == 0
    assert not clock.stamp(1001.0, 100.001).doubtful


def test_it_is_tied_to_the_least_delayed_of_the_first_messages() -> None:
    clock = DeviceClock()
    clock.begin([(1000.0, 51.0), (1100.0, 51.01), (1200.0, 51.5)])
    assert clock.stamp(1000.0, 51.0).t == pytest.approx(50.91)


def test_first_messages_that_waited_together_do_not_make_it_jump() -> None:
    clock = DeviceClock()
    waited = [
        (1000.0 + 12.5 * k, 51.0 + 0.001 * k) for k in range(80)
    ]  # ms; all came in the moment they were read
    clock.begin(waited)
    stamps = [clock.stamp(ms, t) for ms, t in waited]
    later = [clock.stamp(2000.0 + 12.5 * k, 51.0876 + 0.0125 * k) for k in range(400)]
    assert clock.jumps == 0 and not any(stamp.doubtful for stamp in stamps + later)
    assert abs(later[-1].t - stamps[0].t - (2.000 + 399 * 0.0125 - 1.0)) < 0.01


def test_a_new_pace_is_one_that_is_kept_to_a_tenth_of_a_second() -> None:
    for wobble_s, jumps in ((0.05, 1), (0.15, 0)):
        clock = DeviceClock()
        clock.stamp(50_000.0, 100.0)
        for k in range(20):
            clock.stamp(100.0 * k, 200.0 + 0.1 * k + wobble_s * (k % 2))
        assert clock.jumps == jumps


def usb(true: Times, rng: np.random.Generator) -> Times:
    """Frames of 1 ms."""
    return np.ceil(true / MS) * MS + rng.exponential(0.2 * MS, true.size)


def latency_timer(true: Times, rng: np.random.Generator) -> Times:
    """The adapter sends what it has every 16 ms."""
    return np.ceil(true / (16 * MS)) * 16 * MS + rng.exponential(0.3 * MS, true.size)


def packets(true: Times, rng: np.random.Generator) -> Times:
    """The device sends the lines of a second at once."""
    size = round(1 / float(np.median(np.diff(true))))
    last = np.minimum((np.arange(true.size) // size + 1) * size - 1, true.size - 1)
    return true[last] + 1 * MS


def busy(true: Times, rng: np.random.Generator) -> Times:
    """The machine is loaded between 20 s and 40 s."""
    loaded = (true > 120) & (true < 140)
    return true + rng.exponential(1 * MS, true.size) + loaded * rng.exponential(20 * MS, true.size)


def stalls(true: Times, rng: np.random.Generator) -> Times:
    """Nobody reads for 0.2 s, once in three seconds."""
    return np.where(true % 3 < 0.2, np.ceil(true) - 0.8 + 1e-3 + true % 3 * 1e-3, true + 0.5 * MS)


@dataclass
class Run:
    since: Times  # the beginning, s
    error: Times  # of the stamps, s
    late: Times  # the arrivals, s


def run(
    arrivals: Callable[[Times, np.random.Generator], Times],
    hz: float,
    rate: float,
    seconds: float = 60.0,
    drift: float = 0.0,
) -> Run:
    """A device whose clock counts ``1 + rate`` (and ``drift`` more each second) milliseconds a millisecond."""
    rng = np.random.default_rng(1)
    own = np.arange(round(hz * seconds)) / hz
    true = 100.0003 + own / (1 + rate) - drift * own**2 / 2
    arrived = np.maximum.accumulate(arrivals(true, rng))
    counts = np.floor((own + 5) / MS)
    clock = DeviceClock()
    clock.begin([(c, a) for c, a in zip(counts, arrived, strict=True) if a == arrived[0]])
    stamps = [clock.stamp(float(c), float(a)) for c, a in zip(counts, arrived, strict=True)]
    assert not any(stamp.doubtful for stamp in stamps)
    return Run(true - 100, np.array([stamp.t for stamp in stamps]) - true, arrived - true)


TICK = 1.3 * MS  # the device gives whole milliseconds


@pytest.mark.parametrize("rate", [-0.01, -0.0055, 0.0, 0.003, 0.01])
@pytest.mark.parametrize("hz", [10, 100])
@pytest.mark.parametrize("arrivals", [usb, latency_timer, packets, busy, stalls])
def test_a_time_is_never_worse_than_the_arrival_and_right_after_half_a_minute(
    arrivals: Callable[[Times, np.random.Generator], Times], hz: float, rate: float
) -> None:
    found = run(arrivals, hz, rate)
    for second in range(60):
        within = (found.since >= second) & (found.since < second + 1)
        assert np.abs(found.error[within]).max() <= max(found.late[within].max(), TICK) + 1e-9
    assert np.abs(found.error[found.since > 30]).max() < 5 * MS
    assert np.all(found.error <= found.late + 1e-9)


@pytest.mark.parametrize("drift", [2e-6, -2e-6])
def test_a_rate_that_drifts_with_temperature_is_followed(drift: float) -> None:
    """By 120 us/s in a minute, as a resonator that warms up by several kelvin a minute."""
    found = run(usb, 40, 0.003, 300.0, drift)
    assert np.abs(found.error[found.since > 30]).max() < 5 * MS


@pytest.mark.parametrize("pause_s", [3.0, 60.0, 600.0])
@pytest.mark.parametrize("after_s", [1.0, 40.0])
@pytest.mark.parametrize("rate", [-0.008, 0.008])
def test_after_a_pause_the_times_go_on(rate: float, after_s: float, pause_s: float) -> None:
    rng, clock = random.Random(3), DeviceClock()
    for k in range(round(80 * (after_s + 20))):
        own = k / 80 + (pause_s if k > 80 * after_s else 0.0)
        true = 100 + own / (1 + rate)
        late = rng.expovariate(1000)
        stamp = clock.stamp(1000 * own, true + late)
        assert not stamp.doubtful and true - 1 * MS < stamp.t <= true + late + 1e-9
    assert clock.jumps == 0


@pytest.mark.parametrize("turn_ms", [2**32, 2**32 / 1000], ids=["millis", "micros"])
@pytest.mark.parametrize("rate", [0.0, -0.006])
def test_a_counter_of_32_bits_begins_again(turn_ms: float, rate: float) -> None:
    clock = DeviceClock()
    for k in range(4000):
        true = 100 + k / 50
        own = (1000 * (true - 100) * (1 + rate) + turn_ms - 40_000) % turn_ms
        stamp = clock.stamp(own, true + 0.2 * MS)
        assert not stamp.doubtful and stamp.t == pytest.approx(true, abs=1 * MS)
    assert clock.jumps == 0


def test_a_board_that_restarts_has_its_rate_learned_anew() -> None:
    rng, clock, wrong = random.Random(4), DeviceClock(), 0
    for k in range(80 * 100):
        true = 100 + k / 80
        own = (true - 100 if true < 140 else true - 139.5) * (1 - 0.006)
        stamp = clock.stamp(1000 * own, true + rng.expovariate(1000))
        wrong += stamp.doubtful
        assert stamp.doubtful or stamp.t == pytest.approx(true, abs=(5 if true < 144 else 2) * MS)
    assert wrong <= 42 and clock.jumps == 1, "half a second of doubt"


def looked(
    counts_per_s: float, seconds: float = 30.0, hz: float = 20.0, whole: bool = True
) -> tuple[ClockUnit, list[str]]:
    unit, told = ClockUnit(), []
    for k in range(round(hz * seconds)):
        count = (k / hz + 100) * counts_per_s
        told.append(unit.look(math.floor(count) if whole else count, 50 + k / hz + 0.002 * (k % 3)))
    return unit, [text for text in told if text]


@pytest.mark.parametrize("hz", [1.0, 20.0, 500.0])
@pytest.mark.parametrize("rate", [0.99, 1.0, 1.01])
def test_the_pace_tells_what_is_counted(rate: float, hz: float) -> None:
    for per_s, ms, words in ((1000, 1.0, ""), (1e6, 1e-3, "microseconds"), (1.0001, 1e3, "seconds")):
        unit, told = looked(per_s * rate, hz=hz, whole=per_s > 10)
        assert unit.ms == ms
        assert [words in text for text in told] == ([True] if words else [])


@pytest.mark.parametrize("per_s", [0.0, 20.0, 100.0, 700.0, 930.0, 1070.0, 1400.0, 1e4, -1000.0, -1e6])
def test_what_is_no_clock_is_refused_in_words(per_s: float) -> None:
    unit, told = looked(per_s)
    assert unit.ms is None
    assert len(told) == 1 and "no clock" in told[0] and "millis=" in told[0]


def test_whole_seconds_are_too_coarse() -> None:
    unit, told = looked(1.0)
    assert unit.ms is None and "whole seconds" in told[0]


def test_any_numbers_are_no_clock() -> None:
    rng, unit = random.Random(5), ClockUnit()
    told = [unit.look(rng.uniform(-1e6, 1e6), 50 + k / 20) for k in range(100)]
    assert unit.ms is None and sum(map(bool, told)) == 1


def test_a_stall_of_this_machine_or_a_restart_of_the_board_do_not_change_what_is_counted() -> None:
    unit = ClockUnit()
    for k in range(600):
        late = max(2.4 - k / 20, 0.0) if k else 0.0  # all of two seconds came together
        count = 1000 * (k / 20 + (40 if k < 100 else 0))
        assert unit.look(count, 50 + k / 20 + late) == ""
    assert unit.ms == 1.0


def lines(per_s: float, rows: int = 200) -> list[bytes | Exception]:
    return [f"{math.floor((k / 100 + 7) * per_s)},{k} N\r\n".encode() for k in range(rows)]


@pytest.mark.parametrize(("per_s", "device_ms"), [(1e3, True), (1e6, True), (1.0, False), (80.0, False)])
def test_no_unit_of_the_devices_time_leaves_a_test_without_forces(per_s: float, device_ms: bool) -> None:
    address = "/dev/fake?millis=1&column=2&unit=N&wire=no"
    line = FakeLine([b"partial\r\n", *lines(per_s, 600)], address=address)
    samples = line.run()
    settled = samples[400:]
    assert not any(LoadFlag.STALE in sample.flags for sample in settled)
    assert [sample.t for sample in settled] == pytest.approx(
        [100.02 + 0.01 * sample.force for sample in settled], abs=2 * MS
    )
    if device_ms:
        assert settled[-1].device_ms == pytest.approx(1000 * (settled[-1].force / 100 + 7), abs=1)
    else:
        assert settled[-1].device_ms is None
    assert sum("own time" in text for text in line.told) == (per_s != 1e3)
