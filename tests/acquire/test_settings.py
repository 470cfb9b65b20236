"""The settings of addresses, of every kind of camera: what each may be, its default, and what is refused."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from acquire.addresses import parse_address
from acquire.camera import CAMERAS
from acquire.errors import ConfigError
from acquire.settings import read_settings, settings_of
from live.cli import main

KINDS = dict(CAMERAS.settings())
SIDE, POSITIVE = "a whole number from 1 to 65535", "a number from 0.1"
OF_A_DEVICE = {"fps": "a number from 0.001 to 100000", "white": SIDE, "stall_s": POSITIVE}
GRAY = {"gray": "one of luma, r, g, b"}
ALLOWED: Mapping[str, Mapping[str, str]] = {
    "": OF_A_DEVICE | {
        "plane": "one of raw, r, g, b", "width": "a whole number from 1 to 65536",
        "height": "a whole number from 1 to 65536", "input": "a whole number from 0",
        "buffers": "a whole number from 2 to 32", "manual": "yes or no", "exposure_us": "a number from 1",
        "gain": "a whole number",
    },
    "genicam": OF_A_DEVICE | {
        "x": "a whole number from 0", "y": "a whole number from 0", "width": SIDE, "height": SIDE,
        "exposure_us": POSITIVE, "gain": "a number", "bits": "a whole number from 8 to 16",
        "packet_size": "a whole number from 576 to 16384", "buffers": "a whole number from 2 to 1000",
        "stamp": "one of start, end",
    },
    "pylon": {"white": SIDE, "stall_s": POSITIVE, "buffers": "a whole number from 2 to 1000"},
    "opencv": GRAY | {
        "width": "a number from 1", "height": "a number from 1", "fps": "a number from 0.001", "exposure": "a number",
        "gain": "a number",
    },
    "video": GRAY | {"fps": "a number from 1e-06 to 1e+06", "first": "a whole number from 1"}, "session": {},
    "files": GRAY | {
        "fps": "a number from 1e-06 to 1e+06", "bits": "a whole number from 1 to 16", "white": SIDE,
        "order": "one of auto, name, time",
    },
}  # fmt: skip
"""What is not just any text."""
CASES = [(scheme, key) for scheme, allowed in ALLOWED.items() for key in allowed]


def address(scheme: str, settings: str) -> str:
    return f"{scheme}:1?{settings}" if scheme else f"/dev/video0?{settings}"


@pytest.mark.parametrize(("scheme", "key"), CASES)
def test_an_impossible_value_is_refused_with_what_is_allowed(scheme: str, key: str) -> None:
    text = address(scheme, f"{key}=nonsense")
    with pytest.raises(ConfigError) as caught:
        read_settings(KINDS[scheme], parse_address(text))
    wanted = f"{text}: {key}=nonsense is not possible; allowed: {ALLOWED[scheme][key]}"
    assert str(caught.value) == wanted


@pytest.mark.parametrize("scheme", KINDS, ids=lambda scheme: scheme or "v4l2")
def test_each_is_declared_with_its_meaning(scheme: str) -> None:
    settings = list(settings_of(KINDS[scheme]))
    assert {one.key: one.allowed for one in settings if one.allowed and one.key} == ALLOWED[scheme]
    assert all(one.words for one in settings)
    plain = read_settings(
        KINDS[scheme], parse_address(address(scheme, "white=9") if "white" in ALLOWED[scheme] else "a:")
    )
    for one in settings:
        assert not one.key or one.key == "white" or getattr(plain, one.key) == one.default


@pytest.mark.parametrize("scheme", ["opencv", "video", "files"])
def test_an_unknown_one_is_refused_with_those_that_are_known(scheme: str) -> None:
    known = ", ".join(one.key for one in settings_of(KINDS[scheme]))
    with pytest.raises(ConfigError, match=f"unknown setting 'colour'; known: {known}$"):
        read_settings(KINDS[scheme], parse_address(f"{scheme}:1?colour=1"))


def test_others_are_taken_by_a_camera_with_features() -> None:
    for scheme, field, value in (
        ("", "controls", 4),
        ("genicam", "features", "4"),
        ("pylon", "features", "4"),
    ):
        found = read_settings(KINDS[scheme], parse_address(address(scheme, "BlackLevel=4&white=9")))
        assert getattr(found, field) == {"BlackLevel": value} and found.white == 9


def test_those_of_another_package_are_listed_behind_ours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    info = tmp_path / "other-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: other\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[phasedic.camera_settings]\nfilm = acquire.opencv.video:VideoSettings\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    assert [scheme for scheme, _ in CAMERAS.settings()] == [*KINDS, "film"]
    assert main(["devices", "--settings"]) == 0
    told = capsys.readouterr().out
    film = "  film:\n    gray: what is grey in a colour picture (one of luma, r, g, b)\n"
    film += "    fps: of the camera, where the film is played slower (a number from 1e-06 to 1e+06; 1/s)\n"
    film += "    first: number of the first picture; those before it are left out (a whole number from 1; default 1)\n"
    assert f"{film}load cells:\n  sim:\n" in told
    assert "    timeout: silence that is reported (a number from 0.05 to 3600; s; default 2.0)\n" in told
    assert (
        "  protocol=hbm-aed:\n    nominal: load of 1 000 000 counts" in told and "protocol=sauter" not in told
    )
    assert "    fps: pictures a second (a number from 1e-06 to 1e+06; 1/s; default 1.0)\n" in told
