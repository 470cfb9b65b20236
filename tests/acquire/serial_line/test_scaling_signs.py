"""Sign, zero and capacity of a cell act together, on tension and on compression alike."""

from __future__ import annotations

import math

import pytest

from acquire.addresses import parse_address
from acquire.load_sample import LoadFlag
from acquire.protocols.base import Reading
from acquire.serial_line.scaling import Scaling, TareZero
from acquire.serial_line.settings import read_settings
from tests.acquire.serial_line.fake_port import samples_of


@pytest.mark.parametrize(
    ("address", "force"),
    [
        ("unit=N", 5.0),
        ("unit=N&sign=-1", -5.0),
        ("unit=N&zero=3", 2.0),
        ("unit=N&zero=3&sign=-1", -2.0),
        ("gain=0.5&zero=3", 1.0),
        ("unit=kN&zero=3", 2000.0),
    ],
)
def test_sign_and_zero_are_of_the_line(address: str, force: float) -> None:
    (sample,) = samples_of(b"5\r\n", address=f"/dev/fake?{address}")
    assert sample.force == pytest.approx(force)


@pytest.mark.parametrize(
    ("value", "flags"),
    [
        (101, LoadFlag.OVERLOAD | LoadFlag.OUT_OF_RANGE),
        (-101, LoadFlag.UNDERLOAD | LoadFlag.OUT_OF_RANGE),
        (99, LoadFlag.NONE),
        (-99, LoadFlag.NONE),
    ],
)
def test_beyond_the_capacity_there_is_no_force(value: int, flags: LoadFlag) -> None:
    (sample,) = samples_of(b"%d\r\n" % value, address="/dev/fake?unit=N&capacity=100")
    assert (sample.flags, math.isnan(sample.force)) == (flags, bool(flags))


def seen(period_s: float, seconds: float, step_s: float = 0.0) -> TareZero:
    """A still load of 10 N, until now (0 s); 30 N until ``step_s`` before that."""
    zero = TareZero()
    for k in range(round(seconds / period_s), -1, -1):
        zero.saw(-k * period_s, 30.0 if -k * period_s < -step_s < 0 else 10.0)
    return zero


@pytest.mark.parametrize(
    ("period_s", "step_s", "why"),
    [
        (0.0125, 0.6, ""),  # half a second counts
        (0.0125, 0.4, "the load is not still"),
        (0.5, 0.0, ""),  # of a slow device a few samples
        (2.0, 0.0, "only 2 samples in the last 3.0 s"),
    ],
)
def test_a_tare_looks_at_half_a_second_or_a_few_samples(period_s: float, step_s: float, why: str) -> None:
    assert seen(period_s, 20.0, step_s).why_not(0.0).partition(":")[0] == why


def test_a_tare_takes_the_mean_of_half_a_second() -> None:
    zero = TareZero()
    for t, gross in ((0.0, 100.0), (0.4, 10.0), (0.6, math.nan), (0.8, 14.0)):
        zero.saw(t, gross)
    assert zero.load() == 12.0


def scaling(address: str) -> tuple[Scaling, list[tuple[str, str]]]:
    told: list[tuple[str, str]] = []
    settings = read_settings(parse_address(f"/dev/fake?{address}"))
    return Scaling(settings, lambda level, text: told.append((level, text))), told


def reading(value: float, unit: str | None = None, flags: LoadFlag = LoadFlag.NONE) -> Reading:
    return Reading(value, unit, b"", 0, flags=flags)


@pytest.mark.parametrize(
    ("address", "values", "step_N"),
    [
        pytest.param("unit=kN", (12.3, 12.25, 12.0), 10.0, id="also while the value ends in a zero"),
        pytest.param("gain=-2", (12.34,), 0.02, id="without a sign"),
    ],
)
def test_the_last_digit_is_the_smallest_that_the_display_has_shown(
    address: str, values: tuple[float, ...], step_N: float
) -> None:
    made, _ = scaling(address)
    for value in values:
        made.sample(reading(value), 0.0)
    assert made.zero.step_N == pytest.approx(step_N)


