"""The check of a load cell, its calibration with known loads, and noise apart from movement."""

from __future__ import annotations

import dataclasses
import math
import random
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError, DataError
from acquire.load_cell import LoadStillness, stillness
from acquire.load_cell.calibration import Point, fit, load, point, save
from acquire.load_cell.check import ListenResult, LoadReport, _as_of_now, listen, report_lines
from acquire.load_cell.check import report as report_heard
from acquire.load_cell.contract import NoLoadCell
from acquire.load_sample import LoadCellInfo, LoadFlag, LoadSample
from acquire.serial_line.settings import read_settings
from tests.acquire.serial_line.fake_port import FakeLine

INFO = LoadCellInfo("/dev/ttyUSB0", "a cell", "ascii", capacity_N=500.0)


def report(samples: list[LoadSample], info: LoadCellInfo = INFO, seconds: float = 0.0) -> LoadReport:
    """Of samples from 0 s on, listened to until the last of them or for so many seconds."""
    last = samples[-1].t if samples else 1.0
    return report_heard(ListenResult(tuple(samples), 0.0, max(seconds, last)), info)


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


@pytest.mark.parametrize(
    ("mean", "noise", "text"),
    [
        (0.00440252, 0.968, "0.004"),
        (-0.023013, 1.03, "−0.02"),
        (-0.001, 1.03, "0.00"),
        (12345.678, 140.0, "12\u202f346"),
        (2.5, 0.0, "2.5"),
        (2.5, math.nan, "2.5"),
    ],
)
def test_the_mean_has_no_more_digits_than_the_noise_allows(mean: float, noise: float, text: str) -> None:
    assert dataclasses.replace(report(steady()), mean_N=mean, noise_N=noise).mean_text == text


def test_a_triangle_of_load_is_neither_noise_nor_ready() -> None:
    rng = random.Random(1)
    noise = [rng.gauss(0, 1.0) for _ in range(500)]
    assert report([LoadSample(k / 50, 100.0 + one) for k, one in enumerate(noise)]).ready
    found = report([LoadSample(k / 50, 548.0 - 2.192 * abs(k - 250) + one) for k, one in enumerate(noise)])
    assert found.noise_N == pytest.approx(1.0, rel=0.2)
    assert not found.ready and any("ran between" in remark for remark in found.remarks)


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


NOW = datetime(2026, 5, 9, 12, tzinfo=UTC)
POINTS = [Point(0.0, 100.0, 1.0, 100), Point(50.0, 1100.0, 1.0, 100), Point(0.0, 104.0, 1.0, 100)]


def test_the_line_and_its_residual() -> None:
    found = fit(POINTS, NOW)
    assert found.gain == pytest.approx(50 / 998)
    assert found.zero == pytest.approx(102.0)
    assert found.residual_N == pytest.approx(2 * 50 / 998)


def test_a_point_is_the_mean_and_the_scatter_of_its_readings_with_a_number() -> None:
    assert point(5.0, [1.0, math.nan, 1.0, 4.0, 4.0, math.inf]) == Point(5.0, 2.5, 1.5, 4)
    with pytest.raises(DataError, match="no reading"):
        point(5.0, [math.nan])


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (POINTS[:1], "two different loads"),
        ([POINTS[0], POINTS[2]], "two different loads"),
        ([Point(0, 100, 1, 10), Point(50, 100.1, 1, 10)], "do not change"),
    ],
)
def test_what_is_no_calibration(points: list[Point], words: str) -> None:
    with pytest.raises(DataError, match=words):
        fit(points)


def test_the_file_comes_back_and_is_never_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "cal.toml"
    found = fit(POINTS, NOW)
    save(found, path, address := r'/dev/ttyUSB0?protocol="odd"\n')
    assert load(str(path)) == replace(found, address=address)
    assert "2026-05-09T12:00:00+00:00" in path.read_text()
    with pytest.raises(DataError, match="not overwritten"):
        save(found, path, "")


def test_an_address_uses_it(tmp_path: Path) -> None:
    path = tmp_path / "cal.toml"
    save(fit(POINTS, NOW), path, "")
    line = FakeLine([b"x\r\n", b"1100\r\n"], address=f"/dev/fake?calibration={path}")
    assert [s.force for s in line.run()] == pytest.approx([50.0, 50.0][:1], abs=0.11)
    stored = line.cell.info.settings["calibration"]
    assert stored["date"].startswith("2026-05-09") and len(stored["points"]) == 3


def test_a_calibration_carries_the_sign(tmp_path: Path) -> None:
    path = tmp_path / "cal.toml"
    save(fit([Point(0, 0.0, 0, 1), Point(10, -20.0, 0, 1)], NOW), path, "")
    line = FakeLine([b"x\r\n", b"-20 N\r\n"], address=f"/dev/fake?protocol=mark10&calibration={path}")
    assert [s.force for s in line.run()] == pytest.approx([10.0])
    with pytest.raises(ConfigError, match="leave out sign"):
        read_settings(parse_address(f"/dev/fake?sign=-1&calibration={path}"))


