"""Two cameras in one test: the mean by value, a side that fails, commands, and the same again in a replay."""

from __future__ import annotations

import contextlib
import csv
import json
import shutil
import socket
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquire.addresses import parse_address
from acquire.errors import ConfigError
from acquire.events import EventKind
from acquire.session import Session
from hw_mocks.specimen import specimen_from
from live.cli import main
from live.config.loading import load_config
from live.config.sections import CameraConfig, LoadConfig
from live.config.sides import side_configs
from live.pipeline.screen import Screen
from live.results.reader import Strain
from live.results.run_folder import open_run
from live.results.sides.together import SidesOfTest, newest
from live.results.writer import write_results
from live.run.control import ControlRefused
from live.run.live_run import TIME_IS_OVER
from live.run.outcome import StopSignal
from live.run.two_cameras import BothRuns, OutcomeOfSides, Side, linked, run_two_cameras
from live.setup.devices import open_two_rigs

BENDING = 0.04
VIEW = (
    "width=320&height=240&seconds=6&fps=10&max_strain=0.001&hold=1&noise=0.2&lockstep=yes&stand_off_mm=500"
    "&settle_mm=0.1&settle_x_deg=0.1&settle_y_deg=0.1&bending=4"
)
FRONT, BACK = f"sim:?{VIEW}", f"sim:?{VIEW}&seed=7&side=back"
MOTION = 200e-6  # strain that 0.1 mm at 500 mm shows
MEASURE = [
    "--roi",
    "all",
    "--zoi",
    "32",
    "--step",
    "16",
    "--burst",
    "2",
    "--reference-burst",
    "4",
    "--axis",
    "y",
]
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
    assert sides.both.E.value == pytest.approx(specimen.E, rel=0.01)
    assert sides.both.E.low < specimen.E < sides.both.E.high
    assert sides.front.E.value < 0.85 * specimen.E
    assert sides.back.E.value > 1.2 * specimen.E
    assert not any("limits" in line for line in sides.figure_lines(stresses=True))
    stated = replace(sides, both=replace(sides.both, budget={"scatter": 1e-3, "load cell": 3e-3}))
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
    out = tmp_path / "again"
    moved = tmp_path / "moved"
    shutil.copytree(good, moved)
    assert main(["replay", str(moved), "--as-measured", "--out", str(out), *QUIET]) == 0
    assert (out / "strain.csv").read_bytes() == (good / "strain.csv").read_bytes()
    for side in ("front", "back"):
        with Strain.open(good / side / "strain.h5") as live, Strain.open(out / side / "strain.h5") as again:
            for name in set(live.values) - {"latency_s", "kernel_s"}:
                np.testing.assert_array_equal(live.values[name], again.values[name], err_msg=name)
            for name in live.names:
                np.testing.assert_array_equal(live.maps(name), again.maps(name), err_msg=name)


