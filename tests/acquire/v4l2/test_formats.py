"""What V4L2 says in numbers: pixel formats, controls, settings, and faults in words."""

from __future__ import annotations

import errno
import os
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.addresses import parse_address
from acquire.errors import ConfigError, DataError
from acquire.settings import read_settings
from acquire.v4l2 import api
from acquire.v4l2.api import fourcc, fourcc_text
from acquire.v4l2.controls import (
    MANUAL,
    V4L2Settings,
    changeable,
    control_name,
    exposure_s,
    list_controls,
    still_automatic,
)
from acquire.v4l2.formats import FORMATS, PLANES, Plane, decode, picture_size, preferred, warning_of
from acquire.v4l2.listing import fault_in_words, list_cameras, why_not_open
from tests.acquire.v4l2.fake_kernel import FakeCamera, FakeControl, FakeKernel
from tests.acquire.v4l2.test_setup import AUTO, EXPOSURE, GAIN, device_with, in_force


@given(st.sampled_from(sorted(FORMATS)), st.binary(max_size=400), st.integers(0, 60), st.sampled_from(PLANES))
def test_any_bytes_give_a_picture_or_a_clear_error(name: str, data: bytes, line: int, plane: Plane) -> None:
    try:
        image = decode(memoryview(data), FORMATS[name], 10, 6, line, plane)
    except DataError as error:
        assert "bytes" in str(error) or "JPEG" in str(error)
    else:
        assert image.shape in ((6, 10), (3, 5))
        assert not image.flags.writeable


@pytest.mark.parametrize(
    ("offered", "taken"),
    [
        ("MJPG YUYV GREY Y12", "Y12"),
        ("MJPG YUYV", "YUYV"),
        ("MJPG H264", None),
        ("GREY Y10 Y16 Y14", "Y14"),
        ("Y10 Y12", "Y12"),
        ("GREY Y16 Y10", "Y10"),
    ],
)
def test_the_most_usual_depth_is_preferred_and_compression_never_chosen(
    offered: str, taken: str | None
) -> None:
    assert preferred(offered.split()) == taken


@pytest.mark.parametrize(
    ("name", "how", "words"),
    [
        ("Y12", {}, None),
        ("Y16", {}, None),
        ("YUYV", {}, "YUYV: .*16..235"),
        ("UYVY", {}, "UYVY: .*16..235"),
        ("YUYV", {"full_range": True}, None),
        ("RGGB", {}, "RGGB: .*mosaic"),
        ("RG12", {}, "RG12: .*mosaic"),
        ("RGGB", {"plane": "g"}, None),
        ("MJPG", {}, "MJPG: .*averaging"),
        ("JPEG", {}, "JPEG: .*averaging"),
    ],
)
def test_formats_that_hide_grey_levels_warn(name: str, how: dict[str, Any], words: str | None) -> None:
    warning = warning_of(FORMATS[name], **how)
    assert warning is None if words is None else re.match(words, str(warning))


@pytest.mark.parametrize("text", ["GREY", "Y12", "MJPG"])
def test_four_characters_and_back(text: str) -> None:
    assert fourcc_text(fourcc(text)) == text
    assert fourcc_text(fourcc(text) | 1 << 31) == text + "-BE"


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


GREY = {"GREY": 8, "Y10": 10, "Y12": 12, "Y14": 14, "Y16": 16}
MOSAICS = {
    "BA81": "BGGR", "GBRG": "GBRG", "GRBG": "GRBG", "RGGB": "RGGB", "BG10": "BGGR", "GB10": "GBRG",
    "BA10": "GRBG", "RG10": "RGGB", "BG12": "BGGR", "GB12": "GBRG", "BA12": "GRBG", "RG12": "RGGB",
    "BYR2": "BGGR", "GB16": "GBRG", "GR16": "GRBG", "RG16": "RGGB",
}  # fmt: skip
DEPTHS = {"BA81": 8, "GBRG": 8, "GRBG": 8, "RGGB": 8, "BYR2": 16}