@pytest.mark.parametrize(
    "text", ["", "gain = 1", "gain = 0.0\nzero=0\nresidual_N=0\ndate='x'\npoints=[]", "[[[", None]
)
def test_another_file_or_none_is_refused(tmp_path: Path, text: str | None) -> None:
    path = tmp_path / "cal.toml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ConfigError, match=r"cal.toml" if text is not None else "No such file"):
        load(str(path))


N = 40
T = np.arange(N) / 80
NOISE = np.random.default_rng(1).standard_normal(N)

STILL = {
    "constant": np.full(N, 7.0),
    "noise": 100 + NOISE,
    "noise on a display": np.round(100 + NOISE, 1),
    "a last digit that flickers": 100 + 0.1 * (np.arange(N) % 7 == 0),
    "a small offset of a large load": 1e6 + NOISE,
}
MOVING = {
    "a ramp": 20.0 * T,
    "a ramp in noise": 200.0 * T + NOISE,
    "a step": np.where(T < 0.2, 0.0, 50.0) + NOISE,
    "a step at the end": np.where(np.arange(N) < N - 1, 0.0, 50.0) + NOISE,
    "a slow swing": 30 * np.sin(12 * T) + NOISE,
    "a fall of a sawtooth": (500 * T + 300) % 400 + 0.3 * NOISE,
}


@pytest.mark.parametrize("name", [*STILL, *MOVING])
def test_still_or_moving(name: str) -> None:
    assert stillness(T, (STILL | MOVING)[name]).still == (name in STILL)


def test_noise_is_measured_beside_a_ramp() -> None:
    t = np.arange(2000) / 80
    found = stillness(t, 30 * t + np.random.default_rng(2).standard_normal(2000))
    assert found.noise_N == pytest.approx(1.0, rel=0.1)
    assert found.moved_N == pytest.approx(30 * t[-1], rel=0.01)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_say_nothing(count: int) -> None:
    found = stillness(np.arange(count), np.zeros(count))
    assert not found.still and math.isnan(found.noise_N)


def test_a_known_digit_may_change_once() -> None:
    once = np.where(T < 0.3, 10.0, 10.1)
    assert not stillness(T, once).still
    assert stillness(T, once, step_N=0.1).still


def test_noise_alone_is_seldom_taken_for_movement() -> None:
    rng = np.random.default_rng(3)
    for n, most in ((5, 100), (12, 40), (40, 10)):
        t = np.arange(n) / 80
        assert sum(not stillness(t, rng.standard_normal(n)).still for _ in range(1000)) < most


def test_the_figures_of_a_report_by_value() -> None:
    """A cell pressed to 80 % of its capacity; one line of 20 came 60 ms late."""
    forces = [-400.0, -399.0, -398.5, -399.5] * 5
    samples = [LoadSample(k / 50 + 0.06 * (k >= 10), force) for k, force in enumerate(forces)]
    found = report(samples, INFO, seconds=1.0)
    assert (found.lowest_N, found.highest_N, found.step_N) == (-400.0, -398.5, 0.5)
    assert found.of_capacity == pytest.approx(0.8)
    assert found.rate == pytest.approx(19 / (19 / 50 + 0.06))
    assert found.jitter_s == pytest.approx(np.std([0.02] * 18 + [0.08]))
    assert found.longest_s == found.silent_s == pytest.approx(1 - 0.44)
    assert report(samples).longest_s == pytest.approx(0.08)


def test_the_movement_is_between_the_means_of_tenths_of_the_time() -> None:
    forces = [10.0] * 40 + [13.0, 15.0] * 5 + [10.0] * 50
    samples = [LoadSample(k / 10, force) for k, force in enumerate(forces)]
    assert report(samples, seconds=10.0).moved_N == pytest.approx(4.0)


def test_a_slow_cell_has_no_gaps_as_long_as_it_keeps_its_pace() -> None:
    """Of a device that sends twice a second five of its own periods are a gap; of a fast one a quarter of a second."""
    assert report(steady(20, rate=2.0)).remarks[0].startswith("only 2 samples a second")
    assert len(report(steady(20, rate=2.0)).remarks) == 1
    for rate, gap, named in ((2.0, 2.4, False), (2.0, 2.9, True), (50.0, 0.2, False), (50.0, 0.3, True)):
        late = [dataclasses.replace(one, t=one.t + gap - 1 / rate) for one in steady(99, rate)[50:]]
        remarks = report([*steady(50, rate), *late]).remarks
        assert any("a gap of" in one for one in remarks) == named, (rate, gap)


