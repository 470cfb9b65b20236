"""When a port is tried again, and when silence and floods are told."""

from __future__ import annotations

import dataclasses
import math
import threading

import pytest

from acquire.errors import DeviceError
from acquire.load_sample import LoadFlag, LoadSample
from acquire.serial_line import link as link_module
from acquire.serial_line.link import FloodWatch, Link, LinkContext, LoadWatch
from acquire.serial_line.ports import LineSettings
from tests.acquire.serial_line.fake_port import FakePort, FakeTime


class Told(list[tuple[str, str]]):
    """Levels and sentences."""

    def __call__(self, level: str, text: str) -> None:
        self.append((level, text))


def bad(number: int, flag: LoadFlag = LoadFlag.ERROR) -> LoadSample:
    return LoadSample(0.0, math.nan, flags=flag, raw=b"line \x00%d" % number)


def test_silence_is_told_once_it_is_longer_than_allowed() -> None:
    told = Told()
    watch = LoadWatch(2.0, told, 100.0)
    for now in (101.0, 102.0):
        watch.look((), now)
    assert told == []
    for now in (102.1, 102.2, 150.0):
        watch.look([bad(0)], now)
    watch.look([LoadSample(150.0, 1.0), LoadSample(150.5, 3.0)], 151.0)
    watch.look((), 153.0)
    watch.look((), 153.5)
    assert told == [
        ("warning", "no reading for 2 s; there was no good sample before"),
        ("info", "readings come again"),
        ("warning", "no reading for 2 s; last good sample 3 N, 3.0 s ago"),
    ]


def test_a_watch_that_begins_again_counts_from_there() -> None:
    told = Told()
    watch = LoadWatch(2.0, told, 100.0)
    watch.restart(110.0)
    watch.look((), 111.9)
    assert told == []


def test_ten_bad_lines_in_a_row_are_told_once_until_a_good_one() -> None:
    told = Told()
    watch = LoadWatch(1e9, told, 0.0)
    watch.look([bad(k) for k in range(5)], 0.0)
    watch.look([bad(5, LoadFlag.OVERLOAD)] * 20, 0.0)  # no bad line, and no good one
    watch.look([bad(k) for k in range(6, 10)], 0.0)
    assert told == [], "nine"
    watch.look([bad(10), bad(11)], 0.0)
    watch.look([bad(12)] * 50, 0.0)
    words = "give no reading, the last one 'line \\x0011'; check protocol, baud, column and decimal"
    assert [text for _, text in told] == [f"11 lines in a row {words.replace(chr(0), chr(92) + 'x00')}"]
    watch.look([bad(0), LoadSample(0.0, 1.0)], 0.0)
    watch.look([bad(13)] * 9, 0.0)
    assert len(told) == 1
    watch.look([bad(14)], 0.0)
    assert len(told) == 2


def test_what_comes_behind_full_reads_is_late_and_is_skipped_after_a_quarter_of_a_second() -> None:
    told = Told()
    guard = FloodWatch(told, 100.0)
    guard.read(True, 50, 100.04)
    assert not guard.late, "the port was empty 40 ms ago"
    guard.read(True, 70, 100.2)
    assert guard.late and not guard.too_late(100.28)
    guard.read(True, 30, 100.3)
    assert guard.too_late(100.34)
    assert told == [
        (
            "warning",
            "lines come faster than they are read (500/s); what waits is skipped and flagged STALE: "
            "have the device send fewer",
        )
    ]
    guard.skip(False, 100.35)
    guard.read(False, 1, 100.36)
    assert guard.late, "not all of it was skipped"
    guard.read(False, 1, 100.5)
    assert not guard.late and not guard.too_late(200.0)


@pytest.mark.parametrize(("again_after_s", "times"), [(9.0, 1), (11.0, 2)])
def test_a_flood_that_comes_again_within_ten_seconds_is_not_told_again(
    again_after_s: float, times: int
) -> None:
    told = Told()
    guard = FloodWatch(told, 0.0)
    for t in (1.0, 1.3 + again_after_s - 0.3):
        guard.read(True, 10, t)
        assert guard.too_late(t + 0.3)
        guard.skip(True, t + 0.3)
    assert len(told) == times


class Tries:
    """A link whose port opens for as many reads as ``lives`` says; -1: it does not open."""

    def __init__(self, *lives: int) -> None:
        self.time, self.told, self._lives = FakeTime(), Told(), list(lives)
        self.at: list[float] = []
        self.urls: list[str] = []
        context = LinkContext(self._open, self.time, threading.Event(), self.time.sleep)
        self.link = Link(LineSettings("/dev/fake"), context, self.told, lambda: "no sample")

    def _open(self, line: LineSettings) -> FakePort:
        self.at.append(self.time.now)
        self.urls.append(line.url)
        lives = self._lives.pop(0) if self._lives else 10_000
        if lives < 0:
            raise DeviceError("gone")
        return FakePort(self.time, [b"1"] * lives + [OSError(5, "out")], pace=0.1)

    def steps(self, count: int) -> list[float]:
        """Seconds between so many openings."""
        while len(self.at) <= count:
            if self.link.connected or self.link.again():
                self.link.receive(100)
        return [later - earlier for earlier, later in zip(self.at, self.at[1:], strict=False)]


def test_a_port_that_is_lost_at_once_is_tried_after_twice_as_long_each_time() -> None:
    assert Tries(*[0] * 8).steps(7) == pytest.approx([0.5, 1, 2, 4, 8, 8, 8], abs=0.02)


def test_one_that_has_lasted_is_tried_after_half_a_second() -> None:
    tries = Tries(60, 60, 60)
    assert tries.steps(3) == pytest.approx([6.5] * 3, abs=0.02)
    assert [level for level, _ in tries.told][:3] == ["error", "info", "error"]
    assert tries.told[0][1] == "lost (out); no sample; trying to reach it again"


def test_one_that_does_not_open_is_tried_twice_a_second() -> None:
    assert Tries(0, -1, -1, -1, 9).steps(4) == pytest.approx([0.5] * 4, abs=0.02)


def test_looking_for_a_lost_port_takes_a_tenth_of_a_second() -> None:
    tries = Tries(0)
    tries.link.receive(1)
    before = tries.time.now
    assert not tries.link.again()
    assert tries.time.now - before == pytest.approx(0.1)


def test_a_port_that_came_back_under_another_name_is_opened_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link_module, "identity_of", lambda url: "0403:6001:A1")
    monkeypatch.setattr(
        link_module, "find_again", lambda url, identity: "/dev/fake7" if identity == "0403:6001:A1" else url
    )
    tries = Tries(0)
    tries.steps(1)
    tries.link.receive(1)
    assert tries.urls == ["/dev/fake", "/dev/fake7"]
    assert tries.told[-1] == ("info", "connected again as /dev/fake7")


def test_what_is_opened_again_has_the_line_it_had() -> None:
    lines: list[LineSettings] = []
    time, first = FakeTime(), LineSettings("/dev/fake", 2400, 7, "E", 2, 0.05)

    def opened(line: LineSettings) -> FakePort:
        lines.append(line)
        return FakePort(time, [OSError(5, "out")])

    link = Link(first, LinkContext(opened, time, threading.Event(), time.sleep), Told())
    link.receive(1)
    while len(lines) < 2:
        link.again()
    assert lines == [first, dataclasses.replace(first)]