def test_formats_are_those_of_videodev2_h() -> None:
    """Bits, kind, bytes a pixel, and the order of the mosaic or the place of the luma."""
    wanted = {name: (bits, "grey", 1 if bits == 8 else 2, "") for name, bits in GREY.items()}
    for name, order in MOSAICS.items():
        bits = DEPTHS.get(name) or int(name[2:])
        wanted[name] = (bits, "bayer", 1 if bits == 8 else 2, order)
    wanted |= {name: (8, "luma", 2, place) for name, place in (("YUYV", "0"), ("UYVY", "1"))}
    wanted |= dict.fromkeys(("MJPG", "JPEG"), (8, "jpeg", 0, ""))
    assert {
        name: (one.bits, one.kind, one.bytes_per_pixel, one.order) for name, one in FORMATS.items()
    } == wanted


def test_sixteen_bits_come_low_byte_first_and_rows_may_be_padded() -> None:
    data = bytes([0x34, 0x02, 0xFF, 0x0F, 9, 9, 1, 0, 2, 0])
    image = decode(data, FORMATS["Y12"], 2, 2, 6)
    assert image.tolist() == [[0x234, 0xFFF], [1, 2]] and image.dtype == np.uint16
    with pytest.raises(DataError, match="9 bytes instead of 10"):
        decode(data[:-1], FORMATS["Y12"], 2, 2, 6)


@pytest.mark.parametrize(
    ("plane", "name", "size"),
    [
        ("raw", "RGGB", (9, 7)), ("r", "RGGB", (5, 4)), ("g", "RGGB", (4, 4)), ("b", "RGGB", (4, 3)),
        ("g", "GREY", (9, 7)), ("r", "YUYV", (9, 7)),
    ],
)  # fmt: skip
def test_a_plane_of_a_mosaic_has_every_other_row_and_column(
    plane: Plane, name: str, size: tuple[int, int]
) -> None:
    assert picture_size(9, 7, FORMATS[name], plane) == size


def test_settings_of_a_camera_and_its_controls_by_name() -> None:
    plain = read_settings(V4L2Settings, parse_address("/dev/video0"))
    assert plain == V4L2Settings() and (plain.buffers, plain.plane, plain.manual) == (8, "raw", True)
    found = read_settings(
        V4L2Settings, parse_address("/dev/video0?format=y12 &sharpness=0x10&manual=no&exposure_us=500")
    )
    assert (found.format, found.controls) == ("Y12", {"sharpness": 16})
    assert (found.manual, found.exposure_us) == (False, 500.0)
    with pytest.raises(ConfigError, match=r"sharpness=1\.5 is not possible; allowed: a whole number"):
        read_settings(V4L2Settings, parse_address("/dev/video0?sharpness=1.5"))


AUTOMATIC = {
    0x9A0901: 1, 0x9A0903: 0, 0x980912: 0, 0x98090C: 0, 0x9A090C: 0, 0x980919: 0, 0x98091D: 0, 0x980920: 0,
    0x9A0915: 0, 0x9A0916: 0, 0x9A0918: 0,
}  # fmt: skip
"""V4L2_CID_EXPOSURE_AUTO: V4L2_EXPOSURE_MANUAL; all others off."""


def test_what_is_automatic_is_switched_off() -> None:
    assert MANUAL == AUTOMATIC
    controls = [
        FakeControl(number, f"Control {k}", 1, 0, 3, value=3) for k, number in enumerate((*MANUAL, 0x980918))
    ]
    device = device_with(*controls)
    assert len(still_automatic(list_controls(device))) == 12
    assert set(in_force(device, "").controls.values()) == {0, 1}
    assert still_automatic(list_controls(device)) == []


