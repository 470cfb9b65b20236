"""Forces from a CSV: the usual formats are read, others are refused with a message."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acquire.errors import PhasedicError
from live.cli import main
from live.replay.forces import read_forces
from live.results.run_folder import open_run
from tests.live.replay.test_requests import SMALL, shots

__all__ = ["shots"]


def table(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "forces.csv"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("text", "times", "forces"),
    [
        ("time_s,force_N\n0,1\n0.5,2.5\n", (0, 0.5), (1, 2.5)),
        ("Time [s];Extension [mm];Load [kN]\n0;0;0,1\n0,5;1;0,25\n", (0, 0.5), (100, 250)),
        ("time\tforce\nms\tlbf\n0\t1\n500\t2\n", (0, 0.5), (4.4482216153, 8.8964432306)),
        ("# machine 3\nt,F\n0,1\n0.5,2.5\n", (0, 0.5), (1, 2.5)),
        ("0,1\n0.5,2.5\n", (0, 0.5), (1, 2.5)),
        ("\ufefftime_min,load_N\r\n0,1\r\n0.5,\r\n", (0, 30), (1, math.nan)),
    ],
)
def test_times(tmp_path: Path, text: str, times: tuple[float, ...], forces: tuple[float, ...]) -> None:
    read = read_forces(table(tmp_path, text))
    assert read.times == times
    assert read.forces == pytest.approx(forces, nan_ok=True)


def test_semicolons_separate_before_tabs_and_commas(tmp_path: Path) -> None:
    """Without a heading, the decimal commas stand in the first line too."""
    read = read_forces(table(tmp_path, "0;0,1\n0,5;-2,25\n"))
    assert (read.times, read.forces) == ((0.0, 0.5), (0.1, -2.25))
    read = read_forces(table(tmp_path, "Time\tLoad, total\tForce [N]\n0\t1\t2\n1\t1\t3\n"))
    assert (read.times, read.forces) == ((0.0, 1.0), (2.0, 3.0))


def test_only_between_times_there_are_gaps(tmp_path: Path) -> None:
    """Pictures by name may be minutes apart; of a table with times a gap is three of its steps."""
    named = read_forces(table(tmp_path, "a0,100\na1,200\n"))
    samples = named.samples({"a0.png": 0.0, "a1.png": 60.0}, 0.0)
    assert named.log(samples, 0.5).forces_one_zero([30.0]).tolist() == [150.0]
    timed = read_forces(table(tmp_path, "time_s,force_N\n0,0\n1,10\n2,20\n6,60\n9,90\n"))
    log = timed.log(timed.samples(None, 100.0), 0.5)
    found = log.forces_one_zero([100.5, 104.0, 107.5]).tolist()
    assert found == pytest.approx([5.0, 40.0, 75.0])
    sparse = read_forces(table(tmp_path, "time_s,force_N\n0,0\n1,10\n2,20\n6,60\n"))
    log = sparse.log(sparse.samples(None, 100.0), 0.5)
    assert log.forces_one_zero([101.5, 104.0]).tolist() == pytest.approx([15.0, math.nan], nan_ok=True)
    dense = read_forces(table(tmp_path, "time_s,force_N\n0,0\n0.1,10\n0.2,20\n0.6,60\n"))
    log = dense.log(dense.samples(None, 100.0), 0.5)
    assert log.forces_one_zero([100.4]).tolist() == pytest.approx([40.0])


@pytest.mark.parametrize("text", ["file,force_kN\na1.png,1\nshots/a0.png,-0.5\n", "a1,1000\na0.png,-500\n"])
def test_names_in_any_order_with_and_without_folder_and_ending(tmp_path: Path, text: str) -> None:
    samples = read_forces(table(tmp_path, text)).samples({"a0.png": 0.0, "a1.png": 1.0, "a2.png": 2.0}, 0.0)
    assert [sample.t for sample in samples] == [0, 1, 2]
    assert [sample.force for sample in samples] == pytest.approx([-500, 1000, math.nan], nan_ok=True)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "holds no forces"),
        ("time_s,force_N\n", "holds no forces"),
        ("a,b,c\n1,2,3\n", "the heading is 'a, b, c'; wanted: a column force_N"),
        ("time_s,force_stone\n0,1\n", "forces in 'stone' are not known; give N, kN, kgf or lbf"),
        ("time_s,force_kg\n0,1\n", "forces in 'kg' are not known"),
        ("time_h,force_N\n0,1\n", "times in 'h' are not known"),
        ("time_s,force_N,load_N\n0,1,2\n", "2 columns are called 'force'"),
        ("time_s,force_N\n0,1\n1,x7\n", "'x7' in the row '1,x7' is not a number"),
        ("time_s,force_N\n0,1\n,2\n", "'' in the row ',2' is not a number"),
        ("time_s,force_N\n1,1\n0,2\n", "the times run backwards (0 s after 1 s)"),
    ],
)
def test_refusals(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(PhasedicError) as refused:
        read_forces(table(tmp_path, text))
    assert says in str(refused.value)
    assert "forces.csv" in str(refused.value)


@settings(max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.text(max_size=80))
def test_any_text_is_read_or_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "any.csv"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    try:
        read = read_forces(path)
    except PhasedicError as error:
        assert "any.csv" in str(error)
    else:
        assert len(read.forces) == len(read.names or read.times) > 0


def replayed(
    shots: Path, tmp_path: Path, text: str, *more: str, source: str | None = None
) -> tuple[int, Path]:
    out = tmp_path / "out"
    csv = str(table(tmp_path, text))
    return main(["replay", source or str(shots), "--load", csv, *SMALL, "--out", str(out), *more]), out


def test_a_folder_of_pictures_with_forces_by_name_has_a_curve(shots: Path, tmp_path: Path) -> None:
    text = "file,force_kN\n" + "".join(f"a{k}.png,{0.1 * k}\n" for k in (0, 1, 2, 4, 5))
    code, out = replayed(shots, tmp_path, text, "--section", "10,2")
    assert code == 0
    with open_run(out) as run:
        assert run.force.tolist() == pytest.approx([100, 200, math.nan, 400, 500], nan_ok=True)
        assert run.stress is not None
        np.testing.assert_allclose(run.stress, run.force / 20e-6)
        assert run.strain.metadata["forces"] == str(tmp_path / "forces.csv")


@pytest.mark.parametrize("session", [False, True])
def test_forces_by_time(shots: Path, tmp_path: Path, session: bool) -> None:
    source = None
    if session:
        live = tmp_path / "run"
        assert main(["run", "--camera", f"files:{shots}", "--burst", "1", *SMALL, "--out", str(live)]) == 0
        source = str(live / "session.h5")
    text = "time_s,force_N\n" + "".join(f"{t},{10 * t}\n" for t in (0, 2, 4, 6))
    code, out = replayed(shots, tmp_path, text, source=source)
    assert code == 0
    with open_run(out) as run:
        np.testing.assert_allclose(run.force, 10 * run.strain.time_s, rtol=1e-9)


def test_names_must_fit(shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert replayed(shots, tmp_path, "file,force_N\nb.png,1\n")[0] == 4
    assert "none of its 1 names is that of a picture" in capsys.readouterr().err
    assert replayed(shots, tmp_path, "file,force_N\na0.png,1\na0.png,2\n")[0] == 4
    assert "a picture is named twice" in capsys.readouterr().err
    stack = tmp_path / "stack.tif"
    assert cv2.imwritemulti(str(stack), [cv2.imread(str(shots / f"a{k}.png"), 0) for k in range(3)])
    assert replayed(shots, tmp_path, "file,force_N\na0.png,1\n", source=str(stack))[0] == 2
    assert "two pictures share a name" in capsys.readouterr().err
