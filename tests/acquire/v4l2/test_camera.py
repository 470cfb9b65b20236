from __future__ import annotations

import errno
from collections.abc import Callable
from itertools import islice
from typing import Any

import numpy as np
import pytest

from acquire import opening
from acquire.addresses import parse_address
from acquire.camera.live import LiveCamera
from acquire.errors import ConfigError, DeviceError
from acquire.events import Event
from acquire.frame import Frame
from acquire.v4l2 import api
from acquire.v4l2.camera import open_v4l2
from tests.acquire.v4l2.fake_kernel import FakeCamera, FakeControl, FakeKernel


class CameraRig:
    """A fake kernel, a camera opened on it, and the events it told."""

    def __init__(self, *cameras: FakeCamera, address: str = "/dev/video0") -> None:
        self.kernel = FakeKernel(*(cameras or (FakeCamera(),)))
        self.fake = self.kernel.cameras[0]
        self.events: list[Event] = []
        self.address = address

    def open(self) -> LiveCamera:
        camera = open_v4l2(parse_address(self.address), self.events.append, self.kernel)
        self.kernel.looking = True
        return camera

    def take(self, count: int) -> list[Frame]:
        with self.open() as camera:
            return list(islice(camera, count))

    def texts(self) -> str:
        return "\n".join(event.text for event in self.events)


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening, "RETRY_S", 0.001)


def test_request_codes_are_those_of_videodev2_h() -> None:
    # Printed by a C program that includes <linux/videodev2.h> on x86_64.
    codes = {
        "QUERYCAP": 0x80685600, "ENUM_FMT": 0xC0405602, "G_FMT": 0xC0D05604, "S_FMT": 0xC0D05605,
        "REQBUFS": 0xC0145608, "QUERYBUF": 0xC0585609, "QBUF": 0xC058560F, "DQBUF": 0xC0585611,
        "STREAMON": 0x40045612, "STREAMOFF": 0x40045613, "G_PARM": 0xC0CC5615, "S_PARM": 0xC0CC5616,
        "ENUMINPUT": 0xC050561A, "G_INPUT": 0x80045626, "S_INPUT": 0xC0045627, "G_CTRL": 0xC008561B,
        "S_CTRL": 0xC008561C, "QUERYCTRL": 0xC0445624, "QUERYMENU": 0xC02C5625,
        "ENUM_FRAMESIZES": 0xC02C564A, "ENUM_FRAMEINTERVALS": 0xC034564B,
    }  # fmt: skip
    assert {name: getattr(api, name) for name in codes} == codes


def test_the_best_grey_format_is_taken_and_told() -> None:
    rig = CameraRig()
    camera = rig.open()
    assert camera.info.pixel_format == "Y12"
    assert (camera.info.bits, camera.info.width, camera.info.height, camera.info.fps) == (12, 8, 4, 10)
    assert (camera.info.live, camera.info.clock) == (True, "device")
    assert camera.info.name == "fake camera (fake, usb-1)"
    camera.close()
    camera.close()


@pytest.mark.parametrize("fourcc", ["GREY", "Y10", "Y12", "Y16", "YUYV", "UYVY", "RGGB", "RG12"])
@pytest.mark.parametrize("padding", [0, 6])
def test_pictures_come_as_the_sensor_counted_them(fourcc: str, padding: int) -> None:
    rig = CameraRig(
        FakeCamera(formats=("YUYV", fourcc), padding=padding),
        address=f"/dev/video0?format={fourcc}&width=16&height=8",
    )
    frames = rig.take(3)
    for k, frame in enumerate(frames):
        expected = (np.arange(128).reshape(8, 16) + k) % 251
        assert np.array_equal(frame.image, expected)
        assert not frame.image.flags.writeable
        assert frame.image.base is None or not isinstance(frame.image.base, memoryview)
    assert frames[0].image.dtype == (np.uint16 if fourcc in ("Y10", "Y12", "Y16", "RG12") else np.uint8)


def test_a_plane_of_a_mosaic_is_half_as_large() -> None:
    rig = CameraRig(FakeCamera(formats=("RGGB",), fourcc="RGGB"), address="/dev/video0?plane=b")
    camera = rig.open()
    assert (camera.info.width, camera.info.height) == (4, 2)
    with camera:
        frame = next(iter(camera))
    assert np.array_equal(frame.image, np.arange(32).reshape(4, 8)[1::2, 1::2])


def test_motion_jpeg_only_on_request_and_with_a_warning() -> None:
    rig = CameraRig(FakeCamera(formats=("MJPG",), fourcc="MJPG", size=(16, 8)))
    with pytest.raises(DeviceError, match="format=MJPG takes the compressed"):
        rig.open()
    rig.address = "/dev/video0?format=MJPG"
    camera = rig.open()
    assert "no averaging removes" in camera.info.warnings[0]
    with camera:
        frame = next(iter(camera))
    assert np.abs(frame.image.astype(int) - np.arange(128).reshape(8, 16)).max() < 30


