"""From camera and load cell to strain, and back again from the recording."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from acquire.camera import Camera, CroppedCamera
from acquire.errors import DataError
from acquire.events import EventKind
from acquire.frame import Frame
from acquire.session import SessionWriter
from acquire.session.reader import Session
from live.cli import main
from live.commands.consumers import standard_consumers
from live.config.loading import load_config
from live.pipeline.consumer import Consumer
from live.pipeline.measurement import Measurement
from live.results.reader import Strain
from live.run import live_run as live_module
from live.run.control import answer
from live.run.live_run import LiveRun, run_live
from live.run.outcome import Outcome
from live.setup.devices import Rig
from live.ui.terminal.screen import TerminalScreen
from tests.live.ui.waiting import until

SIM = "sim:woven?lockstep=yes&seconds=3&fps=15&width=224&height=192&bits=12"
SMALL = {
    "measure.zoi": 48,
    "measure.step": 24,
    "measure.burst": 3,
    "measure.reference_burst": 4,
    "view.enabled": False,
    "view.rrd": False,
}
MAPS = ("u", "v", "du_dx", "du_dy", "dv_dx", "dv_dy", "exx", "eyy", "exy", "sigma_exx", "sigma_eyy", "sigma_exy",
        "residual", "status")  # fmt: skip


def live_run(
    folder: Path, camera: str = SIM, each: Callable[[LiveRun, Measurement], None] | None = None, **more: Any
) -> Outcome:
    """A run; ``each`` is called with it and every measurement, in the measuring thread."""
    overrides = {"camera.address": camera, "load.address": "sim:", "output.dir": str(folder), **SMALL, **more}
    watcher = Watcher(each) if each else None
    screen = TerminalScreen(quiet=True)
    return run_live(
        load_config(None, overrides),
        screen,
        consumers=standard_consumers(screen, [watcher] if watcher else []),
        on_start=watcher.lives.append if watcher else lambda live: None,
    )


class Watcher(Consumer):
    """Shows every measurement of a run to a function."""

    blocks = False

    def __init__(self, each: Callable[[LiveRun, Measurement], None]) -> None:
        self._each, self.lives = each, list[LiveRun]()

    def measurement(self, measurement: Measurement) -> None:
        self._each(self.lives[0], measurement)


def strains(folder: Path) -> dict[str, np.ndarray]:
    with h5py.File(folder / "strain.h5") as file:
        group = file["entry/strain"]
        return {name: group[name][()] for name in (*MAPS, "time_s", "force_N")}


def assert_bit_equal(one: Path, other: Path) -> None:
    """All columns and maps of two folders, but for the times that a machine takes."""
    with Strain.open(one / "strain.h5") as a, Strain.open(other / "strain.h5") as b:
        for name in set(a.values) - {"latency_s", "kernel_s"}:
            np.testing.assert_array_equal(a.values[name], b.values[name], err_msg=name)
        for name in a.names:
            np.testing.assert_array_equal(a.maps(name), b.maps(name), err_msg=name)


def replay(source: Path, out: Path, *words: str) -> int:
    return main(["replay", str(source), *words, "--out", str(out), "--no-view", "--no-rrd"])


def assert_replay_is_bit_equal(folder: Path, out: Path, session: str = "session.h5") -> None:
    """A replay of a run as measured, into ``out``, gives its results."""
    assert replay(folder / session, out, "--as-measured") == 0
    assert_bit_equal(folder, out)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Outcome]:
    folder = tmp_path_factory.mktemp("live") / "run"
    return folder, live_run(folder)


def test_the_strain_is_that_of_the_specimen(recorded: tuple[Path, Outcome]) -> None:
    _, outcome = recorded
    specimen = outcome.rig.specimen
    last = outcome.run_state.history.time_steps[-1]
    true = float(specimen.axial_strain(specimen.elapsed(last.t)))
    assert last.n_valid == last.n_zoi > 10
    # The ZOIs do not cover a whole number of cells, so the mean is near the mean strain, not at it.
    assert last.eyy == pytest.approx(true, rel=0.25)
    assert true > 1e-3


def test_everything_is_accounted_for(recorded: tuple[Path, Outcome]) -> None:
    folder, outcome = recorded
    frame_counts = outcome.run_state.frame_counts
    assert outcome.exit_code == 0
    assert frame_counts.adds_up
    assert frame_counts.recorded == frame_counts.grabbed == 46
    assert (frame_counts.reference, frame_counts.skipped, frame_counts.lost) == (4, 0, 0)
    with Session.open(folder / "session.h5") as session:
        assert len(session) == 46
        assert session.frame_counts["measured"] == frame_counts.measured
        kinds = [event.kind for event in session.events()]
        assert kinds.count(EventKind.MEASURED) == 14
        assert kinds.count(EventKind.REFERENCE) == 1
        assert session.config["measure"]["zoi"] == 48


def test_the_csv_has_a_row_a_measurement(recorded: tuple[Path, Outcome]) -> None:
    folder, outcome = recorded
    with (folder / "strain.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    assert len(rows) == 14
    assert " ".join([*rows[0]][:11]) == (
        "frame time_s force_N exx eyy exy sigma_exx sigma_eyy sigma_exy n_valid n_zoi"
    )
    assert float(rows[-1]["eyy"]) == pytest.approx(outcome.run_state.history.time_steps[-1].eyy, rel=1e-5)


def test_replay_as_measured_is_bit_equal(recorded: tuple[Path, Outcome], tmp_path: Path) -> None:
    folder, _ = recorded
    assert_replay_is_bit_equal(folder, tmp_path / "again")


def test_plain_replay_measures_every_burst_with_other_zois(
    recorded: tuple[Path, Outcome], tmp_path: Path
) -> None:
    folder, _ = recorded
    session, same, other = folder / "session.h5", tmp_path / "same", tmp_path / "other"
    assert replay(session, same) == 0
    assert_bit_equal(folder, same)  # in lock step nothing was skipped
    words = ["--zoi", "32", "--step", "8", "--from", "1", "--to", "2.5", "--burst", "1"]
    assert replay(session, other, *words) == 0
    times = strains(other)["time_s"]
    assert len(times) == 23  # 15 fps
    assert times.min() >= 1
    assert times.max() <= 2.5


def test_replay_with_forced_skips_is_bit_equal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A camera that does not wait, and a measurement that is too slow for it."""
    folder = tmp_path / "run"
    open_rigs = live_module.open_rigs

    def hasty(*arguments: Any, **named: Any) -> tuple[Rig, ...]:
        (rig,) = open_rigs(*arguments, **named)
        monkeypatch.setattr(
            rig.camera, "info", replace(rig.camera.info, live=True, fps=None)
        )  # a rate unsaid: nothing is held for long
        return (rig,)

    def slow(live: LiveRun, m: Measurement) -> None:
        if m.number < 2:
            live.first.source.join()  # the camera has given everything before this one is done

    monkeypatch.setattr(live_module, "open_rigs", hasty)
    outcome = live_run(folder, each=slow)
    assert outcome.run_state.frame_counts.skipped > 0
    assert outcome.run_state.frame_counts.adds_up
    assert_replay_is_bit_equal(folder, tmp_path / "again")


