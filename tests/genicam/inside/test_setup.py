"""What an address asks is checked, set and read back; what is not possible is refused with what is."""

from __future__ import annotations

import contextlib
import ctypes as c
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from acquire.camera.contract import list_cameras, open_camera
from acquire.errors import ConfigError, DeviceError
from acquire.genicam.library import load_aravis
from live.config.loading import load_config
from live.ui.web.broadcaster import Broadcaster
from live.ui.web.setup.config_draft import ConfigDraft
from live.ui.web.setup.draft_changes import CHANGES
from live.ui.web.setup.setup_session import SetupSession
from tests.contracts.watching import FrameWatch
from tests.genicam.inside.fakes import FakeCameraProcess
from tests.live.ui.waiting import until


@pytest.fixture(scope="module")
def fake() -> Iterator[FakeCameraProcess]:
    with FakeCameraProcess("--white", "4080", "--automatic") as started:
        yield started


SMALL = "format=Mono12p&width=64&height=48"


def test_it_is_listed_with_what_it_offers(fake: FakeCameraProcess) -> None:
    (found,) = [one for one in list_cameras() if one.address.startswith("genicam:")]
    assert found.address == "genicam:Aravis-Fake-GV01?format=Mono12p"
    assert found.trouble == ""
    assert "Mono12Packed" in found.text() and "exposure_us=" in found.text()
    open_camera(found.address).close()


def test_it_is_in_the_lists_of_the_page_with_its_formats(fake: FakeCameraProcess, tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text('[camera]\naddress = "sim:?width=64&height=64"\n')
    with SetupSession(ConfigDraft(load_config(rig, {}), rig, {}), Broadcaster()) as session:
        until(lambda: session.preview.info is not None)
        session.devices.search()
        until(
            lambda: any(
                one["address"].startswith("genicam:") for one in session.state()["devices"]["cameras"]
            )
        )
        listed = session.state()["devices"]["cameras"]
        (found,) = [one for one in listed if one["address"].startswith("genicam:")]
        assert "Fake" in found["name"] and found["trouble"] == ""
        CHANGES["address"](session, {"value": found["address"]})
        camera = session.state()["camera"]
        assert camera["format"] == "Mono12p" == camera["formats"][0] and "Mono8" in camera["formats"]
        CHANGES["option"](session, {"key": "format", "value": "Mono8"})
        assert session.state()["camera"]["bits"] == 8


@pytest.mark.parametrize("target", ["", "GV01", "Fake", "Aravis-Fake-GV01", "127.0.0.1"])
def test_a_camera_has_several_names(fake: FakeCameraProcess, target: str) -> None:
    with contextlib.closing(open_camera(f"genicam:{target}?{SMALL}")) as camera:
        assert "Aravis Fake (GV01)" in camera.info.name


def test_settings_are_in_force_and_can_be_changed(fake: FakeCameraProcess) -> None:
    address = f"genicam:127.0.0.1?{SMALL}&fps=20&exposure_us=5000&gain=3"
    with contextlib.closing(open_camera(address)) as camera:
        info = camera.info
    assert (info.fps, info.exposure_s, info.bits) == (pytest.approx(20), pytest.approx(5e-3), 12)
    exposure, gain = info.settings
    assert (exposure.key, exposure.value, exposure.high) == ("exposure_us", 5000, pytest.approx(50_000))
    assert (gain.key, gain.value, gain.low, gain.high) == ("gain", 3, 0, 10)


def test_automatics_are_off_and_the_white_level_is_the_cameras(fake: FakeCameraProcess) -> None:
    with contextlib.closing(open_camera(f"genicam:127.0.0.1?{SMALL}")) as camera:
        info = camera.info
    assert info.controls["GainAuto"] == "Off"
    assert (info.white_level, info.saturation) == (4080, 4080)
    assert not [text for text in info.warnings if "changing by itself" in text]
    watch = FrameWatch(f"genicam:127.0.0.1?{SMALL}&fps=20&white=4000&GainAuto=Continuous")
    assert watch.first(1)[0].saturation == 4000
    assert any("GainAuto" in text for text in watch.camera.info.warnings)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ("format=Mono9", "allowed: Mono12p, "),
        ("width=5000", "allowed: 1 to 2048"),
        ("exposure_us=1", "from 10 to"),
        ("gain=11", "from 0 to 10"),
        ("trigger=Line7", "allowed: no, Line0"),
        ("trigger=Software", "needs fps="),
        ("bits=13&format=Mono12p", "bits=13 is not possible with Mono12p"),
        ("stamp=middle", "one of start, end"),
        ("Fancy=1", "no feature 'Fancy'"),
        ("GainAuto=Sometimes", "allowed: Off, Once, Continuous"),
        ("GainRaw=99", "the camera refuses it"),
        ("buffers=1", "from 2 to 1000"),
    ],
)
def test_what_is_not_possible_is_refused_with_what_is(
    fake: FakeCameraProcess, settings: str, words: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        open_camera(f"genicam:127.0.0.1?{settings}")
    assert words in str(caught.value)
    open_camera(f"genicam:127.0.0.1?{SMALL}").close()  # nothing was left open


def test_small_packets_are_warned_of(fake: FakeCameraProcess) -> None:
    for size, few in ((1400, True), (4000, False)):
        with contextlib.closing(open_camera(f"genicam:127.0.0.1?{SMALL}&packet_size={size}")) as camera:
            warned = [text for text in camera.info.warnings if f"packets of {size} bytes" in text]
            assert bool(warned) == few
            assert all("packet_size=8000" in text for text in warned)
            assert camera.info.controls["GevSCPSPacketSize"] == str(size)


def test_the_padding_of_rows_is_read_through_the_library(monkeypatch: pytest.MonkeyPatch) -> None:
    """The fake sends none; here a function of C with the same arguments gives it."""
    library = load_aravis()

    @c.CFUNCTYPE(None, c.c_void_p, c.POINTER(c.c_int), c.POINTER(c.c_int))
    def six_bytes(buffer: int, across: Any, down: Any) -> None:
        across[0], down[0] = 6, 0

    monkeypatch.setattr(library, "_get_padding", six_bytes)
    assert library.row_padding(7) == 6
    monkeypatch.setattr(library, "_get_padding", None)  # Aravis before 0.8.23
    assert library.row_padding(7) == 0


def test_a_camera_that_another_program_holds(fake: FakeCameraProcess) -> None:
    held = contextlib.closing(open_camera(f"genicam:127.0.0.1?{SMALL}"))
    with held, pytest.raises(DeviceError, match="Close other programs"):
        open_camera(f"genicam:127.0.0.1?{SMALL}")
    open_camera(f"genicam:127.0.0.1?{SMALL}").close()


def test_a_camera_that_is_not_there(fake: FakeCameraProcess) -> None:
    with pytest.raises(DeviceError, match=r"Cameras here: genicam:Aravis-Fake-GV01"):
        open_camera("genicam:Basler-1234")


def test_several_cameras_are_told_apart(fake: FakeCameraProcess) -> None:
    with FakeCameraProcess("--serial", "GV02", "--interface", "127.0.0.2"):
        with pytest.raises(ConfigError, match="2 cameras are meant"):
            open_camera("genicam:")
        with contextlib.closing(open_camera(f"genicam:GV02?{SMALL}")) as camera:
            assert "GV02" in camera.info.name