def test_an_underload_is_as_far_beyond_the_range_as_an_overload() -> None:
    found = report(changed(steady(), 50, LoadSample(1.0, NAN, flags=LoadFlag.UNDERLOAD)))
    assert found.remarks == ("1 samples in overload or saturated: unload the cell, or check its wiring",)


@pytest.mark.parametrize(
    ("n", "moved", "reach", "still"),
    [
        (2, 0.0, 0.0, False),
        (3, 0.0, 0.0, True),
        (48, 3.5, 5.0, True),  # 5 sqrt(12 / 48) times the noise, and two digits
        (48, 3.51, 5.0, False),
        (48, -3.51, 5.0, False),
        (1200, 2.0, 5.0, True),  # the noise, and two digits
        (1200, 2.01, 5.0, False),
        (48, 0.0, 11.5, True),  # ten times the noise, and three digits
        (48, 0.0, 11.51, False),
    ],
)
def test_how_far_a_still_load_may_go(n: int, moved: float, reach: float, still: bool) -> None:
    assert LoadStillness(n, 100.0, 1.0, 0.5, moved, reach).still == still


def test_of_twelve_values_a_single_odd_one_does_not_count() -> None:
    def noise(n: int) -> float:
        return stillness(np.arange(n), np.where(np.arange(n) == n // 2, 10.0, 0.0)).noise_N

    assert noise(12) == 0.0
    assert noise(11) == pytest.approx(math.sqrt(600 / 9 / 6)), (
        "of fewer the mean square of second differences"
    )


def test_noise_is_the_median_of_second_differences() -> None:
    """0, 1, 3, 3, 1, 0 and again: second differences of 1 and 2, of which the median is 1.5, 3/2 sigma over sqrt 6."""
    values = [0.0, 1.0, 3.0, 3.0, 1.0, 0.0] * 3
    second = np.abs(np.diff(values, 2))
    expected = 1.4826 * float(np.median(second)) / math.sqrt(6)
    assert stillness(np.arange(18), values).noise_N == pytest.approx(expected) and expected > 0
    assert stillness(np.arange(18), values).step_N == 1.0


@pytest.mark.parametrize(("rate", "slow"), [(4.9, True), (5.1, False)])
def test_fewer_than_five_samples_a_second_are_few(rate: float, slow: bool) -> None:
    assert any("samples a second" in one for one in report(steady(60, rate)).remarks) == slow


@pytest.mark.parametrize(("count", "stuck"), [(19, False), (20, True)])
def test_twenty_equal_values_are_a_frozen_display(count: int, stuck: bool) -> None:
    found = report([LoadSample(k / 50, 7.0) for k in range(count)])
    assert any("every value is the same" in one for one in found.remarks) == stuck
    assert found.ready != stuck


@pytest.mark.parametrize(("step", "taken"), [(0.5, False), (0.51, True), (-0.51, True)])
def test_readings_must_change_by_five_times_their_scatter(step: float, taken: bool) -> None:
    """Of the mean of a hundred readings with a noise of 1: 0.1."""
    points = [Point(0.0, 100.0, 1.0, 100), Point(50.0, 100.0 + step, 1.0, 100)]
    if taken:
        assert fit(points).gain == pytest.approx(50 / step)
        return
    with pytest.raises(DataError, match="do not change with the load"):
        fit(points)


def test_a_report_for_a_person() -> None:
    samples = [
        LoadSample(k / 50, 100.0 + 0.5 * (k % 2), flags=LoadFlag.NET | LoadFlag.UNSTABLE, raw=b"a\xff")
        for k in range(51)
    ]
    assert report_lines(report(samples, seconds=1.5)) == [
        "51 samples in 1.5 s, 51 with a value",
        "rate     50 1/s, jitter 0.00 ms, longest gap 500 ms",
        "force    mean 100.245 N, from 100 to 100.5 N (20.1% of the capacity)",
        "noise    0.605 N (one reading), 2 different values, step 0.5 N",
        "moved    0.0714 N (means of a tenth of the time)",
        "flag     net: 51",
        "flag     unstable: 51",
        "line     'a\\\\xff'",
        "look     silence for the last 0.50 s: the device stopped sending; power, cable?",
    ]


@pytest.mark.parametrize(
    ("first", "last", "heard"),
    [(99.1, 109.9, (100.0, 110.0)), (98.9, 109.9, (98.9, 109.9)), (100.0, 111.1, (100.0, 111.1))],
)
def test_samples_of_now_are_stamped_within_a_second_of_listening(
    first: float, last: float, heard: tuple[float, float]
) -> None:
    found = _as_of_now((LoadSample(first, 1.0), LoadSample(last, 1.0)), 100.0, 110.0)
    assert (found.began, found.ended) == heard and len(found.samples) == 2
    assert _as_of_now((), 100.0, 110.0) == ListenResult((), 100.0, 110.0)
