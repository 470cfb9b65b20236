"""The camera from memory: its own pace, a finite ring, honest numbers."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError
from hw_mocks.scene import MemoryCamera, MemorySettings, glare, open_memory_camera, render
from tests.clock import Clock

SMALL = MemorySettings(64, 64, 8, 1000.0, seconds=0.1, pictures=4, buffers=8, saturated=0.05)


def test_a_late_reader_loses_frames_and_the_numbers_say_so() -> None:
    clock = Clock()
    clock.now_s = 100.0
    with MemoryCamera(SMALL, "bench:", clock) as camera:
        frames = iter(camera)
        clock.now_s += 0.0021  # two frames are due
        assert [next(frames).index for _ in range(2)] == [0, 1]
        clock.now_s += 0.020  # 22 are due, the ring holds the last eight
        late = next(frames)
        assert (late.index, late.lost_before) == (14, 12)
        rest = [late, *(next(frames) for _ in range(7))]
        assert [frame.index for frame in rest] == list(range(14, 22))
        assert camera.dropped == 12
    assert late.t == pytest.approx(100.015)


def test_it_ends_and_every_frame_has_its_own_memory() -> None:
    with MemoryCamera(SMALL, "bench:") as camera:
        frames = list(camera)
    assert sum(1 + frame.lost_before for frame in frames) == 100
    assert not np.shares_memory(frames[0].image, frames[2].image)
    assert 0.02 < np.mean(frames[0].image == 255) < 0.08


def test_what_nobody_knows_is_refused() -> None:
    camera = open_memory_camera(parse_address("bench:?width=64&height=64&bits=12&fps=50"))
    assert (camera.info.bits, camera.info.fps) == (12, 50.0)
    with pytest.raises(ConfigError, match="colour"):
        open_memory_camera(parse_address("bench:?colour=red"))


def test_pictures_go_to_and_fro_after_a_second_or_forty_frames_of_rest() -> None:
    """At rest two pictures take turns; then the four of the pull, and back."""
    shown = {}
    for fps in (10.0, 100.0):
        camera = MemoryCamera(dataclasses.replace(SMALL, fps=fps), "bench:")
        rest = 40 if fps == 10 else 100
        assert [camera._which(k) for k in range(rest + 1)] == [k % 2 for k in range(rest + 1)]
        shown[fps] = [camera._which(rest + k) for k in range(1, 9)]
    assert shown[10.0] == shown[100.0] == [2, 3, 4, 3, 2, 1, 2, 3]


def test_what_it_says_of_itself_and_shows() -> None:
    camera = open_memory_camera(parse_address("bench:?width=96&height=64&bits=10&fps=50&pictures=5"))
    assert (camera.info.width, camera.info.height, camera.info.pixel_format) == (96, 64, "Y10")
    assert (camera.info.live, camera.info.clock, camera.info.fps) == (True, "device", 50.0)
    pictures = render(dataclasses.replace(SMALL, width=96, bits=10, pictures=5, saturated=0.0))
    assert len(pictures) == 6 and {one.shape for one in pictures} == {(64, 96)}
    assert all(one.dtype == np.uint16 and one.max() <= 1023 and not one.flags.writeable for one in pictures)
    assert not np.array_equal(pictures[0], pictures[1]), "the same pattern, other noise"
    assert np.std(pictures[0].astype(float) - pictures[1]) == pytest.approx(0.01 * 1023 * 2**0.5, rel=0.1)


def test_spots_of_glare_have_a_radius_of_six_pixels() -> None:
    bright = glare((200, 300), 0.002)
    assert bright.sum() == sum(x * x + y * y <= 36 for x in range(-6, 7) for y in range(-6, 7)) == 113
    assert not glare((64, 64), 0.0).any()


def test_a_camera_from_memory_of_which_only_the_size_is_said() -> None:
    camera = open_memory_camera(parse_address("bench:?width=64&height=64&pictures=4"))
    assert camera._settings == MemorySettings(64, 64, 8, 30.0, 20.0, 4, 8, 0.0)
