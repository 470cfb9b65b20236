"""When silence and floods are told."""

from __future__ import annotations

import math

import pytest

from acquire.load_sample import LoadFlag, LoadSample
from acquire.serial_line.link import FloodWatch, LoadWatch


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
