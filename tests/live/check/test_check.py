"""The check before a test: a good picture is ready, a bad one is not, and the reason is told."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from live.check import examine, take
from live.cli import main
from live.setup import load_config
from live.specimen.drawing import GOOD, POOR

STILL = "sim:uniform?bits=8&fps=50&seconds=20&width=224&height=192&lockstep=yes"


def checked(capsys: pytest.CaptureFixture[str], more: str, *arguments: str) -> tuple[int, str]:
    small = ["--zoi", "48", "--step", "16", "--reference-burst", "16"]
    code = main(["check", "--camera", STILL + more, *small, *arguments])
    return code, capsys.readouterr().out


def test_a_good_picture_is_ready(capsys: pytest.CaptureFixture[str]) -> None:
    code, said = checked(capsys, "")
    assert code == 0, said
    assert "LOOK" not in said
    assert said.rstrip().endswith("GO: ready")
    assert "\n*  48     1       105      33" in said


@pytest.mark.parametrize(
    ("more", "arguments", "says"),
    [
        ("&radius=12", (), "LOOK  speckle radius"),
        ("&contrast=3", (), "LOOK  contrast"),
        ("&brightness=1.6", (), "LOOK  saturated"),
        ("&brightness=0.25", (), "LOOK  light"),
        ("&noise=0", (), "LOOK  noise"),
        ("", ("--target", "5"), "more than the 5.0 um/m asked for: "),
        ("&hold=0.01&end=0.1&drift_x=40", (), "LOOK  drift"),
    ],
)
def test_a_bad_picture_is_not(
    capsys: pytest.CaptureFixture[str], more: str, arguments: tuple[str, ...], says: str
) -> None:
    code, said = checked(capsys, more, *arguments)
    assert code == 6, said
    assert says in said


def test_too_short(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check"]) == 2
    assert main(["check", "--camera", "sim:uniform?fps=50&seconds=0.1&width=224&height=192"]) == 4
    assert "whole frames, a check needs 8" in capsys.readouterr().err


def test_a_short_reference_is_checked_with_frames_enough(capsys: pytest.CaptureFixture[str]) -> None:
    code = main(["check", "--camera", STILL, "--zoi", "48", "--reference-burst", "1", "--burst", "1"])
    said = capsys.readouterr().out
    assert code == 0, said
    assert "reference of 1" in said
    assert re.search(r"strain noise +\d+ um/m measured", said)


@pytest.mark.parametrize("count", [1, 5])
def test_a_few_pictures_are_judged_by_what_they_tell(
    count: int, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Light, bits, pattern and the predicted noise are those of many frames; what changes in time is not told."""
    config = load_config(None, {"camera.address": STILL, "measure.zoi": 48, "measure.reference_burst": 16})
    many = take(config)
    whole = examine(many, config)
    for k in range(count):
        cv2.imwrite(str(tmp_path / f"{k}.png"), many.frames[k])
    stated = ["--camera", f"files:{tmp_path}", "--zoi", "48", "--reference-burst", "16"]
    assert main(["check", *stated, "--noise", f"{whole.noise:.3f}"]) == 0
    said = capsys.readouterr().out
    assert f"pictures               {count}, too few" in said
    for what in ("noise in time", "flicker", "drift", "vibration"):
        assert re.search(rf"\? +{what} +not told by {count} picture.*: it takes 8", said), what
    assert "predicted from the noise as stated" in said
    assert said.rstrip().splitlines()[-1].startswith(f"GO, as far as {count} picture")
    assert "reference of 16" in said
    assert main(["check", *stated[:4]]) in (0, 6)
    assert "reference of 1\n" in capsys.readouterr().out
    known = {**config_values(tmp_path), "measure.noise_GL": whole.noise}
    few = examine(take(load_config(None, known)), load_config(None, known))
    assert few.radius == pytest.approx(whole.radius, rel=0.03)
    assert few.sharpness == pytest.approx(whole.sharpness, rel=0.03)
    assert few.exposure.high == pytest.approx(whole.exposure.high, rel=0.02)
    for one, other in zip(few.floors, whole.floors, strict=True):
        assert [n.burst for n in one.noises] == [n.burst for n in other.noises]
        for noise, more in zip(one.noises, other.noises, strict=True):
            assert noise.predicted == pytest.approx(more.predicted, rel=0.1)
            assert np.isnan(noise.measured)
    # Without a stated noise the spectrum of the picture tells it.
    spectral = examine(take(load_config(None, config_values(tmp_path))), config)
    assert spectral.noise == pytest.approx(whole.noise, rel=0.2)


def test_a_black_picture(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """No figure is made up where there is nothing to see."""
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((200, 300), np.uint8))
    assert main(["check", "--camera", f"files:{tmp_path}", "--zoi", "32"]) == 6
    said = capsys.readouterr().out
    assert "nan" not in said
    for what in (
        "speckle radius         none is seen",
        "sharpness              no pattern",
        "SSSIG of a ZOI         none",
    ):
        assert f"LOOK  {what}" in said


def config_values(folder: Path) -> dict[str, object]:
    return {"camera.address": f"files:{folder}", "measure.zoi": 48, "measure.reference_burst": 16}


def test_the_load_cell_is_listened_to(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("live.commands.check.LISTEN_S", 0.5)
    _, said = checked(capsys, "", "--load", "sim:?rate=50")
    assert "load cell" in said
    assert "1/s, noise" in said


def test_the_snapshot_and_the_gauges(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """ZOIs are green where their noise is low enough, red where it is not; that of the gauges is told."""
    shot = tmp_path / "shot.png"
    code, said = checked(capsys, "", "--gauges", "auto", "--snapshot", str(shot), "--scale", "0.05")
    assert code == 0, said
    assert "l_10% mm" in said
    noise = {
        name: float(re.search(rf"noise of {name} +([0-9.]+) um/m", said)[1])  # type: ignore[index]
        for name in ("the mean", "axial", "transverse", "area")
    }
    one = float(re.search(r"strain noise +(\d+) um/m measured", said)[1])  # type: ignore[index]
    assert noise["the mean"] < one
    assert noise["area"] < one
    drawn = cv2.imread(str(shot))
    assert (drawn == np.array(GOOD)).all(axis=2).sum() > 500
    assert not (drawn == np.array(POOR)).all(axis=2).any()
    code, said = checked(capsys, "", "--target", "1", "--snapshot", str(tmp_path / "red.png"))
    assert code == 6
    assert (cv2.imread(str(tmp_path / "red.png")) == np.array(POOR)).all(axis=2).sum() > 500
    assert main(["check", "--camera", STILL, "--snapshot", str(shot)]) == 2
    assert "nothing is overwritten" in capsys.readouterr().err


def test_a_gauge_beside_the_specimen_is_told(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text("[gauges.far]\nkind = 'zoi'\nat = [900, 20]\n")
    assert checked(capsys, "", "--config", str(rig))[0] == 2