def test_a_step_is_one_beyond_the_greatest_but_where_zero_moved() -> None:
    """Whatever it is then: an undone tare brings the load of before back."""
    made, _ = scaling("unit=N&max_step=10")

    def steps(*values: float) -> list[bool]:
        return [LoadFlag.STEP in made.sample(reading(value), 0.0).flags for value in values]

    assert steps(50.0, 60.0, 70.001, 60.0, 50.0) == [False, False, True, True, False]
    made.tared()
    assert steps(300.0, 311.0) == [False, True]


def test_the_tares_of_a_test_are_undone_one_by_one_each_by_what_it_took() -> None:
    zero = TareZero()
    taken = []
    for k, gross in enumerate((10.0, 25.0, 5.0)):
        zero.saw(10.0 * k, gross)
        taken.append(zero.take())
    assert (taken, zero.offset) == ([10.0, 15.0, -20.0], 5.0)
    assert [zero.undo() for _ in range(4)] == [20.0, -15.0, -10.0, None]
    assert zero.offset == 0.0


def test_a_tare_in_the_device_counts_from_the_offset_that_was_there() -> None:
    """10 N were taken off here; then the device is tared under 25 N, of which 15 N are shown."""
    zero = TareZero()
    zero.saw(0.0, 10.0)
    zero.take()
    zero.saw(10.0, 25.0)
    assert zero.moved_in_device() == 15.0 and zero.offset == 0.0
    assert math.isnan(zero.load()), "what was seen before is void"
    assert zero.undo() == -15.0 and zero.offset == -15.0
    assert zero.undo() == -10.0 and zero.offset == -25.0
    assert zero.undo() is None


def test_a_tare_in_the_device_under_an_unknown_load_cannot_be_undone() -> None:
    zero = TareZero()
    zero.saw(0.0, 10.0)
    zero.take()
    zero.saw(10.0, math.nan)
    zero._seen.popleft()
    assert math.isnan(zero.moved_in_device()) and zero.undo() is None


def test_sixteen_tares_can_be_undone_and_4096_samples_are_kept() -> None:
    zero = TareZero()
    for k in range(5000):
        zero.saw(0.001 * k, float(k))
    assert len(zero._seen) == 4096
    for _ in range(20):
        zero.take()
    assert sum(zero.undo() is not None for _ in range(20)) == 16


def test_a_second_tare_looks_at_the_gross_load() -> None:
    made, _ = scaling("unit=N")
    made.zero.offset = 100.0
    for k in range(3):
        made.sample(reading(130.0), 0.1 * k)
    assert made.zero.load() == 130.0
    assert made.sample(reading(130.0), 0.4).force == 30.0


def test_a_reading_that_waited_is_none_to_tare_on() -> None:
    made, _ = scaling("unit=N")
    made.sample(reading(500.0), 0.0, LoadFlag.STALE)
    made.sample(reading(math.nan, flags=LoadFlag.ERROR), 0.0)
    assert math.isnan(made.zero.load())
    made.sample(reading(7.0), 0.1)
    assert made.zero.load() == 7.0


def test_beyond_the_range_is_told_once_and_its_end_too() -> None:
    """Of a device that marks its own overload the force beyond the capacity stays."""
    made, told = scaling("protocol=mt-sics&capacity=100")
    values = (99.0, 100.0, -100.5, 120.0, math.nan, 99.0)
    flags = [made.sample(reading(value, "N"), 0.0).flags for value in values]
    assert [LoadFlag.OUT_OF_RANGE in one for one in flags] == [False, False, True, True, False, False]
    assert told == [
        ("error", "load alarm: out of range; last valid sample −100.5 N"),
        ("info", "the load is within its range again"),
    ]


def test_an_alarm_before_any_force_says_so() -> None:
    made, told = scaling("unit=N&capacity=100")
    made.sample(reading(-200.0), 0.0)
    assert told == [("error", "load alarm: underload, out of range; no valid sample before")]


def test_a_unit_that_changes_is_told_each_time() -> None:
    made, told = scaling("")
    for unit in ("N", "N", "kN", "kN", "N"):
        made.sample(reading(1.0, unit), 0.0)
    assert told == [
        ("warning", "the unit on the line changed from N to kN"),
        ("warning", "the unit on the line changed from kN to N"),
    ]