class Lossy(CroppedCamera):
    """Loses two frames before every fifth one and damages every seventh."""

    def __init__(self, camera: Camera) -> None:
        super().__init__(camera, (0, 0, camera.info.width, camera.info.height))

    def __iter__(self) -> Iterator[Frame]:
        for number, frame in enumerate(super().__iter__()):
            lost = 2 * (number // 5)
            yield replace(
                frame,
                index=number + lost,
                lost_before=2 * (number > 0 and number % 5 == 0),
                damaged=number % 7 == 6,
            )


@pytest.mark.parametrize("skips", [False, True])
def test_losses_are_the_same_live_and_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, skips: bool
) -> None:
    folder, out = tmp_path / "run", tmp_path / "again"
    open_rigs = live_module.open_rigs

    def lossy(*arguments: Any, **named: Any) -> tuple[Rig, ...]:
        (rig,) = open_rigs(*arguments, **named)
        camera = Lossy(rig.camera)
        camera.info = replace(camera.info, live=skips, fps=None)
        return (replace(rig, camera=camera),)

    def slow(live: LiveRun, m: Measurement) -> None:
        if skips and m.number < 2:
            live.first.source.join()

    monkeypatch.setattr(live_module, "open_rigs", lossy)
    outcome = live_run(folder, each=slow, **{"measure.burst": 2})
    frame_counts = outcome.run_state.frame_counts
    assert frame_counts.adds_up
    assert (frame_counts.skipped > 0) is skips
    session = folder / "session.h5"
    assert replay(session, out, "--as-measured") == 0
    for name in ("lost", "frame", "last_frame", "n_frames"):
        np.testing.assert_array_equal(mean(folder, name), mean(out, name), err_msg=name)
    reference_end = 3
    with Session.open(session) as recorded:
        between = [f for f in recorded.frames() if reference_end < f.index <= mean(folder, "last_frame")[-1]]
    assert sum(mean(folder, "lost")) == sum(f.lost_before + f.damaged for f in between) > 5


def mean(folder: Path, name: str) -> np.ndarray:
    with h5py.File(folder / "strain.h5") as file:
        return np.asarray(file["entry/mean"][name][()])


