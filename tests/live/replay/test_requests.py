"""The options of a replay work, or are refused with a message and an exit code."""

from __future__ import annotations

import csv
import os
import threading
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from acquire.errors import ConfigError, DataError
from acquire.frame import CameraInfo
from acquire.record_mode import RecordMode
from acquire.session import Session
from analysis.compiled.interruption import go_on
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle
from live.cli import main
from live.pipeline.measurement import TimeStep
from live.replay.burst_index import open_store
from live.replay.pictures import reference_from
from live.replay.replay import replay
from live.replay.source import ReplayRequest, until_stopped
from live.results import Strain
from live.results.finished.figures_file import stored_remarks
from live.ui.terminal.screen import TerminalScreen
from tests.live.ended import code_of
from tests.live.shots import write_shots

SHAPE = (128, 160)
STRAINS = (0.0, 0.001, 0.002, 0.003, 0.004, 0.005)
SMALL = ["--zoi", "48", "--step", "24", "--no-view", "--no-rrd"]


@pytest.fixture(scope="module")
def shots(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_shots(tmp_path_factory.mktemp("asked") / "shots", SHAPE, STRAINS)


@pytest.fixture(scope="module")
def session(shots: Path) -> Path:
    out = shots.parent / "run"
    assert main(["run", "--camera", f"files:{shots}", "--burst", "1", *SMALL, "--out", str(out)]) == 0
    return out / "session.h5"


def measured(out: Path) -> list[float]:
    with Strain.open(out / "strain.h5") as strain:
        return [float(value) for value in strain.values["eyy"]]


@pytest.mark.parametrize("source", ["session", "shots"])
def test_a_reference_of_ones_own(
    request: pytest.FixtureRequest, shots: Path, tmp_path: Path, source: str
) -> None:
    path = request.getfixturevalue(source)
    assert (
        main(
            ["replay", str(path), "--reference", str(shots / "a2.png"), *SMALL, "--out", str(tmp_path / "a")]
        )
        == 0
    )
    assert measured(tmp_path / "a") == pytest.approx([strain - 0.002 for strain in STRAINS], abs=3e-4)


@pytest.mark.parametrize("source", ["session", "shots"])
@pytest.mark.parametrize(
    ("more", "code", "says"),
    [
        (["--reference", "nowhere.png"], 4, "nowhere.png: cannot be read: No such file"),
        (["--reference", "PIPE"], 4, "it is a pipe"),
        (["--reference", "DEEP"], 4, "the reference has 16-bit samples"),
        (["--reference", "SMALL"], 4, "the reference has 20 x 10 px"),
        (["--from", "nan"], 2, "--from: 'nan': give a number from 0"),
        (["--to", "-5"], 2, "--to: '-5': give a number from 0"),
        (["--from", "3", "--to", "2"], 2, "--from 3.0 must be before --to 2.0"),
        (["--from", "1000"], 4, "the last one is at 5.000 s"),
        (["--burst", "200"], 4, "no whole burst follows"),
    ],
)
def test_what_is_refused(
    request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str], tmp_path: Path,
    source: str, more: list[str], code: int, says: str,
) -> None:  # fmt: skip
    os.mkfifo(tmp_path / "PIPE")
    (tmp_path / "DEEP").write_bytes(cv2.imencode(".png", np.zeros(SHAPE, np.uint16))[1].tobytes())
    (tmp_path / "SMALL").write_bytes(cv2.imencode(".png", np.zeros((10, 20), np.uint8))[1].tobytes())
    more = [str(tmp_path / word) if word.isupper() else word for word in more]
    path = str(request.getfixturevalue(source))
    assert code_of(["replay", path, *SMALL, "--out", str(tmp_path / "out"), *more]) == code
    assert says in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_reference_beside_the_ones_of_the_run(
    capsys: pytest.CaptureFixture[str], session: Path, shots: Path
) -> None:
    assert main(["replay", str(session), "--as-measured", "--reference", str(shots / "a0.png")]) == 2
    assert "takes the references of the run" in capsys.readouterr().err


