from __future__ import annotations

import errno

from acquire.v4l2 import api
from acquire.v4l2.listing import list_cameras
from tests.acquire.v4l2.fake_kernel import FakeCamera, FakeControl, FakeKernel


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
