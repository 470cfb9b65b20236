"""The check before a test: verdict and advice, and predicted against measured strain noise on simulated frames."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from acquire.events import ignore_event
from live.cli import main
from live.config.loading import Config, load_config
from live.setup.check.check_list import CheckFigures, examine, table_lines
from live.setup.check.noise_floor import BURSTS
from live.setup.check.sample import FrameStack, take
from live.setup.check.verdict import check_lines
from live.setup.specimen_drawing import GOOD, POOR

STILL = "sim:uniform?bits=8&fps=50&seconds=20&width=224&height=192&lockstep=yes"


def checked(capsys: pytest.CaptureFixture[str], more: str, *arguments: str) -> tuple[int, str]:
    small = ["--zoi", "48", "--step", "16", "--reference-burst", "16"]
    code = main(["check", "--camera", STILL + more, *small, *arguments])
    return code, capsys.readouterr().out


@pytest.fixture
def own_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """No table of other sizes of ZOIs, which takes most of a check."""
    monkeypatch.setattr("live.setup.check.check_list.SIZES", ())


def test_a_good_picture_is_ready(capsys: pytest.CaptureFixture[str]) -> None:
    code, output = checked(capsys, "")
    assert code == 0, output
    assert "LOOK" not in output
    assert output.rstrip().endswith("GO: ready")
    assert "\n*  48     1       105      33" in output


@pytest.mark.parametrize(
    ("more", "arguments", "message"),
    [
        ("&radius=12", (), "LOOK  speckle radius"),
        ("&radius=1.09", (), "LOOK  speckle radius"),
        ("&contrast=3", (), "LOOK  contrast"),
        ("&brightness=1.6", (), "LOOK  saturated"),
        ("&brightness=0.25", (), "LOOK  light"),
        ("&noise=0", (), "LOOK  noise"),
        ("", ("--target", "5"), "more than the 5.0 µm/m asked for: "),
        ("&hold=0.01&end=0.1&drift_x=40", (), "LOOK  drift"),
        ("&hold=0.01&end=0.1&max_strain=1e-8&stand_off_mm=100&settle_mm=5", (), "LOOK  distance"),
        ("&hold=0.01&end=0.1&max_strain=1e-8&stand_off_mm=100&settle_x_deg=4", (), "LOOK  tilt"),
    ],
)
def test_a_bad_picture_is_not(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    more: str,
    arguments: tuple[str, ...],
    message: str,
) -> None:
    monkeypatch.setattr("live.setup.pictures.at_rest", lambda address: address)
    if not arguments:  # the table of other sizes and bursts tells nothing of the picture
        monkeypatch.setattr("live.setup.check.check_list.SIZES", ())
    code, output = checked(capsys, more, *arguments)
    assert code == 6, output
    assert message in output


def test_too_short(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("live.setup.pictures.at_rest", lambda address: address)
    assert main(["check"]) == 2
    assert main(["check", "--camera", "sim:uniform?fps=50&seconds=0.1&width=224&height=192"]) == 4
    assert "whole frames, a check needs 8" in capsys.readouterr().err


@pytest.mark.usefixtures("own_size")
@pytest.mark.parametrize("count", [1, 5])
def test_a_few_pictures_are_judged_by_what_they_show(
    count: int, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Light, bits, pattern and the predicted noise are those of many frames; what changes in time is not measured."""
    config = load_config(None, {"camera.address": STILL, "measure.zoi": 48, "measure.reference_burst": 16})
    many = take(config)
    whole = examine(many, config)
    for k in range(count):
        cv2.imwrite(str(tmp_path / f"{k}.png"), many.frames[k])
    arguments = ["--camera", f"files:{tmp_path}", "--zoi", "48", "--reference-burst", "16"]
    assert main(["check", *arguments, "--noise", f"{whole.noise:.3f}"]) == 0
    output = capsys.readouterr().out
    assert f"pictures               {count}, too few" in output
    assert "predicted, noise as given" in output
    assert output.rstrip().splitlines()[-1].startswith(f"GO, as far as {count} picture")
    assert "reference of 16" in output
    assert main(["check", *arguments[:4]]) in (0, 6)
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
    # Without a given noise it comes from the spectrum of the picture.
    spectral = examine(take(load_config(None, config_values(tmp_path))), config)
    assert spectral.noise == pytest.approx(whole.noise, rel=0.2)


def test_a_black_picture(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """No figure is invented for a black picture."""
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((200, 300), np.uint8))
    assert main(["check", "--camera", f"files:{tmp_path}", "--zoi", "32"]) == 6
    output = capsys.readouterr().out
    assert "nan" not in output
    for what in (
        "speckle radius         none is visible",
        "sharpness              no pattern",
        "SSSIG of a ZOI         none",
    ):
        assert f"LOOK  {what}" in output


def config_values(folder: Path) -> dict[str, object]:
    return {"camera.address": f"files:{folder}", "measure.zoi": 48, "measure.reference_burst": 16}


