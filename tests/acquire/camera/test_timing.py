"""Pauses, gaps at the end, numbers that begin again."""

from __future__ import annotations

import math

import pytest

from acquire.camera import FrameCounter, StallWatch, longest_pause_s, mid_exposure, missing_at_end
from acquire.frame import CameraInfo


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