def test_a_new_reference_is_composed_and_replayed(tmp_path: Path) -> None:
    folder = tmp_path / "run"

    def ask(live: LiveRun, m: Measurement) -> None:
        if m.number == 5:
            live.command(EventKind.NEW_REFERENCE)

    outcome = live_run(folder, each=ask)
    assert outcome.run_state.frame_counts.adds_up
    assert outcome.run_state.frame_counts.reference == 8
    specimen = outcome.rig.specimen
    last = outcome.run_state.history.time_steps[-1]
    assert last.eyy == pytest.approx(float(specimen.axial_strain(specimen.elapsed(last.t))), rel=0.25)
    assert_replay_is_bit_equal(folder, tmp_path / "again")


def whole_bursts(session: Path) -> list[int]:
    """Numbers of the measured bursts of three that were recorded, by their events; the reference is four frames."""
    with Session.open(session) as recorded:
        measured = [event.data for event in recorded.events() if event.kind is EventKind.MEASURED]
        switched = [event.data for event in recorded.events() if event.kind is EventKind.RECORD]
    assert [data["on"] for data in switched[-2:]] == [True, False] and switched[-2]["before"] > 0
    assert all(data["last"] - data["first"] == 2 for data in measured)
    return [(data["first"] - 4) // 3 for data in measured]


@pytest.mark.parametrize("mode", ["all", "bursts"])
def test_an_armed_run_records_from_a_little_before_the_order_to_the_end_of_it(
    tmp_path: Path, mode: str
) -> None:
    """Nothing but the reference before; the list of measured bursts is that of recorded ones, and replays."""
    folder, out = tmp_path / "run", tmp_path / "again"
    orders = {4: "start", 5: "start", 8: "stop", 9: "stop"}
    answers: dict[int, str] = {}

    def order(live: LiveRun, m: Measurement) -> None:
        if m.number in orders:
            answers[m.number] = answer(orders[m.number], live)

    more = {"record.armed": True, "record.keep_s": 0.6, "record.mode": mode}
    outcome = live_run(folder, each=order, **more)
    assert answers[4].startswith("ok: with ") and answers[8] == "ok"
    assert (answers[5], answers[9]) == ("no: recording already", "no: not recording")
    frame_counts = outcome.run_state.frame_counts
    assert frame_counts.adds_up and frame_counts.measured == 14 * 3 and not frame_counts.loss
    left = frame_counts.grabbed - frame_counts.recorded
    assert f"not recorded 0 and {left} on purpose; every frame is accounted for" in frame_counts.line()
    session = folder / "session.h5"
    for extra in ([], ["--as-measured"]):
        again = out / str(len(extra))
        assert replay(session, again, *extra) == 0
    live, replayed = strains(folder), strains(again)
    rows = [list(live["time_s"]).index(t) for t in replayed["time_s"]]
    # How far the camera is ahead of the orders depends on the machine, so the first and the last are not fixed.
    assert rows == whole_bursts(session) == list(range(rows[0], rows[-1] + 1))
    assert rows[0] > 0 and {4, 5, 6, 7} <= set(rows)
    if mode == "bursts":
        assert frame_counts.recorded == 4 + 3 * len(rows)
    np.testing.assert_allclose(
        replayed["eyy"], live["eyy"][rows], atol=2e-5
    )  # sigma is 2e-4; the start is another
    np.testing.assert_array_equal(replayed["force_N"], live["force_N"][rows])


def test_a_recording_that_has_failed_is_not_shown_as_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The disk is full after ten frames; the status line went on with REC."""
    write, written = SessionWriter.write_frame, itertools.count()
    states: list[tuple[str, bool]] = []

    def write_frame(self: SessionWriter, frame: Frame) -> int:
        if next(written) >= 10:
            raise DataError("session.h5: the disk is full")
        return write(self, frame)

    def look(live: LiveRun, m: Measurement) -> None:
        if m.number == 6:
            until(lambda: not live.recording)
        states.append((live.first.state, live.recording))

    monkeypatch.setattr(SessionWriter, "write_frame", write_frame)
    outcome = live_run(tmp_path / "run", each=look)
    assert outcome.exit_code == 5
    assert states[-1] == ("NOT RECORDING", False)


@pytest.mark.parametrize(
    "how",
    [
        pytest.param({"record.mode": "bursts"}, marks=pytest.mark.slow),
        pytest.param({"camera.crop": (16, 8, 160, 152)}, marks=pytest.mark.slow),
        {"record.mode": "bursts", "camera.crop": (16, 8, 160, 152)},
    ],
)
def test_what_is_recorded_in_part_replays_bit_equal(tmp_path: Path, how: dict[str, Any]) -> None:
    folder = tmp_path / "run"
    assert live_run(folder, **how).run_state.frame_counts.adds_up
    assert replay(folder / "session.h5", tmp_path / "plain") == 0
    assert_bit_equal(folder, tmp_path / "plain")
    assert_replay_is_bit_equal(folder, tmp_path / "as measured")


def test_a_lag_is_taken_off_on_request_and_both_forces_are_stored(
    tmp_path: Path, recorded: tuple[Path, Outcome]
) -> None:
    folder, outcome = recorded
    out, lag = tmp_path / "again", 0.15
    assert replay(folder / "session.h5", out, "--as-measured", "--lag", str(lag)) == 0
    before, forces, raw = mean(folder, "force_N"), mean(out, "force_N"), mean(out, "force_raw_N")
    np.testing.assert_array_equal(raw, before)
    loads, start = (
        outcome.run_state.loads,
        outcome.run_state.history.time_steps[0].t - mean(folder, "time_s")[0],
    )
    expected = [loads.force_at(t + lag) for t in mean(folder, "time_s") + start]
    np.testing.assert_allclose(forces, expected, rtol=1e-6)
    assert np.nanmax(np.abs(forces - raw)) > 50  # a ramp


def test_dark_and_flat_frames_take_the_fixed_pattern_out(tmp_path: Path) -> None:
    """A fixed pattern pulls displacement towards zero; corrected, a moved folder still replays bit-equal."""
    camera = "sim:uniform?lockstep=yes&seconds=2&fps=15&width=224&height=192&bits=12&fpn=6&drift_x=0.5"
    flat = tmp_path / "flat.tif"
    even = camera.replace("drift_x=0.5", "contrast=1&radius=64&max_strain=0")
    assert main(["average", "--camera", even, "--frames", "16", "--out", str(flat)]) == 0
    errors = []
    for name, more in (("raw", {}), ("corrected", {"camera.flat": str(flat)})):
        outcome = live_run(tmp_path / name, camera, **more)
        specimen = outcome.rig.specimen
        with h5py.File(tmp_path / name / "strain.h5") as file:
            found = file["entry/strain"]
            x, y = (place.ravel() for place in np.meshgrid(found["x"][()], found["y"][()]))
            true = specimen.displacement(x, y, specimen.elapsed(28 / 15))[
                0
            ]  # the middle frame of the last burst
            errors.append(np.nanmedian(np.abs(found["u"][-1].ravel() - true)))
    assert errors[1] < 0.1 * errors[0]
    (tmp_path / "corrected").rename(tmp_path / "moved")
    assert_replay_is_bit_equal(tmp_path / "moved", tmp_path / "again")


def test_a_rotated_recording_is_one_session(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    config = load_config(
        None, {"camera.address": SIM, "load.address": "sim:", "output.dir": str(folder), **SMALL}
    )
    object.__setattr__(config.record, "rotate_MB", 1.0)  # smaller than the configuration allows
    assert run_live(config, TerminalScreen(quiet=True)).exit_code == 0
    assert len(list(folder.glob("session*.h5"))) > 2
    assert_replay_is_bit_equal(folder, tmp_path / "again", "session.001.h5")


def test_every_third_frame_is_a_slower_camera(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, out = tmp_path / "run", tmp_path / "again"
    outcome = live_run(folder, **{"record.mode": "every=3"})
    frame_counts = outcome.run_state.frame_counts
    assert (frame_counts.recorded, frame_counts.thinned) == (16, 30)
    assert frame_counts.adds_up
    assert not frame_counts.loss
    session = folder / "session.h5"
    assert replay(session, out) == 0
    assert len(strains(out)["time_s"]) == 14
    assert replay(session, tmp_path / "x", "--burst", "3") == 2
    assert "holds only one frame in 3" in capsys.readouterr().err
    with h5py.File(out / "strain.h5") as file:
        assert list(file["entry/mean/frame"]) == [6 + 3 * k for k in range(14)]  # as the source counts
        assert list(file["entry/mean/last_frame"]) == [6 + 3 * k for k in range(14)]
    assert replay(session, tmp_path / "y", "--as-measured") == 2
    assert "not the bursts that were measured" in capsys.readouterr().err
    assert not (tmp_path / "y").exists()


def test_without_recording_and_load(tmp_path: Path) -> None:
    outcome = live_run(tmp_path / "run", **{"load.address": "none:", "record.enabled": False})
    assert outcome.exit_code == 0
    assert not (tmp_path / "run" / "session.h5").exists()
    assert np.isnan(strains(tmp_path / "run")["force_N"]).all()


def test_stopping_from_outside_closes_everything(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    outcome = live_run(folder, each=lambda live, m: live.stop("interrupted") if m.number == 3 else None)
    assert outcome.exit_code == 130
    assert outcome.run_state.frame_counts.adds_up
    with Session.open(folder / "session.h5") as session:
        assert session.frame_counts is not None
        assert len(session) == outcome.run_state.frame_counts.recorded
