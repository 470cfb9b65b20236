"""A made-up GenICam camera by value: settings and their bounds, triggers, packets, features, and buffers."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError, DeviceError
from acquire.genicam import device as device_module
from acquire.genicam import listing
from acquire.genicam.device import STATUS, GenicamDevice
from acquire.genicam.finding import FoundCamera
from acquire.genicam.library import GenicamError
from acquire.genicam.settings import GenicamSettings, genicam_settings
from tests.acquire.genicam.test_setup import MadeUpCamera, asked, made
from tests.acquire.genicam.test_without_a_camera import named

ALLOWED = {
    "x": "a whole number from 0",
    "y": "a whole number from 0",
    "width": "a whole number from 1 to 65535",
    "height": "a whole number from 1 to 65535",
    "fps": "a number from 0.001 to 100000",
    "exposure_us": "a number from 0.1",
    "gain": "a number",
    "bits": "a whole number from 8 to 16",
    "white": "a whole number from 1 to 65535",
    "packet_size": "a whole number from 576 to 16384",
    "buffers": "a whole number from 2 to 1000",
    "stall_s": "a number from 0.1",
    "stamp": "one of start, end, ",
}


@pytest.mark.parametrize("key", ALLOWED)
def test_an_impossible_value_is_refused_with_what_is_allowed(key: str) -> None:
    with pytest.raises(ConfigError) as caught:
        genicam_settings(parse_address(f"genicam:1?{key}=nonsense"))
    assert str(caught.value).partition(" is not possible; allowed: ")[2] == ALLOWED[key]


def test_of_an_address_alone_the_camera_keeps_what_it_has() -> None:
    plain = genicam_settings(parse_address("genicam:1"))
    assert plain == GenicamSettings() and (plain.trigger, plain.buffers, plain.stamp) == ("no", 16, "")
    software = genicam_settings(parse_address("genicam:1?trigger=Software"))
    assert software.fires_triggers and not software.waits_for_trigger
    assert not (plain.fires_triggers or plain.waits_for_trigger)


class Able(MadeUpCamera):
    """Has a gain below zero, and triggers."""

    def __init__(self, **more: Any) -> None:
        super().__init__(TriggerMode="Off", TriggerSource="Line0", **more)

    def choices(self, feature: str) -> list[str]:
        return ["Line0", "Software"] if feature == "TriggerSource" else super().choices(feature)

    def bounds_of(self, what: str) -> tuple[float, float]:
        return (-12.0, 24.0) if what == "gain" else super().bounds_of(what)

    def ask(self, name: str, *given: Any) -> Any:
        if name == "arv_camera_set_trigger":
            self.values |= {"TriggerMode": "On", "TriggerSource": given[0]} | self.makes
            return None
        return super().ask(name, *given)


@pytest.mark.parametrize(
    ("got", "words"), [(-6.05, ""), (-6.1, "gain=-6: the camera makes it -6.1; ask for")]
)
def test_a_gain_below_zero_is_in_force_within_a_hundredth_too(got: float, words: str) -> None:
    camera = Able()
    camera.makes = {"gain": got}
    if not words:
        assert asked("gain=-6", camera).gain == got
        return
    with pytest.raises(ConfigError, match=words):
        asked("gain=-6", camera)


@pytest.mark.parametrize(
    ("query", "makes", "words"),
    [
        ("trigger=Line9", {}, "trigger=Line9 is not possible; allowed: no, Line0, Software"),
        ("trigger=Software", {}, "trigger=Software needs fps=, the rate at which pictures are triggered"),
        ("trigger=Line0", {"TriggerMode": "Off"}, "trigger=Line0: the camera makes it Line0, Off"),
        ("trigger=Line0", {"TriggerSource": "Software"}, "trigger=Line0: the camera makes it Software, On"),
        ("Nothing=1", {}, "this camera has no feature 'Nothing'; known settings: format, fps, exposure_us"),
        ("ExposureAuto=Never", {}, "ExposureAuto=Never is not possible; allowed: Off, Once, Continuous"),
        ("GammaEnable=refused", {}, r"GammaEnable=refused: the camera refuses it \(no\)"),
        ("Gamma=0.5", {"Gamma": 0.7}, "Gamma=0.5: the camera makes it 0.7; ask for that"),
        ("fps=0.5", {}, "fps=0.5 is not possible; allowed: a number from 1 to 100"),
        ("y=513", {}, "y=513 is not possible; allowed: 0 to 512"),
        ("format=BayerRG8", {}, "format=BayerRG8 is not possible; the camera offers Mono12p, Mono8"),
    ],
)
def test_what_the_camera_does_not_do_is_refused(query: str, makes: dict[str, Any], words: str) -> None:
    camera = Able(Gamma=1.0)
    camera.makes = makes
    with pytest.raises(ConfigError, match=f"^genicam:1: {words}"):
        asked(query, camera)


def test_a_rate_that_is_triggered_here_is_the_one_asked_for() -> None:
    found = asked("trigger=Software&fps=12", Able(frame_rate=77.0))
    assert (found.fps, found.controls["TriggerMode"], found.controls["TriggerSource"]) == (
        12.0,
        "On",
        "Software",
    )
    assert asked("", Able(frame_rate=0.0)).fps is None
    assert asked("", Able(AcquisitionResultingFrameRate=0.0)).fps is None
    without = Able()
    del without.values["frame_rate"]
    assert asked("", without).fps is None
    with pytest.raises(ConfigError, match="fps=5: this camera has no such setting; leave it out"):
        asked("fps=5", without)


@pytest.mark.parametrize(("resulting", "warned"), [(39.7, False), (39.5, True)])
def test_a_rate_is_short_by_more_than_a_hundredth(resulting: float, warned: bool) -> None:
    found, _ = made("fps=40", ResultingFrameRate=resulting)
    assert bool(found.warnings) == warned


@pytest.mark.parametrize(
    ("query", "bits"),
    [
        ("format=Mono8", 8),
        ("format=Mono8&bits=8", 8),
        ("format=Mono12p", 12),
        ("format=Mono12p&bits=9", 9),
        ("", 12),
    ],
)
def test_significant_bits_are_those_of_the_format_or_fewer(query: str, bits: int) -> None:
    assert made(query)[0].bits == bits


def test_what_is_stored_of_a_camera() -> None:
    found, camera = made("BlackLevel=64&format=Mono8", BlackLevel="0", AcquisitionMode="SingleFrame")
    assert found.controls == {
        "PixelFormat": "Mono8", "Width": "640", "Height": "480", "OffsetX": "8", "OffsetY": "4",
        "BlackLevel": "64", "ExposureAuto": "Off",
    }  # fmt: skip
    assert camera.values["AcquisitionMode"] == "Continuous"
    assert found.exposure_s == pytest.approx(2.5e-3) and found.formats == ("Mono12p", "Mono8")
    assert (found.picture, found.white) == (("Mono8", 640, 480), None)


def test_a_region_is_set_from_the_lowest_offset_on() -> None:
    """The size that is possible depends on where it begins."""
    order: list[tuple[str, int]] = []

    class Ordered(MadeUpCamera):
        def set_integer(self, feature: str, value: int) -> None:
            order.append((feature, value))
            super().set_integer(feature, value)

    asked("x=16&width=320", Ordered())
    assert order == [("OffsetX", 0), ("OffsetY", 0), ("Width", 320), ("OffsetX", 16)]
    order.clear()
    asked("", Ordered())
    assert order == []


@pytest.mark.parametrize(
    ("query", "size", "test_packet", "words"),
    [
        ("", 1500, True, ""),
        ("", 1499, True, "packets of 1499 bytes: larger ones did not pass"),
        ("packet_size=8000", 8000, False, ""),
        ("packet_size=1400", 1400, False, "packets of 1400 bytes: it cannot try larger ones by itself"),
    ],
)
def test_small_packets_are_warned_of(query: str, size: int, test_packet: bool, words: str) -> None:
    more = {"GevSCPSFireTestPacket": "0"} if test_packet else {}
    texts = made(query, GevSCPSPacketSize=size, packet_size=size, **more)[0].warnings
    assert [text.partition(";")[0] for text in texts] == ([words] if words else [])


def test_another_packet_size_than_asked_is_refused() -> None:
    camera = MadeUpCamera(GevSCPSPacketSize=1400)
    camera.makes = {"packet_size": 1444}
    with pytest.raises(ConfigError, match="packet_size=8000: the camera makes it 1444; ask for that"):
        asked("packet_size=8000", camera)


def test_part_of_a_name_means_no_camera() -> None:
    for target in ("Maker", "Mod", "maker-1"):
        with pytest.raises(DeviceError, match=r"Cameras here: genicam:Maker-1  x Modern \(1, x x\)"):
            named(target, "1")


# -- buffers ----------------------------------------------------------------------------------


class Library:
    """Answers by name, and notes what is asked."""

    def __init__(self, **answers: Any) -> None:
        self.answers = {
            "buffer_get_status": 0,
            "buffer_get_image_width": 3,
            "buffer_get_image_height": 2,
        } | answers
        self.calls: list[tuple[Any, ...]] = []
        self.lost: Any = None

    def call(self, name: str, *arguments: Any) -> Any:
        self.calls.append((name, *arguments))
        answer = self.answers.get(name.removeprefix("arv_"), 1)
        if isinstance(answer, Exception):
            raise answer
        return answer

    def on_signal(self, instance: int, signal: str, action: Any) -> Any:
        self.lost = action
        return action

    def bounds(self, name: str, *arguments: Any, whole: bool = False) -> tuple[float, float]:
        return (8.0, 640.0) if whole else (0.5, 99.5)

    def content(self, buffer: int) -> memoryview:
        return memoryview(bytes(range(6)))

    def row_padding(self, buffer: int) -> int:
        return 5

    def named(self, name: str) -> list[tuple[Any, ...]]:
        return [call for call in self.calls if call[0] == name]


def opened(library: Library) -> GenicamDevice:
    return GenicamDevice(library, "any")  # type: ignore[arg-type]


def taken(content: memoryview, padding: int) -> tuple[list[int], int]:
    return np.frombuffer(content, np.uint8).tolist(), padding


def test_a_buffer_by_value(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device_module.time, "time_ns", lambda: 5_250_000_000)
    library = Library(
        buffer_get_frame_id=77, buffer_get_timestamp=123_456, buffer_get_system_timestamp=5_000_000_000
    )
    device = opened(library)
    device.start(3)
    assert len(library.named("arv_stream_push_buffer")) == 3
    received = device.fetch(0.25, taken)
    assert received is not None
    assert (received.number, received.stamp_ns, received.age_s) == (77, 123_456, pytest.approx(0.25))
    assert (received.trouble, received.size, received.taken) == ("", (3, 2), ([0, 1, 2, 3, 4, 5], 5))
    assert library.named("arv_stream_timeout_pop_buffer") == [("arv_stream_timeout_pop_buffer", 1, 250_000)]
    assert len(library.named("arv_stream_push_buffer")) == 4, "it goes back"


@pytest.mark.parametrize(("now_s", "age_s"), [(4.9, 0.0), (5.0, 0.0), (64.9, 59.9), (65.1, 0.0)])
def test_an_age_beyond_sense_is_none(now_s: float, age_s: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """The wall clock may have been set meanwhile."""
    monkeypatch.setattr(device_module.time, "time_ns", lambda: round(now_s * 1e9))
    device = opened(Library(buffer_get_system_timestamp=5_000_000_000))
    device.start(1)
    received = device.fetch(1.0, taken)
    assert received is not None and received.age_s == pytest.approx(age_s)


@pytest.mark.parametrize(
    ("status", "words"), [(3, "packets are missing"), (6, "it is not complete"), (99, "unknown")]
)
def test_a_buffer_that_is_not_whole_is_not_taken(status: int, words: str) -> None:
    device = opened(Library(buffer_get_status=status))
    device.start(1)
    received = device.fetch(1.0, taken)
    assert received is not None and received.trouble.startswith(words)
    assert (received.size, received.taken) == ((0, 0), None)
    assert set(STATUS) == {-1, 1, 2, 3, 4, 5, 6, 7, 8}


def test_no_buffer_is_no_picture_and_a_closed_camera_gives_none() -> None:
    library = Library(stream_timeout_pop_buffer=None)
    device = opened(library)
    device.start(1)
    assert device.streaming and device.fetch(0.1, taken) is None
    device.close()
    assert not device.streaming
    assert [call[0] for call in library.calls[-3:]] == [
        "arv_camera_stop_acquisition", "g_object_unref", "g_object_unref",
    ]  # fmt: skip
    count = len(library.calls)
    device.close()
    assert len(library.calls) == count
    for use in (lambda: device.fetch(0.1, taken), lambda: device.integer("Width")):
        with pytest.raises(GenicamError, match="the camera is closed"):
            use()
    assert not device.has("Width")


def test_numbers_of_a_feature() -> None:
    device = opened(Library(camera_get_integer=320, camera_get_integer_increment=16))
    assert (device.integer("Width"), device.integer_bounds("Width"), device.highest("Width")) == (
        320, (8, 640, 16), 640,
    )  # fmt: skip
    assert device.bounds_of("gain") == (0.5, 99.5)


def test_who_a_camera_is_and_that_it_is_lost() -> None:
    library = Library(
        camera_get_vendor_name="Maker", camera_get_model_name="M1",
        camera_get_device_serial_number=GenicamError("it has none"),
    )  # fmt: skip
    device = opened(library)
    assert str(device.identity) == "Maker M1 ()"
    assert isinstance(device.lost, threading.Event) and not device.lost.is_set()
    library.lost()
    assert device.lost.is_set()


@pytest.mark.parametrize(
    ("answers", "words"),
    [
        ({"camera_new": None}, "it is not there"),
        ({"gv_device_is_controller": 0}, "another program holds the camera"),
    ],
)
def test_a_camera_that_cannot_be_had(answers: dict[str, Any], words: str) -> None:
    with pytest.raises(GenicamError, match=words):
        opened(Library(**answers))
    assert opened(Library(camera_is_gv_device=0, gv_device_is_controller=0)).is_gige is False


def test_a_camera_in_the_list(monkeypatch: pytest.MonkeyPatch) -> None:
    class Listed(Able):
        closed = False

        def highest(self, feature: str) -> int:
            return {"Width": 1280, "Height": 1024}[feature]

        def close(self) -> None:
            Listed.closed = True

    camera = Listed()
    monkeypatch.setattr(listing, "GenicamDevice", lambda library, name: camera)
    found = listing._look_at(None, FoundCamera("Maker-1", "Maker", "M1", "1", "10.0.0.2", "GigEVision"))  # type: ignore[arg-type]
    assert (found.address, found.trouble) == ("genicam:Maker-1?format=Mono12p", "")
    assert found.name == "Maker M1 (1, GigEVision 10.0.0.2)" and Listed.closed
    assert found.details == (
        "format=Mono12p, Mono8", "640x480 of 1280x1024", "fps=20 (1..100)", "exposure_us=2500 (10..1e+06)",
        "gain=3 (-12..24)", "trigger=no, Line0, Software",
    )  # fmt: skip