@pytest.mark.usefixtures("own_size")
def test_the_load_cell_is_listened_to(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("live.commands.check.LISTEN_S", 0.5)
    _, output = checked(capsys, "", "--load", "sim:?rate=50")
    assert "load cell" in output
    assert "1/s, noise" in output


@pytest.mark.usefixtures("own_size")
def test_the_snapshot_and_the_gauges(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """ZOIs with a low noise are green, others red; the noise of the gauges is printed."""
    shot = tmp_path / "shot.png"
    code, output = checked(capsys, "", "--gauges", "auto", "--snapshot", str(shot), "--scale", "0.05")
    assert code == 0, output
    assert "l_10% mm" in output
    noise = {
        name: float(re.search(rf"noise of {name} +([0-9.]+) µm/m", output)[1])  # type: ignore[index]
        for name in ("the region", "extension", "width", "area")
    }
    one = float(re.search(r"strain noise +(\d+) µm/m measured", output)[1])  # type: ignore[index]
    assert noise["the region"] < one
    assert noise["area"] < one
    drawn = cv2.imread(str(shot))
    assert (drawn == np.array(GOOD)).all(axis=2).sum() > 500
    assert not (drawn == np.array(POOR)).all(axis=2).any()
    code, output = checked(capsys, "", "--target", "1", "--snapshot", str(tmp_path / "red.png"))
    assert code == 6
    assert (cv2.imread(str(tmp_path / "red.png")) == np.array(POOR)).all(axis=2).sum() > 500
    assert main(["check", "--camera", STILL, "--snapshot", str(shot)]) == 2
    assert "is not overwritten" in capsys.readouterr().err


@pytest.mark.usefixtures("own_size")
def test_both_cameras_are_checked(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """NO-GO where one of them is not ready, with the picture of each."""
    drawn = str(tmp_path / "seen.png")
    dark = STILL.replace("?", "?contrast=2&")
    code, output = checked(capsys, "", "--back", dark, "--snapshot", drawn)
    assert code == 6 and "NO-GO" in output
    front, back = output.split(f"back: {dark}")
    assert f"front: {STILL}" in front and "LOOK" not in front and "LOOK" in back
    assert {path.name for path in tmp_path.glob("*.png")} == {"seen-front.png", "seen-back.png"}
    assert checked(capsys, "", "--back", STILL)[0] == 0


def test_a_gauge_beside_the_specimen_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text("[gauges.far]\nkind = 'zoi'\nat = [900, 20]\n")
    assert checked(capsys, "", "--config", str(rig))[0] == 2


STILL_FLOOR = "sim:uniform?fps=50&seconds=20&hold=10&width=320&height=256&lockstep=yes"


def figures(settings: str, zoi: int = 32, table: bool = False) -> CheckFigures:
    config = load_config(
        None, {"camera.address": STILL_FLOOR + settings, "measure.zoi": zoi, "measure.reference_burst": 32}
    )
    return examine(take(config), config, table=table)


TRIALS = [
    # bits, noise %, radius px, contrast %, ZOI
    "8 0.5 2 18 32",
    "8 2 2 18 32",
    "8 4 2 18 48",
    "12 0.2 1.5 18 32",
    "12 1 1.2 18 32",
    "12 1 4 18 48",
    "12 0.5 3 6 48",
    "12 2 2 10 48",
]


@pytest.mark.parametrize("trial", TRIALS)
def test_predicted_and_measured_agree(trial: str) -> None:
    bits, noise, radius, contrast, zoi = trial.split()
    found = figures(f"&bits={bits}&noise={noise}&radius={radius}&contrast={contrast}", int(zoi)).floor
    for one in found.noises:
        assert one.measured == pytest.approx(one.predicted, rel=0.2), (trial, one)


@pytest.mark.slow
def test_the_table_has_every_zoi_order_and_burst() -> None:
    found = figures("&bits=12&noise=1", 64, table=True)
    rows = {(f.zoi, f.order): f for f in found.floors}
    assert set(rows) == {(zoi, order) for zoi in (32, 48, 64, 96) for order in (1, 2)}
    for floor in found.floors:
        assert [n.burst for n in floor.noises] == list(BURSTS), floor
        known = [n.known for n in floor.noises]
        assert known == sorted(known, reverse=True)
    for noise in rows[32, 2].noises:
        assert noise.measured == pytest.approx(noise.predicted, rel=0.2)
    # A quadratic term is even: it does not widen the band of a strain.
    assert rows[64, 2].l10 == rows[64, 1].l10 == pytest.approx(140, rel=0.01)
    lines = table_lines(replace(found, px_per_mm=20.0))
    assert "l_10% mm" in lines[1]
    assert any(line.startswith("*  64     1      7.01    2.19") for line in lines), lines


def shots_of(frames: np.ndarray, bits: int, fps: float = 30.0) -> FrameStack:
    from live.setup.devices import open_rig

    rig = open_rig(STILL_FLOOR, "none:", ignore_event)
    rig.close()
    height, width = frames.shape[1:]
    camera = replace(rig.camera.info, width=width, height=height, bits=bits, fps=fps)
    return FrameStack(frames, np.arange(len(frames)) / fps, 0, camera)


@pytest.fixture(scope="module")
def taken() -> FrameStack:
    return take(load_config(None, {"camera.address": STILL_FLOOR + "&bits=8&noise=1"}))


def line_text(stack: FrameStack, what: str) -> str:
    config = Config()
    lines = check_lines(examine(stack, replace(config, measure=replace(config.measure, zoi=48)), table=False))
    return next(line.text() for line in lines if line.what == what)


def test_motion_is_that_of_what_has_a_pattern(taken: FrameStack) -> None:
    """Of a specimen at one side of a region that is all of the picture."""
    height, width = taken.frames.shape[1:]
    frames = np.full((16, height, width + 1200), 100, np.uint8)
    frames[:, :, :width] = taken.frames[:16]
    config = load_config(None, {"measure.zoi": 48, "measure.roi": "all"})
    still = examine(shots_of(frames, 8), config, table=False).still
    assert still.drift_px < 0.01
    assert still.worse.vibration < 0.01


def test_what_surrounds_the_specimen_decides_nothing(taken: FrameStack) -> None:
    """A saturated, flickering background beside a good specimen."""
    height, width = taken.frames.shape[1:]
    frames = np.full((len(taken), height + 100, width + 400), 255, np.uint8)
    frames[::2, :, :] = 200
    frames[:, 50 : 50 + height, 200 : 200 + width] = taken.frames
    config = load_config(None, {"measure.zoi": 48})
    found = examine(shots_of(frames, 8), config, table=False)
    assert found.region.found
    bad = [line.text() for line in check_lines(found) if not line.good]
    assert bad == []
    assert found.noise == pytest.approx(examine(taken, config, table=False).noise, rel=0.05)


def test_a_pattern_that_repeats_is_named_with_its_period() -> None:
    rng = np.random.default_rng(0)
    k = 2 * np.pi / 9
    y, x = np.mgrid[:240, :320]
    grid = 120 + 40 * (np.sin(k * x) + np.sin(k * y))
    frames = np.rint(grid + rng.normal(0, 1, (16, *grid.shape))).astype(np.uint8)
    text = line_text(shots_of(frames, 8), "repetition")
    assert text.startswith("LOOK") and "repeats every 9.0 px" in text and "move by 4.3 px" in text


@pytest.mark.slow
def test_the_blocks_of_a_codec_are_named_and_leave_the_pattern(taken: FrameStack) -> None:
    coded = [cv2.imencode(".jpg", one, [cv2.IMWRITE_JPEG_QUALITY, 80])[1] for one in taken.frames]
    shots = shots_of(np.stack([cv2.imdecode(one, cv2.IMREAD_GRAYSCALE) for one in coded]), 8)
    assert "blocks of 8 px" in line_text(shots, "compression")
    assert line_text(shots, "ZOIs without pattern").split()[-3] == "0.0%"
    with pytest.raises(StopIteration):
        line_text(taken, "compression")


def test_the_noise_of_each_zoi_is_that_of_a_burst_of_the_test() -> None:
    """Half of the frames against the other half is scaled to reference and burst of the test, as in the table."""
    found = figures("&bits=12&noise=1", zoi=48)
    one = found.floor.of(found.burst)
    assert np.nanmedian(found.zois.sigma) == pytest.approx(one.predicted, rel=0.1)


def lit(frames: np.ndarray, t: np.ndarray) -> np.ndarray:
    """By lamps on mains of 50 Hz."""
    bright = 1 + 0.05 * np.sin(2 * np.pi * 100 * t)
    return np.clip(np.rint(frames * bright[:, None, None]), 0, 255).astype(np.uint8)


def shaken(frames: np.ndarray, t: np.ndarray) -> np.ndarray:
    """At 7 Hz."""
    moved = np.rint(np.sin(2 * np.pi * 7.0 * t)).astype(int)
    return np.stack([np.roll(f, k, axis=0)[8:-8] for f, k in zip(frames, moved, strict=True)])


@pytest.mark.parametrize(
    ("changed", "what", "words"),
    [
        (lit, "flicker", "lamps on 50 Hz mains (100 Hz, seen at 10.0 Hz)"),
        (shaken, "vibration", "mainly at 7.0 Hz"),
    ],
)
def test_what_changes_in_time_is_named_with_its_frequency(
    taken: FrameStack, changed: Callable[..., np.ndarray], what: str, words: str
) -> None:
    text = line_text(shots_of(changed(taken.frames, np.arange(len(taken)) / 30), 8), what)
    assert text.startswith("LOOK") and words in text
