"""Every live camera outlives the faults of its device, whatever its kind: one suite over all registered schemes."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from itertools import islice, pairwise

import pytest

from acquire import opening
from acquire.camera import CAMERAS
from acquire.camera.live import LiveCamera
from acquire.frame import Frame
from tests.contracts.cameras_not_there import (
    AWAY,
    DAMAGED,
    FPS,
    KINDS,
    LOST,
    MISSING,
    NOTHING,
    PICTURE,
    SLOW,
    World,
)

WARM = [PICTURE] * 8
"""After so many the pace of a camera is known that numbers nothing."""
Open = Callable[[World], LiveCamera]


@pytest.fixture(params=KINDS, ids=lambda scheme: scheme or "v4l2")
def opened(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Open:
    monkeypatch.setattr(opening, "RETRY_S", 0.001)
    return lambda world: KINDS[request.param](world, monkeypatch)


def take(world: World, opened: Open, count: int) -> list[Frame]:
    with opened(world) as camera:
        frames = list(islice(camera, count))
    for earlier, later in pairwise(frames):
        assert later.lost_before == later.index - earlier.index - 1 and later.t >= earlier.t
    return frames


def told(world: World, words: str) -> int:
    return sum(words in text for text in world.texts)


def test_every_live_scheme_is_here() -> None:
    assert {*KINDS} - {"own"} == {*CAMERAS.schemes()} - {"files", "video", "session"}


def test_frames_that_do_not_come_are_counted(opened: Open) -> None:
    world = World(*WARM, LOST)
    frames = take(world, opened, 12)
    assert sorted(frame.lost_before for frame in frames) == [0] * 11 + [MISSING]
    assert all(event.level == "info" for event in world.events)


def test_a_damaged_frame_is_told_and_not_measured(opened: Open) -> None:
    world = World(*WARM, DAMAGED)
    frames = take(world, opened, 12)
    good = [frame for frame in frames if not frame.damaged]
    assert [later.index - earlier.index for earlier, later in pairwise(good)].count(2) == 1
    assert frames[-1].index - frames[0].index == len(frames) - 1 + sum(f.lost_before for f in frames)
    assert told(world, "is damaged: recorded, not measured") + told(world, "without a whole picture") == 1


def test_a_stall_is_told_once_and_so_is_its_end(opened: Open) -> None:
    world = World()
    with opened(world) as camera:
        stream = iter(camera)
        list(islice(stream, 8))
        pause = camera.info.pause_s or 0.5
        world.script += [NOTHING] * (round(pause * FPS) + 4)
        list(islice(stream, 12))
    assert world.opened == 1
    assert told(world, "no picture for") == told(world, "pictures again after") == 1


def test_a_long_stall_opens_the_camera_again(opened: Open) -> None:
    world = World()
    with opened(world) as camera:
        stream = iter(camera)
        frames = list(islice(stream, 8))
        world.script += [NOTHING] * (round(4.2 * (camera.info.pause_s or 0.5) * FPS) + 4)
        frames += islice(stream, 12)
    assert world.opened > 1
    assert sum(event.level == "error" for event in world.events) == 1
    assert told(world, "pictures again after") == 1
    gap = max(pairwise(frames), key=lambda pair: pair[1].t - pair[0].t)
    assert gap[1].lost_before == pytest.approx((gap[1].t - gap[0].t) * FPS - 1, abs=1)


def test_a_camera_that_was_unplugged_goes_on_and_the_gap_is_counted(opened: Open) -> None:
    world = World(*WARM, AWAY, looks=3)
    frames = take(world, opened, 14)
    assert world.opened == 2
    (gap,) = [(a, b) for a, b in pairwise(frames) if b.lost_before]
    assert (
        gap[1].lost_before == pytest.approx((gap[1].t - gap[0].t) * FPS - 1, abs=1)
        and gap[1].lost_before > 15
    )
    assert told(world, f"looking for it again (last good frame {gap[0].index})") == 1
    assert told(world, "opened again; the frames in between are counted as lost") == 1


def test_another_rate_loses_nothing_and_is_told(opened: Open) -> None:
    world = World(*[SLOW] * 40)
    frames = take(world, opened, 40)
    assert sum(frame.lost_before for frame in frames[1:]) == 0
    assert told(world, "5 frames a second come, not the 10 of the driver") == 1


def test_a_change_of_the_rate_loses_a_frame_at_most(opened: Open) -> None:
    world = World(*[PICTURE] * 20, *[SLOW] * 20)
    assert sum(frame.lost_before for frame in take(world, opened, 38)[1:]) <= 1


@pytest.mark.parametrize("trouble", [NOTHING, AWAY])
def test_stop_ends_it_within_half_a_second_also_in_trouble(opened: Open, trouble: str) -> None:
    world = World(*WARM, *[trouble] * 100_000, looks=10**9)
    stopped: list[float] = []

    def stop() -> None:
        stopped.append(time.monotonic())
        camera.stop()

    with opened(world) as camera:
        stopper = threading.Timer(0.1, stop)
        stopper.start()
        frames = list(camera)
        took = time.monotonic() - stopped[0]
    assert 0 < len(frames) <= 8 and took < 0.5