def test_nothing_measured_is_told_with_its_reason(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, shots: Path
) -> None:
    """Pictures that have nothing in common with the reference, then over-exposed ones."""
    first = (shots / "a0.png").read_bytes()
    other = 255 * Speckle(SHAPE, radius=2.0, seed=99).render(Affine(), SHAPE)
    nexts = {"other": "); moved out of the picture", "white": "reduce exposure or light"}
    for name, picture in (("other", other), ("white", np.full(SHAPE, 255.0))):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "a0.png").write_bytes(first)
        cv2.imwrite(str(folder / "a1.png"), np.rint(picture).astype(np.uint8))
        assert main(["replay", str(folder), *SMALL, "--out", str(folder / "out")]) == 5
        told = capsys.readouterr().out
        assert "nothing was measured: no ZOI has a value (" in told
        assert nexts[name] in told and "events above" not in told
        assert "exit code 5" in told


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (
            ["--seconds", "0.5", "--reference-burst", "32"],
            "the camera ended before the reference was complete",
        ),
        (["--seconds", "1", "--burst", "200", "--reference-burst", "4"], "gave no burst after the reference"),
    ],
)
def test_a_run_without_a_measurement(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, more: list[str], says: str
) -> None:
    camera = "sim:uniform?lockstep=yes&seconds=3&fps=15&width=160&height=128&bits=12"
    assert main(["run", "--camera", camera, *more, *SMALL, "--out", str(tmp_path / "out")]) == 5
    told = capsys.readouterr().out
    assert f"nothing was measured: {says}" in told or says in told
    with Session.open(tmp_path / "out" / "session.h5") as session:
        assert len(session) > 5


def test_sources_without_a_scheme(session: Path, shots: Path, tmp_path: Path) -> None:
    for number, source in enumerate((shots, f"{shots}/a?.p*g", shots / "a0.png", session)):
        if source != shots / "a0.png":
            assert main(["replay", str(source), *SMALL, "--out", str(tmp_path / str(number))]) == 0
            assert len(measured(tmp_path / str(number))) == 5
    assert main(["run", "--camera", str(shots), *SMALL, "--out", str(tmp_path / "run")]) == 0


