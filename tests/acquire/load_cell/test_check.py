"""The ten-second check of a load cell: what it sees, and what it warns of."""

from __future__ import annotations

import math

import pytest

from acquire.load_cell.check import report, report_lines
from acquire.load_sample import LoadCellInfo, LoadFlag, LoadSample

INFO = LoadCellInfo("/dev/ttyUSB0", "a cell", "ascii", capacity_N=500.0)


def steady(count: int = 100, rate: float = 50.0) -> list[LoadSample]:
    """A healthy cell: steps of 0.1 N to and fro."""
    return [LoadSample(k / rate, 100.0 + 0.1 * (k % 3), raw=b"%d" % (k % 3)) for k in range(count)]


def test_a_healthy_cell() -> None:
    found = report(steady(), INFO)
    assert found.ready
    assert found.rate == pytest.approx(50.0)
    assert (found.samples, found.good, found.unique) == (100, 100, 3)
    assert found.step_N == pytest.approx(0.1)
    assert found.of_capacity == pytest.approx(100.2 / 500)
    assert found.mean_N == pytest.approx(100.1, abs=0.01)
    assert set(found.lines) == {b"0", b"1", b"2"}
    assert any("50 1/s" in line for line in report_lines(found))


def test_a_drift_is_no_noise() -> None:
    samples = [LoadSample(k / 50, 1.0 * k) for k in range(100)]
    assert report(samples, INFO).noise_N == pytest.approx(0.0, abs=1e-9)


def changed(samples: list[LoadSample], at: int, sample: LoadSample) -> list[LoadSample]:
    return [*samples[:at], sample, *samples[at + 1 :]]


NAN = math.nan
TROUBLES = {
    "nothing came": [],
    "no value": [LoadSample(k / 10, NAN, flags=LoadFlag.ERROR, raw=b"hello") for k in range(30)],
    "gave no value": changed(steady(), 50, LoadSample(1.0, NAN, flags=LoadFlag.ERROR)),
    "overload or saturated": changed(steady(), 50, LoadSample(1.0, NAN, flags=LoadFlag.OVERLOAD)),
    "samples a second": steady(20, rate=2.0),
    "a gap of": steady(50) + [LoadSample(s.t + 3.0, s.force) for s in steady(50)],
    "every value is the same": [LoadSample(k / 50, 7.0) for k in range(100)],
}


@pytest.mark.parametrize("words", TROUBLES)
def test_each_trouble_is_named(words: str) -> None:
    found = report(TROUBLES[words], INFO)
    assert not found.ready
    assert any(words in remark for remark in found.remarks)
    assert any(words in line for line in report_lines(found))


def test_flags_are_counted() -> None:
    found = report(changed(steady(), 5, LoadSample(0.1, 100.0, flags=LoadFlag.UNSTABLE | LoadFlag.NET)), INFO)
    assert found.flags == (("net", 1), ("unstable", 1))
