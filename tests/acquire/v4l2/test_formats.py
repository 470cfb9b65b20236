from __future__ import annotations

import errno

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.camera import FrameCounter, missing_between
from acquire.errors import DataError
from acquire.events import RateLimiter
from acquire.v4l2 import api
from acquire.v4l2.api import fourcc, fourcc_text
from acquire.v4l2.formats import FORMATS, PLANES, Plane, decode, preferred, warning_of
from acquire.v4l2.listing import list_cameras
from tests.acquire.v4l2.fake_kernel import FakeCamera, FakeControl, FakeKernel


@given(st.sampled_from(sorted(FORMATS)), st.binary(max_size=400), st.integers(0, 60), st.sampled_from(PLANES))
def test_any_bytes_give_a_picture_or_a_clear_error(name: str, data: bytes, line: int, plane: Plane) -> None:
    try:
        image = decode(memoryview(data), FORMATS[name], 10, 6, line, plane)
    except DataError as error:
        assert "bytes" in str(error) or "JPEG" in str(error)
    else:
        assert image.shape in ((6, 10), (3, 5))
        assert not image.flags.writeable


@pytest.mark.parametrize("plane", ["r", "g", "b"])
@pytest.mark.parametrize("name", ["BA81", "GBRG", "GRBG", "RGGB", "BG12", "GB10", "BA12", "RG16"])
def test_a_colour_plane_holds_the_pixels_under_its_filter(name: str, plane: Plane) -> None:
    item = FORMATS[name]
    tile = np.array([ord(c) for c in item.order.lower()]).reshape(2, 2)
    mosaic = np.tile(tile, (3, 5)).astype(f"u{item.bytes_per_sample}")
    image = decode(mosaic.tobytes(), item, 10, 6, 0, plane)
    assert image.shape == (3, 5)
    assert set(image.ravel()) == {ord(plane)}


def test_grey_is_preferred_and_compression_never_chosen() -> None:
    assert preferred(["MJPG", "YUYV", "GREY", "Y12"]) == "Y12"
    assert preferred(["MJPG", "YUYV"]) == "YUYV"
    assert preferred(["MJPG", "H264"]) is None


def test_formats_that_hide_grey_levels_warn() -> None:
    assert warning_of(FORMATS["Y12"]) is None
    assert "16..235" in str(warning_of(FORMATS["YUYV"]))
    assert warning_of(FORMATS["YUYV"], full_range=True) is None
    assert "mosaic" in str(warning_of(FORMATS["RGGB"]))
    assert warning_of(FORMATS["RGGB"], plane="g") is None
    assert "averaging" in str(warning_of(FORMATS["MJPG"]))


@pytest.mark.parametrize("text", ["GREY", "Y12", "MJPG"])
def test_four_characters_and_back(text: str) -> None:
    assert fourcc_text(fourcc(text)) == text
    assert fourcc_text(fourcc(text) | 1 << 31) == text + "-BE"


def counted(*stamps: tuple[int, float], fps: float | None = 10.0) -> list[tuple[int, int]]:
    counter = FrameCounter()
    return [(counter.count(sequence, t, fps), counter.index)[::-1] for sequence, t in stamps]


def test_it_begins_with_the_drivers_number_and_counts_its_gaps() -> None:
    assert counted((7, 0.0), (8, 0.1), (12, 0.5)) == [(7, 0), (8, 0), (12, 3)]


def test_the_number_may_run_over() -> None:
    assert counted((2**32 - 1, 0.0), (0, 0.1), (2, 0.3)) == [(2**32 - 1, 0), (2**32, 0), (2**32 + 2, 1)]


def test_after_a_restart_the_stamps_tell() -> None:
    counter = FrameCounter()
    counter.count(5, 1.0, 10.0)
    counter.restart()
    assert (counter.count(0, 2.0, 10.0), counter.index) == (9, 15)
    assert (counter.count(2, 2.2, 10.0), counter.index) == (1, 17)


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


def test_missing_between_never_counts_backwards() -> None:
    assert missing_between(1.0, 1.5, 10.0) == 4
    assert missing_between(1.0, 0.5, 10.0) == 0
    assert missing_between(1.0, 9.0, None) == 0


def test_a_fault_with_every_frame_is_told_once_a_while_and_none_is_forgotten() -> None:
    limiter = RateLimiter(2.0)
    assert [limiter.due(t) for t in (0.0, 0.5, 1.0, 2.5, 2.6, 9.0)] == [1, 0, 0, 3, 0, 2]


def test_a_camera_is_listed_with_the_address_to_use() -> None:
    control = FakeControl(0x980912, "Gain, Automatic", 2, 0, 1, value=1)
    camera = FakeCamera(controls={control.id: control}, inputs=("Webcam", "HDMI"))
    listing = list_cameras(FakeKernel(camera))[0]
    assert listing.address == "/dev/video0?format=Y12"
    text = listing.text()
    assert "fake camera (fake, usb-1)" in text
    assert "format=Y12   raw grey levels, 12 bits" in text
    assert "8x4 at 20, 10 1/s" in text
    assert "format=MJPG  compressed, only on request" in text
    assert "inputs: input=0 (Webcam), input=1 (HDMI)" in text
    assert "gain_automatic=1 (0..1)" in text
    assert "automatic now, put on manual when opened: gain_automatic" in text


def test_what_is_no_camera_is_left_out_and_what_does_not_open_is_told() -> None:
    kernel = FakeKernel(
        FakeCamera(path="/dev/video0", caps=0x2),
        FakeCamera(path="/dev/video1", open_error=errno.EACCES),
        FakeCamera(path="/dev/video2", formats=("RGB3",), fourcc="RGB3"),
    )
    listings = list_cameras(kernel)
    assert [listing.address for listing in listings] == ["/dev/video1", "/dev/video2"]
    assert "usermod -aG video" in listings[0].text()
    assert "not readable here" in listings[1].text()


def test_looking_leaves_nothing_open_and_streams_nothing() -> None:
    kernel = FakeKernel(FakeCamera())
    list_cameras(kernel)
    assert not kernel._handles
    assert not kernel.cameras[0].streaming
    assert kernel.cameras[0].caps & api.CAP_STREAMING
