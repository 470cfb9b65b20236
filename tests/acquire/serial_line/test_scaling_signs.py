"""Sign, zero and capacity of a cell act together, on tension and on compression alike."""

from __future__ import annotations

import math

import pytest

from acquire.load_sample import LoadFlag
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
