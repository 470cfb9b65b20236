"""Sign, zero and capacity of a cell act together, on tension and on compression alike."""

from __future__ import annotations

import math

import pytest

from acquire.addresses import parse_address
from acquire.load_sample import LoadFlag
from acquire.protocols.base import Reading
from acquire.serial_line.scaling import Scaling, TareZero
from acquire.serial_line.settings import read_settings
from tests.acquire.serial_line.fake_port import FakeLine

FIRST = b"partial\r\n"


@pytest.mark.parametrize(
    ("address", "force"),
    [
        ("unit=N&zero=3", 2.0),
        ("unit=N&zero=3&sign=-1", -2.0),
        ("gain=0.5&zero=3", 1.0),
        ("unit=kN&zero=3", 2000.0),
    ],
)
def test_the_zero_is_one_of_the_line(address: str, force: float) -> None:
    (sample,) = FakeLine([FIRST, b"5\r\n"], address=f"/dev/fake?{address}").run()
    assert sample.force == pytest.approx(force)


@pytest.mark.parametrize(
    ("value", "flag"),
    [(b"101", LoadFlag.OVERLOAD), (b"-101", LoadFlag.UNDERLOAD), (b"99", None), (b"-99", None)],
)
def test_beyond_the_capacity_there_is_no_force(value: bytes, flag: LoadFlag | None) -> None:
    (sample,) = FakeLine([FIRST, value + b"\r\n"], address="/dev/fake?unit=N&capacity=100").run()
    assert math.isnan(sample.force) == (flag is not None)
    assert (LoadFlag.OUT_OF_RANGE in sample.flags) == (flag is not None)
    assert flag is None or flag in sample.flags


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


def test_the_last_digit_is_the_smallest_that_the_display_has_shown() -> None:
    """In newtons: a hundredth of a kilonewton, also while the value ends in a zero."""
    scaling = Scaling(read_settings(parse_address("/dev/fake?unit=kN")), lambda level, text: None)
    for value in (12.3, 12.25, 12.0):
        scaling.sample(Reading(value, None, b"", 0), 0.0)
    assert scaling.zero.step_N == pytest.approx(10.0)


def test_where_zero_moved_the_next_force_is_no_step() -> None:
    """Whatever it is: an undone tare brings the load of before back."""
    scaling = Scaling(read_settings(parse_address("/dev/fake?unit=N&max_step=10")), lambda level, text: None)

    def steps(value: float) -> bool:
        return LoadFlag.STEP in scaling.sample(Reading(value, None, b"", 0), 0.0).flags

    assert [steps(50.0), steps(59.0), steps(70.0)] == [False, False, True]
    scaling.tared()
    assert [steps(300.0), steps(311.0)] == [False, True]
