"""What needs no camera: settings, the library that is missing, and which camera is meant."""

from __future__ import annotations

import sys
from typing import Any

import pytest

from acquire.addresses import parse_address
from acquire.camera.contract import open_camera
from acquire.errors import ConfigError, DeviceError
from acquire.genicam import library
from acquire.genicam.camera import list_cameras, name_of
from acquire.genicam.library import CALLS, load_aravis
from acquire.genicam.settings import GenicamSettings
from acquire.pylon import list_cameras as list_basler_cameras
from acquire.settings import read_settings


class ListOfCameras:
    """A library that only lists."""

    def __init__(self, *serials: str) -> None:
        self.serials = serials

    def call(self, name: str, *arguments: Any) -> Any:
        assert name in CALLS
        if name == "arv_get_n_devices":
            return len(self.serials)
        if name == "arv_update_device_list":
            return None
        serial = self.serials[arguments[0]]
        return {"id": f"Maker-{serial}", "model": "Modern", "serial_nbr": serial}.get(
            name.removeprefix("arv_get_device_"), "x"
        )


def named(target: str, *serials: str) -> str:
    return name_of(ListOfCameras(*serials), target, "genicam:")  # type: ignore[arg-type]


def test_which_camera_is_meant() -> None:
    assert named("", "1") == "Maker-1"
    assert named("2", "1", "2") == named("Maker-2", "1", "2") == "Maker-2"
    assert named("Modern", "1") == "Maker-1"
    assert named("192.168.0.3") == "192.168.0.3"
    with pytest.raises(ConfigError, match=r"2 cameras are meant.*genicam:Maker-1 .*genicam:Maker-2"):
        named("Modern", "1", "2")
    with pytest.raises(DeviceError, match="Cameras here: none"):
        named("")
    for part in ("Maker", "Mod", "maker-1"):
        with pytest.raises(DeviceError, match=r"Cameras here: genicam:Maker-1  x Modern \(1, x x\)"):
            named(part, "1")


def test_settings_and_features() -> None:
    address = parse_address("genicam:1?format=Mono12p&fps=30&trigger=Line0&stamp=end&BlackLevel=64")
    settings = read_settings(GenicamSettings, address)
    assert (settings.format, settings.fps, settings.stamp) == ("Mono12p", 30, "end")
    assert settings.waits_for_trigger and not settings.fires_triggers
    assert settings.features == {"BlackLevel": "64"}
    plain = read_settings(GenicamSettings, parse_address("genicam:1"))
    assert plain == GenicamSettings() and (plain.trigger, plain.buffers, plain.stamp) == ("no", 16, "")
    software = read_settings(GenicamSettings, parse_address("genicam:1?trigger=Software"))
    assert software.fires_triggers and not software.waits_for_trigger
    assert not (plain.fires_triggers or plain.waits_for_trigger)


def test_pylon_without_pypylon_is_named_and_lists_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pypylon", None)
    with pytest.raises(DeviceError, match=r"pip install 'phasedic\[pylon\]'"):
        open_camera("pylon:")
    assert list_basler_cameras() == []


def test_a_missing_library_is_named_and_lists_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library, "LIBRARY", "libaravis-not-here.so.0")
    monkeypatch.setattr(
        library.ctypes.util, "find_library", lambda name: name if name == "aravis-0.10" else None
    )
    load_aravis.cache_clear()
    with pytest.raises(DeviceError, match=r"aravis-0\.10 is here, .*sudo apt install libaravis-0\.8-0"):
        load_aravis()
    assert list_cameras() == []
