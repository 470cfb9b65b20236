"""Pauses, gaps at the end, and numbers of frames: of 32 bits, of 16, and of none."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.camera import (
    FrameCounter,
    StallWatch,
    exposure_and_gain,
    longest_pause_s,
    mid_exposure,
    missing_at_end,
    missing_between,
)
from acquire.frame import CameraInfo, CameraSetting


def info(**more: object) -> CameraInfo:
    about = {"fps": 10.0, "live": True, **more}
    return CameraInfo("a:", "a", 8, 8, 8, clock="device", **about)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("camera", "silent_s", "missing"),
    [
        (info(), 7.0, 69),
        (info(), 0.4, 0),  # no longer than a stutter
        (info(fps=0.1), 40.0, 0),  # within five periods
        (info(fps=0.1), 60.0, 5),
        (info(live=False), 60.0, 0),  # waits for its reader
        (info(fps=None), 60.0, 0),  # no rate is known
        (info(pause_s=math.inf), 60.0, 0),  # waits for a trigger
        (info(pause_s=0.2), 0.4, 3),
    ],
)
def test_frames_that_a_camera_owes_at_the_end(camera: CameraInfo, silent_s: float, missing: int) -> None:
    assert missing_at_end(camera, silent_s) == missing


def test_the_longest_pause() -> None:
    assert longest_pause_s(100, None) == longest_pause_s(None, None) == 0.5
    assert longest_pause_s(5, 0.1) == pytest.approx(1.1)


@pytest.mark.parametrize(
    ("before", "after", "lost"),
    [
        (2**32 - 1, 0, 0),
        (2**32 - 3, 2, 4),
        (2**31 - 1, 2**31, 0),
        (10, 10 + 2**30 + 5, 2**30 + 4),  # more than a quarter of the range is still a gap
        (10, 10 + 2**31 - 1, 2**31 - 2),
    ],
)
def test_a_gap_anywhere_in_the_range(before: int, after: int, lost: int) -> None:
    counter = FrameCounter()
    counter.count(before, 1.0, None)
    assert counter.count(after, 2.0, None) == lost
    assert counter.index == before + 1 + lost and counter.counts_itself


def test_a_number_that_goes_back_is_no_gap() -> None:
    counter = FrameCounter()
    counter.count(1000, 1.0, 10.0)
    assert counter.count(990, 1.1, 10.0) == 0
    assert not counter.counts_itself and counter.index == 1001


def test_half_the_range_is_no_gap_any_more() -> None:
    counter = FrameCounter()
    counter.count(10, 1.0, 10.0)
    assert counter.count(10 + 2**31, 1.3, 10.0) == 2
    assert not counter.counts_itself and counter.index == 13


@pytest.mark.parametrize(
    ("numbers", "indices"),
    [
        pytest.param((7, 8, 12), [7, 8, 12], id="it begins with the number of the driver"),
        pytest.param((2**32 - 1, 0, 2), [2**32 - 1, 2**32, 2**32 + 2], id="32 bits run over"),
    ],
)
def test_gaps_are_those_of_the_drivers_numbers(numbers: tuple[int, ...], indices: list[int]) -> None:
    counter, found, lost = FrameCounter(), [], []
    for k, number in enumerate(numbers):
        lost.append(counter.count(number, 0.1 * k, 10.0))
        found.append(counter.index)
    assert found == indices and lost == [0, *(b - a - 1 for a, b in pairwise(indices))]


def test_a_driver_that_does_not_count_is_noticed() -> None:
    """And its gaps are those of the rate that comes, 10, not the 20 that it says."""
    counter = FrameCounter()
    times = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.9, 1.0)
    assert [counter.count(0, t, 20.0) for t in times] == [0] * 7 + [2, 0]
    assert not counter.counts_itself
    assert counter.index == 10


@given(
    st.lists(st.tuples(st.integers(0, 2**32 - 1), st.floats(-1e3, 1e6), st.booleans()), max_size=40),
    st.sampled_from([None, 1.0, 60.0]),
)
def test_numbers_always_increase_and_agree_with_the_losses(
    stamps: list[tuple[int, float, bool]], fps: float | None
) -> None:
    counter = FrameCounter()
    last = None
    for sequence, t, restart in stamps:
        if restart:
            counter.restart()
        lost = counter.count(sequence, t, fps)
        if last is not None:
            assert counter.index == last + 1 + lost
        last = counter.index


def test_numbers_from_1_to_65535_begin_again() -> None:
    """As those of GigE cameras do: 0 is none."""
    counter = FrameCounter(65535)
    assert [counter.count(number, 0.0, 10) for number in (65534, 65535, 1, 4)] == [0, 0, 0, 2]
    assert (counter.index, counter.counts_itself) == (65539, True)


def test_a_stall_is_reported_once_and_its_end_too() -> None:
    reports: list[tuple[str, str]] = []
    watch = StallWatch(lambda text, level: reports.append((text.partition(";")[0], level)))
    watch.restart(100.0)
    assert watch.waited(100.4, 0.5) == pytest.approx(0.4)
    assert not watch.stalled
    for now in (101.0, 102.0):
        watch.waited(now, 0.5)
    watch.restart(102.5)  # opened again: it is still the same pause
    watch.came(103.0)
    watch.came(103.1)
    assert reports == [("no picture for 1.0 s", "error"), ("pictures again after 3.0 s", "info")]


def test_the_middle_of_the_exposure() -> None:
    assert mid_exposure(10.0, 0.2, "start") == pytest.approx(10.1)
    assert mid_exposure(10.0, 0.2, "end") == pytest.approx(9.9)
    assert mid_exposure(10.0, 0.2, "") == mid_exposure(10.0, None, "end") == 10.0


@pytest.mark.parametrize(
    ("fps", "high"),
    [(None, 50_000), (25.0, 40_000), (10.0, 50_000), (200.0, 8_000)],
)
def test_an_exposure_is_changed_within_one_picture(fps: float | None, high: float) -> None:
    """But is never made impossible by that: 8 ms are in force, whatever the rate is."""
    (exposure,) = exposure_and_gain((8_000.0, 0.0, 50_000.0), None, fps)
    assert exposure == CameraSetting("exposure_us", 8_000.0, 1.0, high, log=True)


def test_the_bounds_of_a_setting_hold_what_is_in_force() -> None:
    (exposure, gain) = exposure_and_gain((0.5, 10.0, 100.0), (30.0, 2.0, 24.0), None)
    assert (exposure.low, exposure.high) == (0.5, 100.0)
    assert gain == CameraSetting("gain", 30.0, 2.0, 30.0)
    (gain,) = exposure_and_gain((0.0, 0.0, 100.0), (-5.0, -3.0, 24.0), None)
    assert gain == CameraSetting("gain", -5.0, -5.0, 24.0), "and an exposure of zero has no ratio"


@pytest.mark.parametrize(
    ("seconds", "fps", "missing"),
    [(0.1, 10, 0), (0.14, 10, 0), (0.16, 10, 1), (1.0, 10, 9), (-1.0, 10, 0), (1.0, None, 0), (1.0, 0, 0)],
)
def test_frames_missing_between_two_stamps(seconds: float, fps: float | None, missing: int) -> None:
    assert missing_between(100.0, 100.0 + seconds, fps) == missing


def test_after_a_restart_the_time_tells_what_was_lost() -> None:
    counter = FrameCounter()
    assert (counter.index, counter.t) == (-1, float("-inf"))
    assert counter.count(40, 10.0, 10.0) == 0 and counter.index == 40
    counter.restart()
    assert counter.count(0, 10.5, 10.0) == 4 and counter.index == 45
    assert counter.count(1, 10.4, 10.0) == 0 and (counter.index, counter.t) == (46, 10.5)


def test_a_pause_as_long_as_allowed_is_none() -> None:
    reports: list[str] = []
    watch = StallWatch(lambda text, level: reports.append(text))
    watch.restart(100.0)
    assert watch.waited(100.5, 0.5) == 0.5 and not watch.stalled
    watch.came(100.5)
    assert watch.waited(101.0, 0.5) == 0.5 and reports == []
