"""Several cameras in one test: the mean by value, a camera that fails, commands, and the same again in a replay."""

from __future__ import annotations

import contextlib
import csv
import json
import shutil
import socket
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError
from acquire.session import Session
from hw_mocks.specimen import specimen_from
from live.cli import main
from live.config.sections import CameraConfig, LoadConfig
from live.pipeline.run_state import FrameCounts
from live.results.reader import Strain
from live.results.run_folder import open_run
from live.results.sides import SidesOfTest
from live.setup.devices import open_rigs
from tests.live.test_end_to_end import assert_bit_equal, replay

BENDING = 0.04
VIEW = (
    "width=320&height=240&seconds=6&fps=10&max_strain=0.001&hold=1&noise=0.2&lockstep=yes&stand_off_mm=500"
    "&settle_mm=0.1&settle_x_deg=0.1&settle_y_deg=0.1&bending=4"
)
FRONT, BACK = f"sim:?{VIEW}", f"sim:?{VIEW}&seed=7&side=back"
MOTION = 200e-6  # strain that 0.1 mm at 500 mm shows
MEASURE = ["--roi", "all", "--zoi", "32", "--step", "16", "--burst", "2", "--reference-burst", "4",
           "--axis", "y"]  # fmt: skip
QUIET = ["--no-view", "--no-rrd"]


def run(folder: Path, *more: str, front: str = FRONT, back: str = BACK) -> int:
    rig = folder.with_suffix(".toml")
    rig.write_text("[gauges.middle]\nkind = 'area'\nbox = [60, 60, 200, 120]\n[specimen]\narea_mm2 = 40\n"
                   "standard = 'free'\nmodulus_between = [1e-4, 7e-4]\n")  # fmt: skip
    devices = ["--camera", front, "--back", back, "--load", "sim:"]
    return main(["run", "--config", str(rig), *devices, *MEASURE, *QUIET, "--out", str(folder), *more])


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sides") / "test"
    assert run(folder) == 0
    return folder


