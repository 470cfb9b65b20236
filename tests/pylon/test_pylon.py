"""Emulated Basler cameras keep the contract of all cameras; settings, faults, and whole tests."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from inspect import signature
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from acquire.addresses import parse_address
from acquire.camera.contract import Camera, list_cameras, open_camera
from acquire.camera.live import LiveCamera
from acquire.errors import ConfigError, DeviceError
from acquire.events import Event
from acquire.frame import Frame
from acquire.pylon import PylonDriver, open_pylon
from acquire.session.reader import Session
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle
from live.cli import main
from live.results.reader import Strain
from tests.contracts import test_camera_contract as contract

OF_ONE_CAMERA = {
    name: test
    for name, test in vars(contract).items()
    if name.startswith("test_") and list(signature(test).parameters) == ["camera"]
}
globals().update(OF_ONE_CAMERA)
ADDRESS = "pylon:0815-0000?width=160&height=128&fps=20"
STRAIN = 2e-3


@pytest.fixture(params=["Mono8", "Mono12"])
def camera(request: pytest.FixtureRequest) -> Iterator[Camera]:
    opened = open_camera(f"{ADDRESS}&format={request.param}")
    yield opened
    opened.close()


def pulled(folder: Path, strains: list[float]) -> list[NDArray[np.uint8]]:
    """Pictures of a pattern pulled along y, as files that the emulation shows one after the other."""
    speckle, shape = Speckle((400, 400), radius=2.0, seed=3), (128, 160)
    images = []
    folder.mkdir()
    for k, strain in enumerate(strains):
        levels = 30 + 180 * speckle.render(Affine(dv_dy=strain, x0=80, y0=64), shape)
        images.append(np.rint(levels).astype(np.uint8))
        cv2.imwrite(str(folder / f"{k:04d}.png"), images[-1])
    return images


def shown(folder: Path) -> str:
    return f"{ADDRESS}&format=Mono8&TestImageSelector=Off&ImageFileMode=On&ImageFilename={folder}"


def test_the_whole_contract_is_here() -> None:
    assert len(OF_ONE_CAMERA) >= 9


def test_all_are_listed_and_one_must_be_meant() -> None:
    listed = [one.address for one in list_cameras() if one.address.startswith("pylon:")]
    assert listed == ["pylon:0815-0000", "pylon:0815-0001"]
    with pytest.raises(ConfigError, match=r"2 cameras are meant.*pylon:0815-0001"):
        open_camera("pylon:")
    with pytest.raises(DeviceError, match=r"no such camera answers.*pylon:0815-0000"):
        open_camera("pylon:123")


def test_settings_are_in_force() -> None:
    address = f"{ADDRESS}&format=Mono12&exposure_us=5000&gain=3&x=8&y=4&white=4000"
    with contextlib.closing(open_camera(address)) as camera:
        info = camera.info
    assert (info.width, info.height, info.bits, info.fps) == (160, 128, 12, 20)
    assert (info.exposure_s, info.saturation, info.pixel_format) == (5e-3, 4000, "Mono12")
    assert {key: float(info.controls[key]) for key in ("x", "y", "gain")} == {"x": 8, "y": 4, "gain": 3}
    exposure, gain = info.settings
    assert (exposure.key, exposure.value, exposure.high) == ("exposure_us", 5000, 50_000)
    assert (gain.key, gain.value, gain.low, gain.high) == (
        "gain",
        *(pytest.approx(n, abs=1e-4) for n in (3, 0, 48)),
    )


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ("width=99999", "width=99999 is not possible; allowed: 1 to 4096"),
        ("format=Mono9", "allowed: Mono8, Mono10"),
        ("format=RGB8Packed", "format=RGB8Packed is not possible; allowed: Mono12, Mono10"),
        ("gain=99", "allowed: 0 to 48"),
        ("Fancy=1", "no feature Fancy; known settings: format"),
        ("buffers=1", "from 2 to 1000"),
    ],
)
def test_what_is_not_possible_is_refused_with_what_is(settings: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        open_camera(f"pylon:0815-0000?{settings}")
    assert words in str(caught.value)
    open_camera(ADDRESS).close()  # nothing was left open


def test_frames_are_the_pictures_bit_for_bit(tmp_path: Path) -> None:
    images = pulled(tmp_path / "shown", [0.0, 0.01, 0.02])
    with open_camera(shown(tmp_path / "shown")) as camera:
        stream = iter(camera)
        for frame in (next(stream) for _ in range(6)):
            assert np.array_equal(frame.image, images[frame.index % 3])


def test_a_frame_that_is_not_whole_is_lost() -> None:
    events: list[Event] = []
    address = f"{ADDRESS}&format=Mono8&ForceFailedBufferCount=2"
    with contextlib.closing(open_pylon(parse_address(address), events.append)) as camera:
        frames = first(camera, 10, {3: lambda: basler(camera).ForceFailedBuffer.Execute()})
    assert sum(frame.lost_before for frame in frames) == 2
    assert any("without a whole picture" in event.text for event in events)


def basler(camera: LiveCamera) -> Any:
    """The maker's own object."""
    assert isinstance(camera._driver, PylonDriver)
    return camera._driver._camera


