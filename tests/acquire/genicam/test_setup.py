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
    ("query", "words"),
    [
        ("width=328", "allowed: 16 to 1280 in steps of 16"),
        ("width=1296", "allowed: 16 to 1280"),
        ("x=4", "allowed: 0 to 640 in steps of 8"),
        ("exposure_us=5", "from 10 to"),
        ("format=Mono8&bits=9", "bits=9 is not possible with Mono8"),
        ("format=Mono12p&bits=8", "bits=8 is not possible with Mono12p"),
        ("format=Mono16", "format=Mono16 is not possible; allowed: Mono12p, Mono8"),
        ("packet_size=8000", "is for GigE cameras"),
    ],
)
def test_what_is_not_possible_is_refused_with_what_is(query: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        made(query)


@pytest.mark.parametrize(
    ("query", "makes", "words"),
    [
        ("gain=6", {"gain": 6.05}, ""),
        ("gain=6", {"gain": 6.1}, "gain=6: the camera makes it 6.1"),
        ("fps=30", {"frame_rate": 29.0}, "fps=30: the camera makes it 29"),
        ("width=320", {"Width": 336}, "width=320: the camera makes it 336"),
        ("format=Mono8", {"PixelFormat": "Mono12p"}, "format=Mono8: the camera makes it Mono12p"),
    ],
)
def test_another_value_than_asked_is_refused_beyond_one_percent(
    query: str, makes: dict[str, Any], words: str
) -> None:
    camera = MadeUpCamera()
    camera.makes = makes
    if not words:
        assert asked(query, camera).gain == 6.05
        return
    with pytest.raises(ConfigError, match=words):
        asked(query, camera)


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