@pytest.mark.parametrize("line", [0, 1, 2])
def test_a_mains_frequency_that_stands_stays(line: int) -> None:
    device = device_with(FakeControl(0x980918, "Power Line Frequency", 1, 0, 3, value=line))
    assert in_force(device, "").controls == {"power_line_frequency": line}


@pytest.mark.parametrize(("asked_us", "value"), [(8000, 80), (8049, 80), (8051, 81), (20, 1), (100, 1)])
def test_an_exposure_is_set_in_units_of_100_us(asked_us: int, value: int) -> None:
    device = device_with(FakeControl(EXPOSURE, "Exposure", 1, 1, 5000, value=200))
    found = in_force(device, f"exposure_us={asked_us}")
    assert found.controls == {"exposure": value} and found.exposure_s == pytest.approx(value * 1e-4)


@pytest.mark.parametrize(("fps", "high"), [(None, 500_000.0), (10.0, 100_000.0), (100.0, 20_000.0)])
def test_an_exposure_is_changed_within_one_picture(fps: float | None, high: float) -> None:
    """20 ms are in force: more than a period at 100/s."""
    device = device_with(
        FakeControl(EXPOSURE, "Exposure", 1, 3, 5000, value=200),
        FakeControl(GAIN, "Gain", 1, 2, 90, 4, value=6),
    )
    exposure, gain = changeable(list_controls(device), fps)
    assert (exposure.key, exposure.value, exposure.low) == ("exposure_us", pytest.approx(20_000), 300.0)
    assert (exposure.high, exposure.step, exposure.log) == (pytest.approx(high), 100.0, True)
    assert (gain.key, gain.value, gain.low, gain.high, gain.step) == ("gain", 6, 2, 90, 4)


def test_an_exposure_that_another_control_holds_is_not_known() -> None:
    device = device_with(
        FakeControl(AUTO, "Auto Exposure", 3, 0, 3, value=3, menu=("A", "M", "S", "P")),
        FakeControl(EXPOSURE, "Exposure", 1, 1, 5000, value=200, held_by=(AUTO, 3)),
    )
    controls = list_controls(device)
    assert exposure_s(controls) is None and controls[EXPOSURE].inactive
    assert controls[AUTO].shown() == "P" and controls[AUTO].allowed() == "0 (A), 1 (M), 2 (S), 3 (P)"
    assert controls[EXPOSURE].shown() == 200 and controls[EXPOSURE].allowed() == "1 to 5000"


@pytest.mark.parametrize(
    ("title", "name"),
    [("Exposure Time, Absolute", "exposure_time_absolute"), ("  Gain (dB) ", "gain_db"), ("A1-B2", "a1_b2")],
)
def test_controls_have_names_as_v4l2_ctl_has_them(title: str, name: str) -> None:
    assert control_name(title) == name


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (errno.ENODEV, "the camera was unplugged or its driver is gone"),
        (errno.ENXIO, "the camera was unplugged or its driver is gone"),
        (errno.EIO, "the driver reports a fatal error of the stream"),
        (errno.EPROTO, "the driver reports a fatal error of the stream (USB protocol)"),
        (errno.ENOSPC, "not enough USB bandwidth"),
        (errno.ETIMEDOUT, "the camera has stalled"),
        (errno.EINVAL, "a request to the camera failed"),
    ],
)
def test_faults_in_words(number: int, words: str) -> None:
    error = OSError(number, os.strerror(number))
    assert fault_in_words(error) == f"{words} ({os.strerror(number)})"
    kernel = FakeKernel(FakeCamera())
    if number == errno.ENOSPC:
        words = "not enough USB bandwidth; ask for a smaller picture or rate, or use another USB controller"
    assert why_not_open("/dev/video3", error, kernel).startswith(f"/dev/video3: {words}")
    gone = why_not_open("/dev/video3", OSError(errno.ENOENT, "no"), kernel)
    assert gone == (
        "/dev/video3: there is no such device; cameras here: /dev/video0 (fake camera); see phasedic devices"
    )
