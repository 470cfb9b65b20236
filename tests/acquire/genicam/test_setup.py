"""What an address asks of a camera, against one made up of numbers: set, read back, refused, warned of."""

from __future__ import annotations

from typing import Any

import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError
from acquire.genicam.library import GenicamError
from acquire.genicam.settings import GenicamSettings
from acquire.genicam.setup import GenicamSetup, set_up
from acquire.settings import read_settings


class MadeUpCamera:
    """Features by name; ``makes`` changes what is written into what is in force."""

    def __init__(self, **more: Any) -> None:
        self.values: dict[str, Any] = {
            "PixelFormat": "Mono8", "Width": 640, "Height": 480, "OffsetX": 8, "OffsetY": 4,
            "exposure_time": 2500.0, "gain": 3.0, "frame_rate": 20.0, "packet_size": 1400,
            "ExposureAuto": "Continuous", "GammaEnable": "true",
        } | more  # fmt: skip
        self.makes: dict[str, Any] = {}
        self.is_gige, self.identity = "GevSCPSPacketSize" in more, "made up"

    def has(self, feature: str) -> bool:
        return feature in self.values

    def kind(self, feature: str) -> str:
        return "Enumeration" if self.choices(feature) else "Float"

    def choices(self, feature: str) -> list[str]:
        return {
            "PixelFormat": ["Mono8", "Mono12p"],
            "ExposureAuto": ["Off", "Once", "Continuous"],
            "TriggerSource": ["Line0"],
        }.get(feature, [])

    def text(self, feature: str) -> str:
        return str(self.values[feature])

    def set_text(self, feature: str, value: str) -> None:
        if value == "refused":
            raise GenicamError("no")
        self.values[feature] = self.makes.get(feature, value)

    def integer(self, feature: str) -> int:
        return int(self.values[feature])

    def integer_bounds(self, feature: str) -> tuple[int, int, int]:
        return {"Width": (16, 1280, 16), "Height": (2, 1024, 2), "OffsetX": (0, 640, 8)}.get(
            feature, (0, 512, 1)
        )

    def set_integer(self, feature: str, value: int) -> None:
        self.values[feature] = self.makes.get(feature, value)

    def bounds_of(self, what: str) -> tuple[float, float]:
        return {"exposure_time": (10.0, 1e6), "gain": (0.0, 24.0)}.get(what, (1.0, 100.0))

    def ask(self, name: str, *given: Any) -> Any:
        words = name.removeprefix("arv_camera_").removeprefix("gv_")
        if words.startswith("is_"):
            return words.removeprefix("is_").removesuffix("_available") in self.values
        if words.startswith("set_") and words != "set_packet_size_adjustment":
            what = words.removeprefix("set_")
            self.values[what] = self.makes.get(what, given[0])
        return self.values.get(words.removeprefix("get_"))


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


def made(query: str = "", **more: Any) -> tuple[GenicamSetup, MadeUpCamera]:
    camera = MadeUpCamera(**more)
    return asked(query, camera), camera


def asked(query: str, camera: MadeUpCamera) -> GenicamSetup:
    return set_up(camera, read_settings(GenicamSettings, parse_address(f"genicam:1?{query}")), "genicam:1")  # type: ignore[arg-type]


def test_what_is_in_force_is_read_back() -> None:
    found, camera = made("exposure_us=8000&gain=6&fps=30&x=16&y=3&width=320&height=200&format=Mono12p")
    assert (found.x, found.y, found.info.width, found.info.height) == (16, 3, 320, 200)
    assert (found.info.exposure_s, found.gain) == (pytest.approx(8e-3), 6)
    assert (found.info.fps, found.info.bits) == (30, 12)
    assert (camera.values["ExposureAuto"], camera.values["GammaEnable"]) == ("Off", "false")
    exposure, gain = found.info.settings
    assert (exposure.low, exposure.high) == (10, pytest.approx(1e6 / 30))
    assert (gain.low, gain.high) == (0, 24)


def test_what_was_asked_is_asked_again_after_the_camera_was_away() -> None:
    found, _ = made("format=Mono12p&trigger=no")
    again = found.kept(read_settings(GenicamSettings, parse_address("genicam:1?fps=20")))
    assert (again.exposure_us, again.gain, again.fps) == (pytest.approx(2500), 3, 20)
    assert (again.format, again.x, again.y, again.width, again.height) == ("Mono12p", 8, 4, 640, 480)


