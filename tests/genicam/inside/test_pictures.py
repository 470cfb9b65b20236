"""Frames are those that were sent, bit for bit, with numbers and times; and the contract of cameras."""

from __future__ import annotations

import time
from collections.abc import Iterator
from inspect import signature

import numpy as np
import pytest

from acquire.camera.contract import Camera, open_camera
from acquire.genicam.device import GenicamDevice, Received, Take
from tests.contracts import test_camera_contract as contract
from tests.contracts.watching import FrameWatch
from tests.genicam.fake_camera import FIRST
from tests.genicam.inside.fakes import FakeCameraProcess
from tests.genicam.packing import PIXEL_FORMATS, bits_of, picture


@pytest.mark.parametrize("name", PIXEL_FORMATS)
def test_every_format_arrives_bit_for_bit(name: str) -> None:
    width, height = 66, 50
    with FakeCameraProcess():
        watch = FrameWatch(f"genicam:127.0.0.1?format={name}&fps=50&width={width}&height={height}")
        frames = watch.first(5)
    assert watch.camera.info.pixel_format == name
    for frame in frames:
        sent = picture(frame.index - FIRST, width, height, name)
        assert np.array_equal(frame.image, sent)
        assert (frame.bits, frame.image.dtype.itemsize) == (bits_of(name), 1 if name == "Mono8" else 2)


def test_numbers_go_on_where_those_of_the_camera_begin_again() -> None:
    """GigE counts to 65535 and goes on with 1; the fake begins shortly before."""
    with FakeCameraProcess():
        watch = FrameWatch("genicam:127.0.0.1?format=Mono8&fps=400&width=32&height=32&packet_size=1400")
        watch.take(lambda: watch.frames[-1].index > 65540)
    assert watch.frames[0].index == FIRST < 65535
    watch.check_numbers()
    assert sum(frame.lost_before for frame in watch.frames) < 20
    for frame in watch.frames[-3:]:
        assert np.array_equal(frame.image, picture(frame.index - FIRST, 32, 32, "Mono8"))


def test_stamps_are_those_of_the_camera_on_our_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """The distance from a stamp of the camera to ours only ever shrinks: by arrivals that were less late."""
    fetch, stamps = GenicamDevice.fetch, {}

    def noted(device: GenicamDevice, timeout_s: float, take: Take) -> Received | None:
        if (received := fetch(device, timeout_s, take)) is not None:
            stamps[received.number] = received.stamp_ns * 1e-9
        return received

    monkeypatch.setattr(GenicamDevice, "fetch", noted)
    with FakeCameraProcess():
        watch = FrameWatch("genicam:127.0.0.1?format=Mono8&fps=20&width=64&height=48")
        begun = time.monotonic()
        frames = watch.first(10)
        ended = time.monotonic()
    assert all(begun - 0.1 < frame.t <= ended for frame in frames)
    offsets = [frame.t - stamps[frame.index] for frame in frames]
    drift = 3e-4 * (ended - begun)  # that the clock is let rise by
    assert max(np.diff(offsets)) <= drift
    to_wall = time.monotonic() - time.time()  # the fake stamps by the wall clock
    assert -1e-3 < offsets[-1] - to_wall < 1.0
    assert {frame.clock for frame in frames} == {"device"}


@pytest.mark.parametrize(("stamp", "shift"), [("start", 2e-3), ("end", -2e-3)])
def test_time_is_mid_exposure_where_the_meaning_of_the_stamp_is_given(stamp: str, shift: float) -> None:
    with FakeCameraProcess():
        watch = FrameWatch(
            f"genicam:127.0.0.1?format=Mono8&fps=20&width=64&height=48&exposure_us=4000&stamp={stamp}"
        )
        frame = watch.first(1)[0]
    assert frame.t - frame.raw_t == pytest.approx(shift)


def test_a_region_of_the_sensor() -> None:
    with FakeCameraProcess():
        watch = FrameWatch("genicam:127.0.0.1?format=Mono8&fps=20&width=100&height=80&x=40&y=30")
        frame = watch.first(1)[0]
    controls = watch.camera.info.controls
    assert frame.image.shape == (80, 100)
    assert [controls[key] for key in ("OffsetX", "OffsetY", "Width", "Height")] == ["40", "30", "100", "80"]


OF_ONE_CAMERA = {
    name: test
    for name, test in vars(contract).items()
    if name.startswith("test_") and list(signature(test).parameters) == ["camera"]
}
globals().update(OF_ONE_CAMERA)


@pytest.fixture(scope="module")
def fake() -> Iterator[FakeCameraProcess]:
    with FakeCameraProcess() as started:
        yield started


@pytest.fixture(params=["Mono8", "Mono12p"])
def camera(request: pytest.FixtureRequest, fake: FakeCameraProcess) -> Iterator[Camera]:
    opened = open_camera(f"genicam:127.0.0.1?format={request.param}&fps=50&width=64&height=48")
    yield opened
    opened.close()


def test_the_whole_contract_is_here() -> None:
    assert len(OF_ONE_CAMERA) >= 9