def test_numbers_and_stamps_are_those_of_the_driver() -> None:
    rig = CameraRig()
    frames = rig.take(3)
    assert [frame.index for frame in frames] == [0, 1, 2]
    assert [frame.raw_t for frame in frames] == pytest.approx([1000.1, 1000.2, 1000.3])
    assert [frame.t for frame in frames] == [frame.raw_t for frame in frames]
    assert {frame.clock for frame in frames} == {"device"}


@pytest.mark.parametrize(("source", "shift"), [(api.SOURCE_START_OF_EXPOSURE, 0.004), (0, -0.004)])
def test_time_is_mid_exposure_where_it_can_be_known(source: int, shift: float) -> None:
    fake = FakeCamera(flags=api.STAMP_MONOTONIC | source, controls=exposure_controls())
    frame = CameraRig(fake, address="/dev/video0?exposure_us=8000").take(1)[0]
    assert frame.t - frame.raw_t == pytest.approx(shift)


def test_stamps_on_another_clock_are_replaced_by_the_hosts() -> None:
    frame = CameraRig(FakeCamera(flags=0)).take(1)[0]
    assert frame.clock == "host"
    assert frame.raw_t == pytest.approx(1000.1)


def test_a_short_frame_counts_as_lost() -> None:
    rig = CameraRig()
    rig.fake.script.extend([_nothing, _set(short_next=True)])
    frames = rig.take(2)
    assert [(frame.index, frame.lost_before) for frame in frames] == [(0, 0), (2, 1)]
    assert "without a whole picture" in rig.texts()


def test_a_driver_that_does_not_count_is_told_and_stamps_tell_the_losses() -> None:
    rig = CameraRig(FakeCamera(counts=False))
    rig.fake.script.extend([*[_nothing] * 7, _set(skip_next=2)])
    frames = rig.take(9)
    assert [frame.index for frame in frames] == [0, 1, 2, 3, 4, 5, 6, 9, 10]
    assert [frame.lost_before for frame in frames] == [0] * 7 + [2, 0]
    assert rig.texts().count("does not number") == 1


@pytest.mark.parametrize("error", [errno.EIO, errno.EPROTO])
def test_a_fatal_error_reopens_the_camera_and_counts_the_gap(error: int) -> None:
    rig = CameraRig()
    rig.fake.script.extend([_nothing, _nothing, _set(dead=error)])
    rig.kernel.on_wait = iter([lambda: _set(dead=0)(rig.fake)])
    frames = rig.take(4)
    gap = round((frames[2].raw_t - frames[1].raw_t) * 10) - 1
    assert [frame.index for frame in frames] == [0, 1, 2 + gap, 3 + gap] and frames[2].lost_before == gap
    assert "last good frame 1" in rig.events[0].text
    assert "opened again" in rig.events[1].text
    assert rig.fake.opened >= 2


OTHER = {"path": "/dev/video5", "card": "another camera", "bus": "usb-5"}


@pytest.mark.parametrize(
    ("other", "place"),
    [
        pytest.param(OTHER, {"path": "/dev/video1"}, id="under another name"),
        pytest.param(OTHER, {"path": "/dev/video3", "bus": "usb-7"}, id="at another port, by its name"),
        pytest.param({"path": "/dev/video2", "bus": "usb-9"}, {}, id="and not its twin while it is away"),
    ],
)
def test_an_unplugged_camera_is_found_again(other: dict[str, str], place: dict[str, str]) -> None:
    rig = CameraRig(FakeCamera(), FakeCamera(**other))
    rig.fake.script.extend([_nothing, _set(present=False)])
    rig.kernel.on_wait = iter([_idle, _idle, lambda: _set(present=True, **place)(rig.fake)])
    with rig.open() as camera:
        frames = list(islice(camera, 3))
        assert not rig.kernel.cameras[1].streaming
    assert frames[0].index < frames[1].index < frames[2].index and frames[1].lost_before > 0
    assert "unplugged" in rig.events[0].text
    assert f"opened again{' as ' if place else ''}{place.get('path', '')}" in rig.texts()


def test_waking_for_nothing_counts_as_a_dead_device() -> None:
    rig = CameraRig()
    with rig.open() as camera:
        stream = iter(camera)
        next(stream)
        rig.fake.queued.clear()  # as a driver does that reports an error without a buffer
        assert next(stream).index > 0
    assert "fatal error" in rig.texts()


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ({"open_error": errno.EACCES}, "usermod -aG video"),
        ({"open_error": errno.EBUSY}, "another program holds"),
        ({"open_error": errno.ENODEV}, "unplug"),
        ({"caps": 0x2}, "captures no video"),
        ({"caps": api.CAP_CAPTURE_MPLANE}, "multiplanar"),
        ({"caps": api.CAP_CAPTURE}, "cannot stream"),
    ],
)
def test_why_it_does_not_open(fault: dict[str, int], words: str) -> None:
    with pytest.raises(DeviceError, match=words):
        CameraRig(FakeCamera(**fault)).open()