def table(folder: Path) -> dict[str, np.ndarray]:
    with (folder / "strain.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name] or "nan") for row in rows]) for name in rows[0]}


def test_the_mean_has_neither_motion_nor_bending(good: Path) -> None:
    specimen, found = specimen_from(parse_address(FRONT)), table(good)
    true = specimen.axial_strain(found["time_s"])
    share = true / true[-1]
    assert len(true) == 28
    for name in ("axial", "middle"):
        sigma = found[f"sigma_{name}"]
        assert np.median(sigma) < 5e-6
        assert np.mean(np.abs(found[f"mean_{name}"] - true) < 2 * sigma) > 0.85
        assert abs(found[f"mean_{name}"][-1] - true[-1]) < 5e-6
        bent = BENDING * true + MOTION * share
        np.testing.assert_allclose(found[f"bending_{name}"], bent, atol=1.5e-5)
    with open_run(good / "front") as front, open_run(good / "back") as back:
        sides = SidesOfTest.of_folders(front, back)
    assert sides.figures["both"].E.value == pytest.approx(specimen.E, rel=0.01)
    assert sides.figures["both"].E.low < specimen.E < sides.figures["both"].E.high
    assert sides.figures["front"].E.value < 0.85 * specimen.E
    assert sides.figures["back"].E.value > 1.2 * specimen.E
    assert not any("limits" in line for line in sides.figure_lines(stresses=True))
    both = replace(sides.figures["both"], budget={"scatter": 1e-3, "load cell": 3e-3})
    stated = replace(sides, figures={"both": both})
    assert list(stated.figure_lines(stresses=True))[-1] == "±: 95% interval, of E with limits of load cell"


def test_one_clock_and_one_load_cell(good: Path) -> None:
    with (
        Session.open(good / "front" / "session.h5") as front,
        Session.open(good / "back" / "session.h5") as back,
    ):
        assert front.start_monotonic == back.start_monotonic
        assert front.start_utc == back.start_utc
        one, other = list(front.load_samples()), list(back.load_samples())
    assert one == other
    assert len(one) == 481


def test_a_replay_of_both_is_bit_equal(good: Path, tmp_path: Path) -> None:
    out, moved = tmp_path / "again", tmp_path / "moved"
    shutil.copytree(good, moved)
    assert replay(moved, out, "--as-measured") == 0
    assert (out / "strain.csv").read_bytes() == (good / "strain.csv").read_bytes()
    for side in ("front", "back"):
        assert_bit_equal(good / side, out / side)


def test_the_report_has_both_sides(good: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "test"
    shutil.copytree(good, folder)
    assert main(["report", str(folder)]) == 0
    text = (folder / "report.html").read_text()
    for words in ("Front minus mean", "Budget of E of the mean", "front/report.html", "back/report.html"):
        assert words in text
    assert (folder / "back" / "report.html").exists()
    assert main(["sides", str(folder)]) == 0
    assert (folder / "sides.csv").read_bytes() == (good / "strain.csv").read_bytes()
    capsys.readouterr()
    assert main(["show", str(folder)]) == 4
    assert f"give the folder of one, {folder / 'front'}" in capsys.readouterr().err


@pytest.mark.parametrize("side", ["front", "back"])
def test_a_camera_that_fails_leaves_the_other_measuring(
    side: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cameras = {"front": FRONT, "back": BACK}
    cameras[side] += "&faults=gone@3"
    assert run(tmp_path / "test", **cameras) == 5
    assert "exit code 5" in capsys.readouterr().out
    rows = {}
    for name in cameras:
        with Strain.open(tmp_path / "test" / name / "strain.h5") as strain:
            rows[name] = strain.n
    other = "back" if side == "front" else "front"
    assert rows == {side: 13, other: 28}
    found = table(tmp_path / "test")
    assert np.isfinite(found["mean_axial"]).sum() == 13
    assert len(found["mean_axial"]) == (13 if side == "front" else 28)


LIVE = f"sim:?{VIEW}".replace("&lockstep=yes", "")
BEHIND = "&seed=7&side=back"


def listened(folder: Path, *alarm: str, **cameras: str) -> list[dict[str, float | None]]:
    """What a test sends by UDP; ``alarm``: lines of one in its rig file."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.setblocking(False)
        rig = folder.with_suffix(".toml")
        rig.write_text("\n".join([f"[strain_out]\nudp = '127.0.0.1:{listener.getsockname()[1]}'", *alarm]))
        devices = ["--camera", cameras["front"], "--back", cameras["back"], "--load", "sim:"]
        main(["run", "--config", str(rig), *devices, *MEASURE, *QUIET, "--out", str(folder)])
        lines = []
        with contextlib.suppress(BlockingIOError):
            while True:
                lines.append(listener.recv(65536).decode().strip())
    return [{"line": 1.0} if text == "HALT" else json.loads(text) for text in lines]


@pytest.mark.slow
def test_the_mean_goes_out_with_its_sigma(tmp_path: Path) -> None:
    lines = listened(tmp_path / "test", front=LIVE, back=LIVE + BEHIND)
    found, sent = table(tmp_path / "test"), [one for one in lines if one["mean_axial"] is not None]
    assert len(sent) > len(lines) / 2 > 5
    for one in sent:
        k = int(np.argmin(np.abs(found["time_s"] - float(one["mean_time_s"] or 0))))
        for channel, column in (
            ("mean_axial",) * 2,
            ("bending_axial",) * 2,
            ("sigma_mean_axial", "sigma_axial"),
        ):
            assert one[channel] == pytest.approx(found[column][k], rel=1e-6, abs=1e-12)


ALARM = "[[alarm]]\nchannel = 'mean_axial'\nabove = 0.02\nend = true\nend_on_unknown = true\nline = 'HALT'"


@pytest.mark.slow
@pytest.mark.parametrize("side", ["front", "back"])
def test_a_camera_that_fails_sends_no_mean_and_ends_what_an_alarm_on_it_guards(
    side: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cameras = {"front": LIVE, "back": LIVE + BEHIND}
    cameras[side] += "&faults=gone@2"
    lines = listened(tmp_path / "test", ALARM, **cameras)
    assert {"line": 1.0} in lines
    assert f"mean axial is not known, the camera of the {side} has failed" in capsys.readouterr().out
    after = lines[lines.index({"line": 1.0}) :]
    # What was measured before the fault, at frame 20, may be on its way.
    assert not [one for one in after if one.get("mean_axial") is not None and (one["frame"] or 0) >= 20]
    with Session.open(tmp_path / "test" / ("back" if side == "front" else "front")) as other:
        ended = f"the test ends: ALARM mean axial is not known, the camera of the {side} has failed"
        assert other.events()[-1].text == ended


def test_a_camera_that_is_not_there_refuses_the_test(tmp_path: Path) -> None:
    assert run(tmp_path / "test", back="/dev/video77") == 3
    assert not (tmp_path / "test").exists()


FIELDS = ["--camera", FRONT, "--beside", FRONT.replace("?", "?seed=11&"), "--load", "sim:"]


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("three") / "test"
    rig = folder.with_suffix(".toml")
    rig.write_text("[specimen]\narea_mm2 = 40\nstandard = 'free'\nmodulus_between = [1e-4, 7e-4]\n"
                   "[[alarm]]\nchannel = 'axial'\nabove = 0.5\n")  # fmt: skip
    cameras = ["--config", str(rig), *FIELDS, "--beside", FRONT.replace("?", "?seed=13&")]
    assert main(["run", *cameras, *MEASURE, *QUIET, "--report", "--out", str(folder)]) == 0
    return folder


def test_three_cameras_have_one_clock_one_load_and_one_report(
    three: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """And neither a mean nor bending; each has the motion that it sees."""
    specimen = specimen_from(parse_address(FRONT))
    with contextlib.ExitStack() as opened:
        runs = [opened.enter_context(open_run(three / name)) for name in ("first", "second", "third")]
        assert len({run.start_monotonic for run in runs}) == 1
        assert runs[0].load_samples == runs[1].load_samples == runs[2].load_samples
        ends = [run.strain.values["eyy"][-1] for run in runs]
        bent = specimen.axial_strain(np.asarray(runs[0].strain.time_s))[-1] * (1 + BENDING)
        assert ends == pytest.approx([bent + MOTION] * 3, abs=2e-5) and len(set(ends)) == 3
    text = (three / "report.html").read_text()
    for words in ("3 fields of view", "Budget of E, third", 'href="third/report.html"'):
        assert words in text
    assert "Front minus mean" not in text and not (three / "strain.csv").exists()
    assert main(["show", str(three)]) == 4
    assert f"give the folder of one, {three / 'first'}" in capsys.readouterr().err


def test_a_replay_of_three_cameras_is_bit_equal(three: Path, tmp_path: Path) -> None:
    assert replay(three, tmp_path / "again", "--as-measured") == 0
    for name in ("first", "second", "third"):
        assert_bit_equal(three / name, tmp_path / "again" / name)


LIVE_FIELD = "sim:?width=224&height=192&seconds=4&fps=10&max_strain=0.001&hold=1&noise=0.2"


def test_live_cameras_all_give_frames_and_one_that_fails_leaves_the_others(tmp_path: Path) -> None:
    """Not in lock step: each camera runs by the clock."""
    folder = tmp_path / "test"
    cameras = ["--camera", f"{LIVE_FIELD}&faults=gone@2", *("--beside", f"{LIVE_FIELD}&seed=5") * 2]
    assert main(["run", *cameras, "--load", "sim:", *MEASURE, *QUIET, "--out", str(folder)]) == 5
    measured = {}
    for name in ("first", "second", "third"):
        with Session.open(folder / name / "session.h5") as session:
            counts = FrameCounts(**{key: session.frame_counts[key] for key in FrameCounts().as_dict()})
            assert counts.adds_up and counts.grabbed == counts.recorded > 10
            measured[name] = counts.grabbed
    assert measured["first"] < 25 < 35 < min(measured["second"], measured["third"])


def test_two_fields_have_no_mean(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text("[[alarm]]\nchannel = 'mean_axial'\nabove = 0.02\n")
    assert (
        main(["run", "--config", str(rig), *FIELDS, *MEASURE, *QUIET, "--out", str(tmp_path / "test")]) == 2
    )
    assert "can never come: it needs a camera on each side" in capsys.readouterr().err
    both = [*FIELDS, "--back", BACK]
    assert main(["run", *both, *MEASURE, *QUIET, "--out", str(tmp_path / "test")]) == 2
    assert "give --back or --beside, not both" in capsys.readouterr().err


def test_simulated_cameras_see_one_specimen() -> None:
    cameras = CameraConfig(address=FRONT), CameraConfig(address=BACK.replace("0.001", "0.002"))
    with pytest.raises(ConfigError, match="give max_strain as in its address"):
        open_rigs(cameras, LoadConfig(address="sim:"), [lambda event: None] * 2)