def test_the_report_has_both_sides(good: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "test"
    shutil.copytree(good, folder)
    assert main(["report", str(folder)]) == 0
    text = (folder / "report.html").read_text()
    for words in (
        "Front minus mean",
        "Budget of E of the mean",
        'href="front/report.html"',
        'href="back/report.html"',
    ):
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
    assert not [one for one in after if one.get("mean_axial") is not None]
    with Session.open(tmp_path / "test" / ("back" if side == "front" else "front")) as other:
        ended = f"the test ends: ALARM mean axial is not known, the camera of the {side} has failed"
        assert other.events()[-1].text == ended


def test_a_camera_that_is_not_there_refuses_the_test(tmp_path: Path) -> None:
    assert run(tmp_path / "test", back="/dev/video77") == 3
    assert not (tmp_path / "test").exists()


class Commanding(Screen):
    """Gives commands at the first status lines of the front."""

    def __init__(self) -> None:
        self.both: BothRuns | None = None
        self.shown: list[dict[str, Any]] = []

    @property
    def is_due(self) -> bool:
        return True

    def snapshot(self, snapshot: Any, words: str = "") -> None:
        if self.both is None or not snapshot.time_step:
            return
        runs = self.both.runs
        self.shown.append(newest(runs["front"].run_state, runs["back"].run_state))
        if len(self.shown) == 1:
            self.both.command(EventKind.NOTE, "seen")


def attended(folder: Path) -> tuple[OutcomeOfSides, Commanding]:
    given = {"camera.address": FRONT, "camera.back": BACK, "load.address": "sim:", "output.dir": str(folder)}
    measure = {"zoi": 32, "step": 16, "burst": 2, "reference_burst": 4, "roi": "all"}
    given |= {f"measure.{key}": value for key, value in measure.items()}
    screen = Commanding()
    sides = {
        name: Side(config, screen if name == "front" else Screen(), write_results)
        for name, config in side_configs(load_config(None, given), given).items()
    }
    return run_two_cameras(sides, on_start=lambda both: setattr(screen, "both", both)), screen


def test_mean_and_bending_while_it_runs(tmp_path: Path) -> None:
    outcome, screen = attended(tmp_path / "test")
    assert outcome.exit_code == 0
    for one in outcome.sides.values():
        kinds = [event.kind for event in one.run_state.event_log.events()]
        assert kinds.count(EventKind.NOTE) == 1
    mean, bending, sigma, _ = next(values["axial"] for values in reversed(screen.shown) if values)
    specimen = specimen_from(parse_address(FRONT))
    assert 0 < sigma < 1e-5
    assert 0 <= bending < 0.25 * float(specimen.axial_strain(6.0)) + 5 * sigma
    assert -5 * sigma < mean < float(specimen.axial_strain(6.0)) + 5 * sigma


class FakeRun:
    """Notes its commands; ``refuses`` all but a tare."""

    def __init__(self, refuses: bool = False) -> None:
        self.calls: list[EventKind] = []
        self.grabber, self.refuses, self.paused, self.recording = self, refuses, False, not refuses
        self.running = True

    def command(self, kind: EventKind, note: str = "") -> str:
        if self.refuses and kind is not EventKind.TARE:
            raise ControlRefused("not now")
        self.calls.append(kind)
        return "done"


def test_a_command_is_for_both_and_a_tare_is_one() -> None:
    front, back = FakeRun(), FakeRun()
    runs: Any = {"front": front, "back": back}
    both = BothRuns(runs, Path(), StopSignal())
    assert both.command(EventKind.NOTE, "seen") == "done"
    assert both.command(EventKind.TARE) == "done"
    assert (front.calls, back.calls) == ([EventKind.NOTE, EventKind.TARE], [EventKind.NOTE])
    front.refuses, back.recording = True, False
    assert both.command(EventKind.PAUSE) == "done"
    assert not both.recording
    back.refuses = True
    with pytest.raises(ControlRefused, match="not now"):
        both.command(EventKind.PAUSE)
    front.running = False  # its camera is gone: the back has the load cell
    both.command(EventKind.TARE)
    assert back.calls[-1] is EventKind.TARE


def test_a_side_follows_the_stop_of_both_and_stops_both() -> None:
    both = StopSignal()
    one, other = linked(both), linked(both)
    one.request(TIME_IS_OVER)
    assert not both.requested and not other.requested
    other.request("an alarm")
    assert both.reason == "an alarm"
    late = linked(both)
    assert late.requested
    assert one.reason == TIME_IS_OVER


def test_the_exit_code_of_both() -> None:
    class Ended:
        def __init__(self, code: int) -> None:
            self.exit_code = code

    def code(front: int, back: int) -> int:
        sides: Any = {"front": Ended(front), "back": Ended(back)}
        return OutcomeOfSides(Path(), sides).exit_code

    assert [code(0, 0), code(3, 3), code(0, 3), code(5, 3), code(0, 130), code(1, 3)] == [0, 3, 5, 5, 130, 1]


def test_the_configuration_of_each_side(tmp_path: Path) -> None:
    back = tmp_path / "back.toml"
    back.write_text(
        "[camera]\naddress = '/dev/video1'\ncrop = [1, 2, 300, 200]\n[measure]\nroi = [5, 6, 70, 80]\nzoi = 48\n"
        "[gauges.behind]\nkind = 'area'\nbox = [1, 2, 3, 4]\n[load]\naddress = 'sim:'\n"
    )
    front = {
        "camera.address": "/dev/video0", "camera.crop": [0, 0, 100, 100], "load.address": "/dev/ttyUSB0",
        "measure.mask": "front.png", "measure.zoi": 24, "specimen.area_mm2": 7.0, "operate.orders": "9000",
        "gauges.axial": {"kind": "line", "start": [1, 1], "end": [1, 50]},
    }  # fmt: skip
    given = {"measure.zoi": 32}
    one, other = side_configs(load_config(None, front | {"camera.back": str(back)}), given).values()
    assert (one.camera.back, one.measure.mask, one.operate.orders) == (None, "front.png", "9000")
    assert other.camera == CameraConfig(address="/dev/video1", crop=(1, 2, 300, 200))
    assert (other.measure.roi, other.measure.zoi, list(other.gauges)) == ((5, 6, 70, 80), 32, ["behind"])
    assert (other.load.address, other.specimen.area_mm2, other.operate.orders) == ("/dev/ttyUSB0", 7.0, None)
    _, plain = side_configs(load_config(None, front | {"camera.back": "/dev/video2"}), {}).values()
    assert plain.camera == CameraConfig(address="/dev/video2")
    assert (plain.measure.mask, plain.measure.zoi, list(plain.gauges)) == (None, 24, ["axial"])
    back.write_text("[camera]\naddress = 'sim:'\nback = 'sim:'\n")
    with pytest.raises(ConfigError, match=r"no camera\.back or camera\.beside"):
        side_configs(load_config(None, front | {"camera.back": str(back)}), {})


FIELDS = ["--camera", FRONT, "--beside", FRONT.replace("?", "?seed=11&"), "--load", "sim:"]


@pytest.fixture(scope="module")
def fields(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fields") / "test"
    rig = folder.with_suffix(".toml")
    rig.write_text(
        "[specimen]\narea_mm2 = 40\nstandard = 'free'\nmodulus_between = [1e-4, 7e-4]\n"
        "[[alarm]]\nchannel = 'axial'\nabove = 0.5\n"
    )
    assert (
        main(["run", "--config", str(rig), *FIELDS, *MEASURE, *QUIET, "--report", "--out", str(folder)]) == 0
    )
    return folder


def test_two_fields_have_one_clock_and_each_its_strains(
    fields: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert not (fields / "strain.csv").exists()  # neither a mean nor bending
    specimen = specimen_from(parse_address(FRONT))
    with open_run(fields / "first") as first, open_run(fields / "second") as second:
        assert first.start_monotonic == second.start_monotonic
        assert first.load_samples == second.load_samples
        for run in (first, second):
            bent = specimen.axial_strain(np.asarray(run.strain.time_s)) * (1 + BENDING)
            error = np.asarray(run.strain.values["eyy"]) - bent
            assert 0.5 * MOTION < error[-1] < 1.5 * MOTION  # one camera alone has the motion
        assert not np.array_equal(first.strain.values["eyy"], second.strain.values["eyy"])
    text = (fields / "report.html").read_text()
    assert all(
        words in text for words in ("two fields of view", "Budget of E, second", 'href="first/report.html"')
    )
    assert "Front minus mean" not in text
    assert main(["show", str(fields)]) == 4
    assert f"give the folder of one, {fields / 'first'}" in capsys.readouterr().err


def test_a_replay_of_two_fields_is_bit_equal(fields: Path, tmp_path: Path) -> None:
    out = tmp_path / "again"
    assert main(["replay", str(fields), "--as-measured", "--out", str(out), *QUIET]) == 0
    for name in ("first", "second"):
        with Strain.open(fields / name / "strain.h5") as live, Strain.open(out / name / "strain.h5") as again:
            for column in live.names:
                np.testing.assert_array_equal(live.maps(column), again.maps(column), err_msg=column)


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
        open_two_rigs(cameras, LoadConfig(address="sim:"), [lambda event: None] * 2)
