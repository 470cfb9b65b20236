"""What is in force after a camera was set up: gain, exposure, rate, input, format; and which camera it is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError
from acquire.frame import CameraInfo
from acquire.settings import read_settings
from acquire.v4l2 import api
from acquire.v4l2.camera import set_up
from acquire.v4l2.controls import V4L2Settings, changeable, exposure_s, list_controls
from acquire.v4l2.device import Identity, SizeRange, V4L2Device
from acquire.v4l2.listing import _modes, find_again
from tests.acquire.v4l2 import fake_kernel
from tests.acquire.v4l2.fake_kernel import FakeCamera, FakeControl, FakeKernel

AUTO, EXPOSURE, GAIN, ANALOGUE = 0x9A0901, 0x9A0902, 0x980913, 0x9E0903
READ_ONLY, GRABBED = 0x4, 0x2


def device_with(*controls: FakeControl, **more: object) -> V4L2Device:
    camera = FakeCamera(controls={control.id: control for control in controls}, **more)  # type: ignore[arg-type]
    return V4L2Device("/dev/video0", FakeKernel(camera))


def in_force(device: V4L2Device, query: str) -> CameraInfo:
    address = f"/dev/video0?{query}"
    return set_up(device, read_settings(V4L2Settings, parse_address(address)), address)


@pytest.mark.parametrize(
    ("mode", "expected"), [(0, None), (1, pytest.approx(0.02)), (2, pytest.approx(0.02)), (3, None)]
)
def test_an_exposure_is_known_where_it_stands_still(mode: int, expected: object) -> None:
    """Automatic and aperture priority change it; manual and shutter priority do not."""
    device = device_with(
        FakeControl(AUTO, "Auto Exposure", 3, 0, 3, value=mode, menu=("A", "M", "S", "P")),
        FakeControl(EXPOSURE, "Exposure", 1, 1, 5000, value=200),
    )
    assert exposure_s(list_controls(device)) == expected


def test_the_plain_gain_is_set_where_there_are_two() -> None:
    both = FakeControl(GAIN, "Gain", maximum=100), FakeControl(ANALOGUE, "Analogue Gain", maximum=100)
    found = in_force(device_with(*both), "gain=7")
    assert found.controls == {"gain": 7, "analogue_gain": 0}
    assert [(one.key, one.value) for one in found.settings] == [("gain", 7)]


def test_the_analogue_gain_is_set_where_it_is_the_only_one() -> None:
    only = FakeControl(ANALOGUE, "Analogue Gain", maximum=100)
    assert in_force(device_with(only), "gain=7").controls == {"analogue_gain": 7}


@pytest.mark.parametrize("flags", [READ_ONLY, GRABBED])
def test_what_cannot_be_written_has_no_slider(flags: int) -> None:
    device = device_with(
        FakeControl(EXPOSURE, "Exposure", 1, 1, 5000, value=200, flags=flags),
        FakeControl(GAIN, "Gain", value=3, flags=flags),
    )
    controls = list_controls(device)
    assert not controls[GAIN].writable and controls[GAIN].value == 3
    assert changeable(controls, 10.0) == ()


@pytest.mark.parametrize(("asked", "taken"), [("20.19", True), ("20.3", False), ("19.7", False)])
def test_a_rate_is_in_force_within_a_hundredth(asked: str, taken: bool) -> None:
    device = device_with(rates=(20,))
    if taken:
        assert in_force(device, f"fps={asked}").fps == 20
    else:
        with pytest.raises(ConfigError, match=f"asked for fps={asked}, the driver gives 20"):
            in_force(device, f"fps={asked}")


def test_an_input_is_one_of_those_there_are() -> None:
    device = device_with(inputs=("tuner", "camera"))
    in_force(device, "input=1")
    with pytest.raises(ConfigError, match=r"input=2 is not there; the camera has: 0 \(tuner\), 1 \(camera\)"):
        in_force(device, "input=2")


class _AnySize:
    """Offers a range of sizes, and rates that fall with the width."""

    def sizes(self, fourcc: str) -> list[SizeRange]:
        return [SizeRange((32, 640, 8), (16, 480, 8))]

    def rates(self, fourcc: str, width: int, height: int) -> list[float]:
        return [width * height / 1024]


def test_the_rates_of_a_listing_are_those_of_the_largest_size() -> None:
    modes = _modes(_AnySize(), "GREY")  # type: ignore[arg-type]
    assert len(modes) == 1 and modes[0].endswith(" at 300 1/s")


@pytest.mark.parametrize(("others", "expected"), [(("usb-9",), "/dev/video2"), ((), None)])
def test_of_two_cameras_of_its_name_neither_is_taken(others: tuple[str, ...], expected: str | None) -> None:
    """Both came to other ports; which is which is known only where one was there before."""
    kernel = FakeKernel(
        FakeCamera(path="/dev/video1", bus="usb-9"), FakeCamera(path="/dev/video2", bus="usb-7")
    )
    known = [Identity("fake", "fake camera", bus) for bus in others]
    assert find_again(kernel, "/dev/video0", Identity("fake", "fake camera", "usb-1"), known) == expected


WOVEN, APART = (4, 8, 9), (2, 3, 5, 6, 7)


@pytest.fixture
def interlaced(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Has the driver keep to a way of interlacing whatever it is asked."""
    plain = fake_kernel._ANSWERS[api.G_FMT]

    def keep(field: int) -> None:
        def answer(kernel: FakeKernel, camera: FakeCamera, argument: Any) -> None:
            plain(kernel, camera, argument)
            argument.fmt.pix.field = field

        monkeypatch.setitem(fake_kernel._ANSWERS, api.G_FMT, answer)

    return keep


@pytest.mark.parametrize("field", [0, api.FIELD_NONE, *WOVEN])
def test_rows_of_two_moments_are_named(interlaced: Callable[[int], None], field: int) -> None:
    interlaced(field)
    warnings = in_force(device_with(), "").warnings
    assert any("two moments" in text for text in warnings) == (field in WOVEN)


@pytest.mark.parametrize("field", APART)
def test_fields_that_come_one_by_one_are_refused(interlaced: Callable[[int], None], field: int) -> None:
    interlaced(field)
    with pytest.raises(ConfigError, match="interlaced"):
        in_force(device_with(), "")
