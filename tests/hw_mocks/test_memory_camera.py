"""The camera from memory: its own pace, a finite ring, honest numbers."""

from __future__ import annotations

import numpy as np
import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError
from hw_mocks.memory_camera import MemoryCamera, MemorySettings, open_memory_camera

SMALL = MemorySettings(64, 64, 8, 1000.0, seconds=0.1, pictures=4, buffers=8, saturated=0.05)


class Clock:
    """A clock that only moves when it is told to."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def test_a_late_reader_loses_frames_and_the_numbers_say_so() -> None:
    clock = Clock()
    with MemoryCamera(SMALL, "bench:", clock) as camera:
        frames = iter(camera)
        clock.now += 0.0021  # two frames are due
        assert [next(frames).index for _ in range(2)] == [0, 1]
        clock.now += 0.020  # 22 are due, the ring holds the last eight
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