def test_a_camera_held_by_another_program_is_told_at_the_start_of_the_stream() -> None:
    rig = CameraRig(FakeCamera(request_errors={api.REQBUFS: errno.EBUSY}))
    camera = rig.open()
    with pytest.raises(DeviceError, match="another program"):
        camera.__enter__()
    camera.close()


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("format=Y16", "format=Y16 is not possible; allowed: YUYV, GREY, Y12, MJPG"),
        ("width=640&height=480", "asked for 640x480, the driver gives 16x8; Y12 is offered in 8x4, 16x8"),
        ("fps=25", "asked for fps=25, the driver gives 20; Y12 8x4 is offered at 20, 10 1/s"),
        ("input=3", r"input=3 is not there; the camera has: 0 \(Camera 1\)"),
        ("colour=1", "unknown setting 'colour'; known: format, .* controls of this camera: none"),
        ("exposure_us=100", "no control for an exposure"),
        ("brightness=x", "allowed: a whole number"),
    ],
)
def test_what_is_not_honoured_is_refused_with_what_there_is(query: str, words: str) -> None:
    rig = CameraRig(address=f"/dev/video0?{query}")
    with pytest.raises(ConfigError, match=words):
        rig.open()
    assert not rig.kernel._handles


def exposure_controls(**more: Any) -> dict[int, FakeControl]:
    controls = [
        FakeControl(
            0x9A0901, "Auto Exposure", 3, 0, 3, value=3, menu=("Auto", "Manual", "Shutter", "Aperture")
        ),
        FakeControl(0x9A0902, "Exposure Time, Absolute", 1, 1, 5000, value=157, held_by=(0x9A0901, 3)),
        FakeControl(0x980912, "Gain, Automatic", 2, 0, 1, value=1),
        FakeControl(0x980913, "Gain", 1, 0, 100, 4, value=16, held_by=(0x980912, 1)),
        FakeControl(
            0x980918, "Power Line Frequency", 3, 0, 3, value=3, menu=("Disabled", "50 Hz", "60 Hz", "Auto")
        ),
        FakeControl(0x980900, "Brightness", 1, 0, 255, value=128),
    ]
    return {control.id: control for control in controls}


def test_automatic_controls_are_put_on_manual_first() -> None:
    rig = CameraRig(
        FakeCamera(controls=exposure_controls()), address="/dev/video0?exposure_us=8000&gain=40&brightness=10"
    )
    camera = rig.open()
    assert camera.info.exposure_s == pytest.approx(0.008)
    assert camera.info.controls == {
        "auto_exposure": "Manual",
        "exposure_time_absolute": 80,
        "gain_automatic": 0,
        "gain": 40,
        "power_line_frequency": "Disabled",
        "brightness": 10,
    }
    assert camera.info.warnings == ()


def test_formats_and_rates_are_those_of_the_driver_that_can_be_read() -> None:
    info = CameraRig(FakeCamera(formats=("GREY", "RGB3", "MJPG"), fourcc="GREY")).open().info
    assert info.formats == ("GREY", "MJPG") and info.rates == tuple(sorted(info.rates, reverse=True)) != ()


def test_controls_left_automatic_are_named_and_hold_what_they_change() -> None:
    rig = CameraRig(FakeCamera(controls=exposure_controls()), address="/dev/video0?manual=no")
    info = rig.open().info
    assert (info.settings, info.exposure_s) == ((), None)
    assert "auto_exposure, gain_automatic, power_line_frequency" in info.warnings[0]
    rig.address += "&exposure_us=8000"
    with pytest.raises(ConfigError, match="held by an automatic control"):
        rig.open()


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("gain=41", "gain=41: the driver makes it 40; allowed: 0 to 100 in steps of 4"),
        ("brightness=300", "brightness=300: the driver makes it 255; allowed: 0 to 255"),
        ("exposure_us=2000000", "the driver makes it 5000"),
    ],
)
def test_clamped_values_are_refused(query: str, words: str) -> None:
    rig = CameraRig(FakeCamera(controls=exposure_controls()), address=f"/dev/video0?{query}")
    with pytest.raises(ConfigError, match=words):
        rig.open()


def _nothing(camera: FakeCamera) -> None: ...


def _idle() -> None: ...


def _set(**values: Any) -> Callable[[FakeCamera], None]:
    def change(camera: FakeCamera) -> None:
        for name, value in values.items():
            setattr(camera, name, value)

    return change
