"""Settings of a made-up GenICam camera: bounds, packets, regions, and software triggers at a steady rate."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError, DeviceError
from acquire.genicam import camera
from acquire.genicam.device import GenicamDevice
from acquire.genicam.library import GenicamError
from acquire.genicam.settings import GenicamSettings
from acquire.settings import read_settings
from tests.acquire.genicam.test_setup import MadeUpCamera, asked, made
from tests.acquire.genicam.test_without_a_camera import named


def test_of_an_address_alone_the_camera_keeps_what_it_has() -> None:
    plain = read_settings(GenicamSettings, parse_address("genicam:1"))
    assert plain == GenicamSettings() and (plain.trigger, plain.buffers, plain.stamp) == ("no", 16, "")
    software = read_settings(GenicamSettings, parse_address("genicam:1?trigger=Software"))
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
        ("Nothing=1", {}, "this camera has no feature 'Nothing'; known settings: format, x, y, width"),
        ("ExposureAuto=Never", {}, "ExposureAuto=Never is not possible; allowed: Off, Once, Continuous"),
        ("GammaEnable=refused", {}, r"GammaEnable=refused: the camera refuses it \(no\)"),
        ("Gamma=0.5", {"Gamma": 0.7}, "Gamma=0.5: the camera makes it 0.7; ask for that"),
        ("fps=0.5", {}, "fps=0.5 is not possible; allowed: a number from 1 to 100"),
        ("y=513", {}, "y=513 is not possible; allowed: 0 to 512"),
        ("format=BayerRG8", {}, "format=BayerRG8 is not possible; allowed: Mono12p, Mono8"),
    ],
)
def test_what_the_camera_does_not_do_is_refused(query: str, makes: dict[str, Any], words: str) -> None:
    camera = Able(Gamma=1.0)
    camera.makes = makes
    with pytest.raises(ConfigError, match=f"^genicam:1: {words}"):
        asked(query, camera)


def test_a_rate_that_is_triggered_here_is_the_one_asked_for() -> None:
    found = asked("trigger=Software&fps=12", Able(frame_rate=77.0))
    assert (found.info.fps, found.info.controls["TriggerMode"], found.info.controls["TriggerSource"]) == (
        12.0,
        "On",
        "Software",
    )
    assert asked("", Able(frame_rate=0.0)).info.fps is None
    assert asked("", Able(AcquisitionResultingFrameRate=0.0)).info.fps is None
    without = Able()
    del without.values["frame_rate"]
    assert asked("", without).info.fps is None
    with pytest.raises(ConfigError, match="fps=5: this camera has no such setting; leave it out"):
        asked("fps=5", without)


@pytest.mark.parametrize(("resulting", "warned"), [(39.7, False), (39.5, True)])
def test_a_rate_is_short_by_more_than_a_hundredth(resulting: float, warned: bool) -> None:
    found, _ = made("fps=40", ResultingFrameRate=resulting)
    assert bool(found.info.warnings) == warned


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
    assert made(query)[0].info.bits == bits


def test_what_is_stored_of_a_camera() -> None:
    found, camera = made("BlackLevel=64&format=Mono8", BlackLevel="0", AcquisitionMode="SingleFrame")
    assert found.info.controls == {
        "PixelFormat": "Mono8", "Width": "640", "Height": "480", "OffsetX": "8", "OffsetY": "4",
        "BlackLevel": "64", "ExposureAuto": "Off",
    }  # fmt: skip
    assert camera.values["AcquisitionMode"] == "Continuous"
    assert found.info.exposure_s == pytest.approx(2.5e-3) and found.info.formats == ("Mono12p", "Mono8")
    assert (found.info.pixel_format, found.info.white_level) == ("Mono8", None)


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
    texts = made(query, GevSCPSPacketSize=size, packet_size=size, **more)[0].info.warnings
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


class Bench:
    """A device and the time; work goes on in the caller, until ``turns`` waits have passed.

    Attributes
    ----------
    triggered : list of float, s
        When it was triggered.
    costs : list of float, s
        How long each trigger blocks; nothing after them.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, costs: list[float], turns: int) -> None:
        self.now, self.turns, self.costs = 100.0, turns, costs
        self.triggered: list[float] = []
        self.asked: list[str] = []
        self.stopped = False
        self.refused_from = 10**6
        self.at_refusal: Callable[[], None] = lambda: None
        threads = SimpleNamespace(Event=lambda: self, Thread=self._thread)
        monkeypatch.setattr(camera, "threading", threads)
        monkeypatch.setattr(camera, "time", SimpleNamespace(monotonic=lambda: self.now))

    def _thread(self, target: Callable[[], None], **_: Any) -> Any:
        return SimpleNamespace(start=target)

    def wait(self, seconds: float) -> bool:
        assert seconds >= 0.0
        self.turns -= 1
        self.now += seconds
        return self.stopped or self.turns < 0

    def set(self) -> None:
        self.stopped = True

    def is_set(self) -> bool:
        return self.stopped

    def ask(self, name: str) -> None:
        if len(self.triggered) >= self.refused_from:
            self.at_refusal()
            raise GenicamError("the line is down")
        self.asked.append(name)
        self.triggered.append(self.now)
        self.now += self.costs.pop(0) if self.costs else 0.0

    def work(self, period_s: float) -> str:
        """Why it is refused."""
        return camera.SoftwareTrigger(cast(GenicamDevice, self), period_s).refused


def test_one_picture_each_period_whatever_a_trigger_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch, [0.01, 0.03, 0.0, 0.02], turns=5)
    assert bench.work(0.05) == ""
    assert bench.triggered == pytest.approx([100.0, 100.05, 100.10, 100.15, 100.20])
    assert set(bench.asked) == {"arv_camera_software_trigger"}


def test_periods_that_a_trigger_blocked_are_not_caught_up(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch, [0.0, 0.22], turns=5)
    bench.work(0.05)
    assert bench.triggered == pytest.approx([100.0, 100.05, 100.27, 100.32, 100.37])


def test_a_refusal_is_kept_and_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch, [], turns=10)
    bench.refused_from = 3
    assert bench.work(0.05) == "the line is down"
    assert len(bench.triggered) == 3 and bench.turns == 6


def test_a_refusal_after_stop_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """A camera that is being closed refuses."""
    bench = Bench(monkeypatch, [], turns=10)
    bench.refused_from, bench.at_refusal = 3, bench.set
    assert bench.work(0.05) == ""
