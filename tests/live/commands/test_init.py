"""``phasedic init``: a rig file that run accepts as it is, from simulated, recorded and found devices."""

from __future__ import annotations

import tomllib
from pathlib import Path
from types import SimpleNamespace

import cv2
import h5py
import numpy as np
import pytest

from acquire.camera import CameraListing
from hw_mocks.scene import Scene
from hw_mocks.specimen import VirtualSpecimen
from live.cli import main
from live.config.loading import load_config

SIM = "sim:hole?seconds=3&fps=20&width=320&height=320&hole=30&lockstep=yes"


def made(tmp_path: Path, *arguments: str) -> Path:
    path = tmp_path / "rig.toml"
    assert main(["init", str(path), *arguments]) == 0
    return path


def gauges_of_run(rig: Path, out: Path, *arguments: str) -> dict[str, np.ndarray]:
    quick = ["--out", str(out), "--no-view", "--no-rrd", "--reference-burst", "4", *arguments]
    assert main(["run", "--config", str(rig), *quick]) == 0
    with h5py.File(out / "strain.h5") as file:
        return {name: dataset[()] for name, dataset in file["entry/gauges"].items()}


def test_a_simulated_rig(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = made(tmp_path, "--camera", SIM, "--section", "10,2", "--zoi", "32", "--burst", "2")
    output = capsys.readouterr().out
    assert "load cell: sim:" in output
    assert "the specimen was found" in output
    config = load_config(rig, {})
    assert (config.measure.roi, config.measure.gauges, config.measure.zoi) == ("auto", "auto", 32)
    assert config.specimen.area_m2 == pytest.approx(20e-6)
    assert "# [gauges.width]" in rig.read_text()
    shown = cv2.imread(str(tmp_path / "rig.png"))
    assert shown is not None
    found = gauges_of_run(rig, tmp_path / "run")
    for name in ("extension", "width", "area"):
        assert np.isfinite(found[name]).all()
    assert found["extension"][-1] > 1e-3 > found["width"][-1]


def test_what_is_commented_out_is_right(tmp_path: Path) -> None:
    """Taking the # away pins region and gauges where they are."""
    rig = made(tmp_path, "--camera", SIM)
    text = rig.read_text().replace('roi = "auto"', "# before:").replace('gauges = "auto"', "# before:")
    for key in ("roi", "kind", "start", "end", "box", "["):
        text = text.replace(f"\n# {key}", f"\n{key}")
    rig.write_text(text)
    config = load_config(rig, {})
    assert isinstance(config.measure.roi, tuple)
    assert list(config.gauges) == ["extension", "width", "area"]


def test_fixed(tmp_path: Path) -> None:
    rig = made(tmp_path, "--camera", SIM, "--fixed", "--scale", "0.05")
    config = load_config(rig, {})
    assert config.measure.mask == str(tmp_path / "rig-mask.png")
    assert list(config.gauges) == ["extension", "width", "area"]
    assert config.scale.mm_per_px == 0.05
    assert not cv2.imread(config.measure.mask, cv2.IMREAD_GRAYSCALE)[160, 160]


def test_what_is_given_is_kept(tmp_path: Path) -> None:
    given = ["--roi", "2,4,10,8mm", "--scale", "0.05", "--gauges", "given", "--axis", "x", "--step", "7"]
    rig = made(tmp_path, "--camera", SIM, *given)
    config = load_config(rig, {})
    assert config.measure.roi == (40, 80, 200, 160)
    assert (config.measure.gauges, config.measure.step, config.specimen.axis) == ("given", 7, "x")
    assert tomllib.loads(rig.read_text())["measure"]["roi"] == "2,4,10,8mm"


def test_nothing_is_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for taken in ("rig.toml", "rig.png", "rig-mask.png"):
        (tmp_path / taken).write_text("mine")
        assert main(["init", str(tmp_path / "rig.toml"), "--camera", SIM, "--fixed"]) == 2
        assert f"{taken} exists already and is not overwritten" in capsys.readouterr().err
        assert [p.name for p in tmp_path.iterdir()] == [taken]
        (tmp_path / taken).unlink()


def test_names_of_any_kind(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A name may hold what TOML or a shell would read otherwise; a picture that cannot be is told at once."""
    rig = tmp_path / "a 'b\n[measure]\n\"é.toml"
    assert main(["init", str(rig), "--camera", SIM]) == 0
    assert load_config(rig, {}).camera.address == SIM
    capsys.readouterr()
    assert (
        main(["init", str(tmp_path / "c.toml"), "--camera", SIM, "--snapshot", str(tmp_path / "c.abc")]) == 2
    )
    assert "end its name in .png or .tif" in capsys.readouterr().err
    assert not (tmp_path / "c.toml").exists()


@pytest.mark.parametrize("wide", [True, False])
def test_pictures(tmp_path: Path, wide: bool) -> None:
    """A slender specimen lying or standing in the picture; no load cell is looked for."""
    rng = np.random.default_rng(1)
    pattern = cv2.GaussianBlur(rng.normal(size=(80, 500)).astype(np.float32), (0, 0), 1.6)
    picture = np.full((240, 560), 90.0, np.float32)
    picture[80:160, 30:530] = 120 + 250 * pattern
    picture = np.clip(picture + rng.normal(0, 1, picture.shape), 0, 255).astype(np.uint8)
    for k in range(3):
        cv2.imwrite(str(tmp_path / f"shot{k}.png"), picture if wide else picture.T)
    rig = made(tmp_path, "--camera", f"files:{tmp_path}/shot*.png")
    config = load_config(rig, {})
    assert config.specimen.axis == ("x" if wide else "y")
    assert (config.measure.zoi, config.load.address) == (16, "none:")
    found = gauges_of_run(rig, tmp_path / "run", "--reference-burst", "1")
    assert np.abs(found["extension"]).max() < 1e-4


@pytest.mark.parametrize("level", [0, 128, 255])
def test_a_picture_without_a_pattern_gives_no_rig(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], level: int
) -> None:
    """Lens cap on, overexposed, or out of focus: it wrote a rig file, and ended with 0."""
    shot, rig = tmp_path / "shot.png", tmp_path / "rig.toml"
    cv2.imwrite(str(shot), np.full((240, 320), level, np.uint8))
    assert main(["init", str(rig), "--camera", f"files:{shot}"]) == 5
    assert "no pattern is visible" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["shot.png"]


def test_devices_are_looked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first camera without trouble, under the name that plugging does not change; a cell that talks."""
    from live.commands import init

    cameras = [
        CameraListing("/dev/video0", "", trouble="no permission"),
        CameraListing("/dev/video2?format=Y12", "Cam\na", stable_address="/dev/v4l/by-id/usb-Cam"),
        CameraListing("/dev/video4", "Cam b"),
    ]
    finding = SimpleNamespace(address="/dev/ttyUSB0?protocol=ascii", remark="say the unit", protocol="ascii")
    port = SimpleNamespace(device="/dev/ttyUSB0", accessible=True)
    monkeypatch.setattr("acquire.v4l2.listing.list_cameras", lambda: cameras)
    monkeypatch.setattr("acquire.serial_line.ports.list_serial_ports", lambda: [port])
    monkeypatch.setattr("acquire.serial_line.identify.listen", lambda device: [(9600, b"1 N", finding)])
    take_look = init.first_look
    opened = []

    def first_look(config, say):
        opened.append(config.camera.address)
        return take_look(load_config(None, {"camera.address": SIM}), say)

    monkeypatch.setattr(init, "first_look", first_look)
    rig = made(tmp_path)
    assert opened == ["/dev/v4l/by-id/usb-Cam?format=Y12"]
    config = load_config(rig, {})
    assert (config.camera.address, config.load.address) == (opened[0], "/dev/ttyUSB0?protocol=ascii")
    assert '# also found: "/dev/video4"' in rig.read_text()


def test_no_camera_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    denied = CameraListing("/dev/video0", "", trouble="this user may not open it")
    monkeypatch.setattr("acquire.v4l2.listing.list_cameras", lambda: [denied])
    assert main(["init", str(tmp_path / "rig.toml")]) == 3
    assert "/dev/video0: this user may not open it" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_what_looks_like_plates_is_proposed_behind_a_mark(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = np.full((480, 640), 60.0)
    pattern = np.asarray(Scene(VirtualSpecimen(width=640, height=480)).render(0.0), np.float64) * 250
    for x, y, w, h in ((240, 20, 160, 440), (50, 110, 110, 260)):
        picture[y : y + h, x : x + w] = pattern[y : y + h, x : x + w]
    shot = tmp_path / "shot.png"
    cv2.imwrite(str(shot), (picture + np.random.default_rng(1).normal(0, 1, picture.shape)).astype(np.uint8))
    rig = made(tmp_path, "--camera", f"files:{shot}")
    assert "looks like a plate: " in capsys.readouterr().out
    assert not load_config(rig, {}).plate
    before, _, plates = rig.read_text().partition("# [plate.")
    rig.write_text(f"{before}[plate.{plates.replace('# box', 'box')}")
    box = load_config(rig, {}).plate["plate1"].box
    np.testing.assert_allclose(box, (50, 110, 110, 260), atol=14)