def first(camera: Camera, count: int, at: dict[int, object]) -> list[Frame]:
    """The first frames, with something done after one of them."""
    frames: list[Frame] = []
    for frame in camera:
        frames.append(frame)
        if (action := at.get(len(frames))) is not None:
            action()
        if len(frames) == count:
            break
    return frames


def test_a_stream_that_ends_is_begun_again() -> None:
    events: list[Event] = []
    with contextlib.closing(open_pylon(parse_address(f"{ADDRESS}&format=Mono8"), events.append)) as camera:
        frames = first(camera, 8, {3: lambda: basler(camera).StopGrabbing()})
    texts = [event.text for event in events]
    assert "no longer answers" in texts[0] and "opened again" in texts[-1]
    away, lost = max((frame.t - before.t, frame.lost_before) for before, frame in pairwise(frames))
    assert lost == pytest.approx(away * 20 - 1, abs=1)  # a fast machine has it back within a frame


def test_the_end_does_not_wait_for_a_camera_that_is_away(monkeypatch: pytest.MonkeyPatch) -> None:
    def away(driver: PylonDriver) -> None:
        raise DeviceError("there is none")

    def stopped_when_looking(event: Event) -> None:
        if "looking for it again" in event.text:
            monkeypatch.setattr(PylonDriver, "_open", away)
            camera.stop()

    camera = open_pylon(parse_address(f"{ADDRESS}&format=Mono8"), stopped_when_looking)
    with camera:
        assert len(first(camera, 50, {3: lambda: basler(camera).StopGrabbing()})) < 50


def test_from_the_devices_to_the_replay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pulled(tmp_path / "shown", [0.0] * 40 + [STRAIN] * 200)
    monkeypatch.chdir(tmp_path)
    assert main(["devices"]) == 0
    assert "pylon:0815-0000" in capsys.readouterr().out
    camera = shown(tmp_path / "shown")
    assert main(["init", "rig.toml", "--camera", camera, "--load", "none:", "--zoi", "32"]) == 0
    assert main(["check", "--config", "rig.toml"]) in (0, 6)
    assert "saturated pixels" in capsys.readouterr().out
    measured = [
        "--step",
        "16",
        "--burst",
        "2",
        "--reference-burst",
        "4",
        "--roi",
        "all",
        "--no-view",
        "--no-rrd",
    ]
    code = main(["run", "--config", "rig.toml", *measured, "--seconds", "4", "--out", "run", "--report"])
    with Session.open(Path("run/session.h5")) as session:
        counts = session.frame_counts
    assert counts is not None and code == (5 if counts["lost"] else 0)
    assert "0815-0000" in Path("run/report.html").read_text(encoding="utf-8")
    assert main(["replay", "run/session.h5", "--as-measured", "--out", "again", "--no-view", "--no-rrd"]) == 0
    with Strain.open(Path("run/strain.h5")) as live, Strain.open(Path("again/strain.h5")) as again:
        assert np.array_equal(live.maps("eyy"), again.maps("eyy"), equal_nan=True)
        assert np.nanmean(live.maps("eyy")[-1]) == pytest.approx(STRAIN, abs=1e-4)