def test_a_part_is_cut_as_configured(shots: Path, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(
        "[camera]\ncrop = [10, 10, 120, 100]\n[view]\nenabled = false\nrrd = false\n"
    )
    request = ReplayRequest(
        str(shots),
        tmp_path / "a.toml",
        {"measure.zoi": 48, "measure.step": 24, "output.dir": str(tmp_path / "out")},
    )
    assert replay(request, TerminalScreen(quiet=True), threading.Event()).exit_code == 0
    with Strain.open(tmp_path / "out" / "strain.h5") as strain:
        assert strain.grid.x[-1] < 120


def test_one_that_is_stopped_while_it_is_prepared_measures_nothing(shots: Path, tmp_path: Path) -> None:
    """The first burst of many ZOIs takes seconds, and the stop seemed lost."""

    class Stopping(TerminalScreen):
        def print(self, line: str) -> None:
            stopping.set()

    stopping, out = threading.Event(), tmp_path / "out"
    request = ReplayRequest(str(shots), None, {"measure.zoi": 48, "measure.step": 24, "output.dir": str(out)})
    with pytest.raises(KeyboardInterrupt):
        replay(request, Stopping(quiet=True), stopping)
    assert not out.exists()


def test_one_that_is_stopped_says_how_far_it_came(shots: Path, tmp_path: Path) -> None:
    class Stopping(TerminalScreen):
        def progress(self, i: TimeStep, done: int, expected: int | None, elapsed_s: float) -> None:
            if done == 2:
                stopping.set()

    stopping, out = threading.Event(), tmp_path / "out"
    request = ReplayRequest(str(shots), None, {"measure.zoi": 48, "measure.step": 24, "output.dir": str(out)})
    found = replay(request, Stopping(quiet=True), stopping)
    assert (found.exit_code, len(measured(out))) == (130, 2)
    assert "interrupted after 2 bursts; the others are not measured" in stored_remarks(out)


def test_the_burst_under_way_is_abandoned_where_a_replay_is_stopped() -> None:
    """That of 34,000 ZOIs takes ten seconds."""

    def measured() -> Iterator[int]:
        yield 1
        stopping.set()
        go_on()  # as between two loops
        yield 2

    stopping = threading.Event()
    assert list(until_stopped(measured(), stopping)) == [1]
    go_on()


def test_the_results_say_which_file_each_frame_was(shots: Path, session: Path, tmp_path: Path) -> None:
    assert main(["replay", str(shots), *SMALL, "--out", str(tmp_path / "a")]) == 0
    names = list(csv.DictReader((tmp_path / "a" / "pictures.csv").read_text(encoding="utf-8").splitlines()))
    with Strain.open(tmp_path / "a" / "strain.h5") as strain:
        found = [names[int(frame)]["file"] for frame in strain.values["frame"]]
    assert found == [f"a{k}.png" for k in range(1, len(STRAINS))]
    assert {row["page"] for row in names} == {"0"}
    assert main(["replay", str(session), *SMALL, "--out", str(tmp_path / "b")]) == 0
    assert not (tmp_path / "b" / "pictures.csv").exists()


def test_a_report_at_the_end(shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["replay", str(shots), *SMALL, "--report", "--out", str(out)]) == 0
    assert str(out / "report.html") in capsys.readouterr().out
    assert "<h2>Maps</h2>" in (out / "report.html").read_text(encoding="utf-8")


GAUGES = """
[gauges.axial]
start = [60, 30]
end = [60, 98]
[gauges.area]
kind = "area"
box = [70, 20, 4, 4]
[gauges.mine]
kind = "area"
box = [40, 30, 80, 70]
"""


def test_automatic_gauges_that_do_not_fit_another_grid_are_left_out(
    shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Other ZOIs made a replay of a rig with automatic gauges end with an error."""
    rig = tmp_path / "gauges.toml"
    rig.write_text(GAUGES, encoding="utf-8")
    words = ["--no-view", "--no-rrd", "--roi", "0,0,160,128", "--out"]
    fine = ["--config", str(rig), "--zoi", "32", "--step", "2", "--burst", "1"]
    assert main(["run", "--camera", f"files:{shots}", *fine, *words, str(tmp_path / "run")]) == 0
    session, coarse = str(tmp_path / "run" / "session.h5"), ["--zoi", "64", "--step", "32"]
    capsys.readouterr()
    assert main(["replay", session, *coarse, *words, str(tmp_path / "again")]) == 0
    assert "note: the automatic gauge area of the run has no ZOI in this grid" in capsys.readouterr().out
    with Strain.open(tmp_path / "again" / "strain.h5") as strain:
        gauges = {name for name in strain.values if name.startswith("gauge_")}
    assert gauges == {"gauge_axial", "gauge_mine"}
    assert main(["replay", session, *coarse, "--config", str(rig), *words, str(tmp_path / "mine")]) == 2
    assert "gauges.area: no ZOI is there" in capsys.readouterr().err


@pytest.mark.parametrize(("top", "fits"), [(1023, True), (1024, False)])
def test_a_reference_has_no_more_than_the_bits_of_the_pictures(tmp_path: Path, top: int, fits: bool) -> None:
    camera = CameraInfo("files:", "files", 4, 2, 10, live=False, clock="nominal")
    path, image = tmp_path / "a.png", np.array([[0, 5, 6, 7], [8, 9, 10, top]], np.uint16)
    cv2.imwrite(str(path), image)
    if fits:
        assert np.array_equal(reference_from(str(path), camera).mean, image)
        return
    with pytest.raises(DataError, match="16-bit samples up to 1024, the pictures have 10 bits"):
        reference_from(str(path), camera)


class BurstSession:
    """Bursts of 8 frames, as a session has them."""

    mode = RecordMode.parse("bursts")

    def burst_column(self, name: str) -> np.ndarray:
        first = 8 * np.arange(5)
        columns = {
            "first_index": first,
            "last_index": first + 7,
            "monotonic_s": first / 10,
            "n": 0 * first + 8,
        }
        return np.asarray(columns[name])


@pytest.mark.parametrize("n", [7, 9])
def test_recorded_bursts_have_the_length_they_have(n: int) -> None:
    stored = open_store(BurstSession(), Path("session.h5"))  # type: ignore[arg-type]
    for length in (None, 8):
        index = stored.index_after(7, length)
        assert (index.starts.tolist(), index.stops.tolist()) == ([1, 2, 3, 4], [2, 3, 4, 5])
        assert index.t.tolist() == [0.8, 1.6, 2.4, 3.2] and index.rows(range(1, 3)) == (2, 4)
    with pytest.raises(ConfigError, match="holds bursts of 8 frames; give --burst 8"):
        stored.index_after(7, n)
    with pytest.raises(ConfigError, match="--reference-burst cannot be changed"):
        stored.first_burst(8)