@pytest.mark.parametrize(
    ("query", "makes", "words"),
    [
        ("width=328", {}, "width=328 is not possible; allowed: 16 to 1280 in steps of 16"),
        ("width=1296", {}, "width=1296 is not possible; allowed: 16 to 1280"),
        ("x=4", {}, "x=4 is not possible; allowed: 0 to 640 in steps of 8"),
        ("y=513", {}, "y=513 is not possible; allowed: 0 to 512"),
        ("exposure_us=5", {}, ".*from 10 to"),
        ("fps=0.5", {}, "fps=0.5 is not possible; allowed: a number from 1 to 100"),
        ("format=Mono8&bits=9", {}, "bits=9 is not possible with Mono8"),
        ("format=Mono12p&bits=8", {}, "bits=8 is not possible with Mono12p"),
        ("format=Mono16", {}, "format=Mono16 is not possible; allowed: Mono12p, Mono8"),
        ("format=BayerRG8", {}, "format=BayerRG8 is not possible; allowed: Mono12p, Mono8"),
        ("packet_size=8000", {}, ".*is for GigE cameras"),
        ("trigger=Line9", {}, "trigger=Line9 is not possible; allowed: no, Line0, Software"),
        ("trigger=Software", {}, "trigger=Software needs fps=, the rate at which pictures are triggered"),
        ("Nothing=1", {}, "this camera has no feature 'Nothing'; known settings: format, x, y, width"),
        ("ExposureAuto=Never", {}, "ExposureAuto=Never is not possible; allowed: Off, Once, Continuous"),
        ("GammaEnable=refused", {}, r"GammaEnable=refused: the camera refuses it \(no\)"),
        ("trigger=Line0", {"TriggerMode": "Off"}, "trigger=Line0: the camera makes it Line0, Off"),
        ("trigger=Line0", {"TriggerSource": "Software"}, "trigger=Line0: the camera makes it Software, On"),
        ("Gamma=0.5", {"Gamma": 0.7}, "Gamma=0.5: the camera makes it 0.7; ask for that"),
        ("gain=6", {"gain": 6.1}, "gain=6: the camera makes it 6.1"),
        ("gain=-6", {"gain": -6.1}, "gain=-6: the camera makes it -6.1; ask for"),
        ("fps=30", {"frame_rate": 29.0}, "fps=30: the camera makes it 29"),
        ("width=320", {"Width": 336}, "width=320: the camera makes it 336"),
        ("format=Mono8", {"PixelFormat": "Mono12p"}, "format=Mono8: the camera makes it Mono12p"),
    ],
)
def test_what_is_not_possible_or_made_otherwise_is_refused(
    query: str, makes: dict[str, Any], words: str
) -> None:
    camera = Able(Gamma=1.0)
    camera.makes = makes
    with pytest.raises(ConfigError, match=f"^genicam:1: {words}"):
        asked(query, camera)


@pytest.mark.parametrize(("gain", "got"), [(6, 6.05), (-6, -6.05)])
def test_another_value_is_in_force_within_a_hundredth(gain: float, got: float) -> None:
    camera = Able()
    camera.makes = {"gain": got}
    assert asked(f"gain={gain}", camera).gain == got


@pytest.mark.parametrize(
    ("query", "own", "white"),
    [
        ("", 4080, 4080),
        ("&white=4000", 4080, 4000),
        ("", 4095, None),
        ("", 0, None),
        ("&bits=10", 4080, None),
    ],
)
def test_the_white_level_is_that_of_the_camera_below_the_top_of_its_bits(
    query: str, own: int, white: int | None
) -> None:
    assert made(f"format=Mono12p{query}", PixelDynamicRangeMax=own)[0].info.white_level == white


@pytest.mark.parametrize(
    ("query", "more", "fps"),
    [
        ("", {}, 20.0),
        ("fps=40", {"ResultingFrameRate": 33.3}, 33.3),  # exposure or line limit it
        ("trigger=Line0", {"TriggerMode": "On", "TriggerSource": "Line0"}, None),
    ],
)
def test_the_rate_is_the_one_that_results(query: str, more: dict[str, Any], fps: float | None) -> None:
    found, _ = made(query, **more)
    assert found.info.fps == fps
    assert [text for text in found.info.warnings if "frames a second" in text] == (
        ["the camera gives 33.3 frames a second, not 40: exposure, size or line limit it"]
        if fps == 33.3
        else []
    )


def test_what_changes_by_itself_or_bends_the_light_is_warned_of() -> None:
    camera = MadeUpCamera(Gamma=0.45, GevSCPSPacketSize=1400)
    camera.makes = {"ExposureAuto": "Continuous"}
    texts = asked("", camera).info.warnings
    assert texts[0].startswith("the camera goes on changing by itself: ExposureAuto;")
    assert texts[1].startswith("Gamma is 0.45: grey levels are not proportional to light")
    assert texts[2].startswith("packets of 1400 bytes: it cannot try larger ones by itself")
    assert made("packet_size=1500", GevSCPSPacketSize=1400, Gamma=1.0)[0].info.warnings == ()


def test_a_rate_that_is_triggered_here_is_the_one_asked_for() -> None:
    found = asked("trigger=Software&fps=12", Able(frame_rate=77.0))
    assert found.info.fps == 12.0
    assert [found.info.controls[key] for key in ("TriggerMode", "TriggerSource")] == ["On", "Software"]
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
