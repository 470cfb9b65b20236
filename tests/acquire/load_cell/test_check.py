"""The ten-second check of a load cell: what it sees, and what it warns of."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator

import pytest

from acquire.load_cell.check import Heard, LoadReport, listen, report_lines
from acquire.load_cell.check import report as report_heard
from acquire.load_cell.none import NoLoadCell
from acquire.load_sample import LoadCellInfo, LoadFlag, LoadSample

INFO = LoadCellInfo("/dev/ttyUSB0", "a cell", "ascii", capacity_N=500.0)


def report(samples: list[LoadSample], info: LoadCellInfo = INFO, seconds: float = 0.0) -> LoadReport:
    """Of samples from 0 s on, listened to until the last of them or for so many seconds."""
    last = samples[-1].t if samples else 1.0
    return report_heard(Heard(tuple(samples), 0.0, max(seconds, last)), info)


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


def test_a_triangle_of_load_is_neither_noise_nor_ready() -> None:
    rng = random.Random(1)
    samples = [LoadSample(k / 50, 548.0 - 2.192 * abs(k - 250) + rng.gauss(0, 1.0)) for k in range(500)]
    found = report(samples)
    assert found.noise_N == pytest.approx(1.0, rel=0.2)
    assert not found.ready and any("ran between" in remark for remark in found.remarks)


def test_noise_is_no_movement() -> None:
    rng = random.Random(2)
    assert report([LoadSample(k / 50, 100.0 + rng.gauss(0, 1.0)) for k in range(500)]).ready


def test_silence_at_the_end_is_seen() -> None:
    found = report(steady(15), seconds=10.0)
    assert found.silent_s == pytest.approx(10 - 14 / 50)
    assert not found.ready and "silence for the last 9.72 s" in found.remarks[0]


def test_lines_are_told_in_their_order() -> None:
    samples = [LoadSample(k / 50, k, raw=b"%d" % k) for k in range(100)]
    assert report(samples).lines == (b"95", b"96", b"97", b"98", b"99")


def test_a_recording_has_its_own_time() -> None:
    with FinishedCell(steady(100)) as cell:
        heard = listen(cell, 5.0)
    assert (heard.began, heard.ended) == (0.0, 99 / 50)


class FinishedCell(NoLoadCell):
    """Gives the samples of a list."""

    def __init__(self, samples: list[LoadSample]) -> None:
        self._samples = samples

    def __iter__(self) -> Iterator[LoadSample]:
        return iter(self._samples)


def changed(samples: list[LoadSample], at: int, sample: LoadSample) -> list[LoadSample]:
    return [*samples[:at], sample, *samples[at + 1 :]]


NAN = math.nan
TROUBLES = {
    "nothing came": [],
    "no value": [LoadSample(k / 10, NAN, flags=LoadFlag.ERROR, raw=b"hello") for k in range(30)],
    "gave no value": changed(steady(), 50, LoadSample(1.0, NAN, flags=LoadFlag.ERROR)),
    "overload or saturated": changed(steady(), 50, LoadSample(1.0, NAN, flags=LoadFlag.OVERLOAD)),
    "samples a second": steady(20, rate=2.0),
    "silence for the last": [*steady(50), LoadSample(5.0, NAN, flags=LoadFlag.ERROR)],
    "ran between": [LoadSample(k / 50, 1.0 * k) for k in range(100)],
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
