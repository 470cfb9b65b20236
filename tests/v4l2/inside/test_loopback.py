"""Known pictures through the kernel and back: every format bit for bit, numbers and stamps in order."""

from __future__ import annotations

import time
from itertools import islice, pairwise

import numpy as np
import pytest

from acquire.camera.contract import open_camera
from acquire.v4l2.formats import FORMATS, PixelFormat
from tests.v4l2.inside import vivid

# vivid has neither MJPG nor Y14.
NAMES = [name for name in FORMATS if name not in ("MJPG", "JPEG", "Y14")]


def known(item: PixelFormat, height: int, width: int) -> np.ndarray:
    if item.kind == "luma":
        return vivid.speckle(height, 2 * width).reshape(height, width, 2)
    dtype = np.uint8 if item.bytes_per_sample == 1 else np.uint16
    return vivid.speckle(height, width, dtype, 2**item.bits - 1)


def seen(item: PixelFormat, picture: np.ndarray) -> np.ndarray:
    return picture[..., int(item.order)] if item.kind == "luma" else picture


@pytest.mark.v4l2
@pytest.mark.parametrize("name", NAMES)
def test_every_format_comes_bit_for_bit(name: str) -> None:
    item = FORMATS[name]
    picture = known(item, 480, 640)
    with vivid.looped(name, picture), open_camera(f"/dev/video0?input=1&format={name}") as camera:
        assert (camera.info.width, camera.info.height, camera.info.bits) == (640, 480, item.bits)
        frames = list(islice(camera, 5))
    assert np.array_equal(frames[-1].image, seen(item, picture))
    assert frames[-1].image.max() == 2**item.bits - 1


@pytest.mark.v4l2
@pytest.mark.parametrize("name", ["GREY", "Y16"])
def test_a_larger_picture_comes_bit_for_bit(name: str) -> None:
    picture = known(FORMATS[name], 720, 1280)
    with vivid.looped(name, picture), open_camera(f"/dev/video0?input=1&format={name}") as camera:
        frames = list(islice(camera, 5))
    assert np.array_equal(frames[-1].image, picture)


@pytest.mark.v4l2
@pytest.mark.parametrize("plane", ["r", "g", "b"])
def test_a_colour_plane_of_a_mosaic(plane: str) -> None:
    picture = known(FORMATS["GRBG"], 480, 640)
    address = f"/dev/video0?input=1&format=GRBG&plane={plane}"
    with vivid.looped("GRBG", picture), open_camera(address) as camera:
        frame = list(islice(camera, 5))[-1]
    y, x = {"g": (0, 0), "r": (0, 1), "b": (1, 0)}[plane]
    assert np.array_equal(frame.image, picture[y::2, x::2])


@pytest.mark.v4l2
def test_numbers_and_stamps_are_those_of_the_kernel() -> None:
    with open_camera("/dev/video0?format=GREY&width=640&height=360&fps=15") as camera:
        frames = list(islice(camera, 15))
    now = time.monotonic()
    assert {frame.clock for frame in frames} == {"device"}
    assert all(abs(frame.raw_t - now) < 30 for frame in frames)  # the same clock as ours
    for earlier, later in pairwise(frames):
        assert later.lost_before == later.index - earlier.index - 1
        assert later.raw_t > earlier.raw_t
    # One stamp may be late in a slow machine; the pace of the kernel's camera makes up for it.
    first, last = frames[0], frames[-1]
    assert (last.raw_t - first.raw_t) / (last.index - first.index) == pytest.approx(1 / 15, rel=0.2)


@pytest.mark.v4l2
def test_frames_are_memory_of_their_own() -> None:
    with open_camera("/dev/video0?format=Y12&width=640&height=360") as camera:
        frames = list(islice(camera, 12))  # more than there are buffers
    assert len({frame.image.ctypes.data for frame in frames}) == 12
    # vivid writes a running number into each picture
    assert not any(np.array_equal(a.image, b.image) for a, b in pairwise(frames))


@pytest.mark.v4l2
def test_frames_from_before_the_start_are_left_out() -> None:
    with open_camera("/dev/video0?format=GREY&width=640&height=360&fps=15") as camera:
        time.sleep(1.5)
        asked = time.monotonic()
        first = next(iter(camera))
    assert first.raw_t > asked - 0.5
