"""Forces from a CSV: the usual formats are read, others are refused with a message."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acquire.clock import ClockPair
from acquire.errors import ConfigError, DataError, PhasedicError
from live.cli import main
from live.config.sections import LoadConfig
from live.replay.forces import PlacedForces, read_forces
from live.results.run_folder import open_run
from tests.live.replay.test_requests import SMALL, shots

__all__ = ["shots"]
UTC_START = datetime(2026, 11, 25, 10, tzinfo=UTC)


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
    read = read_forces(table(tmp_path, text)).export
    assert read.times is not None and read.times.tolist() == pytest.approx(times)
    assert read.forces.tolist() == pytest.approx(forces, nan_ok=True)


def test_semicolons_separate_before_tabs_and_commas(tmp_path: Path) -> None:
    """Without a heading, the decimal commas stand in the first line too."""
    read = read_forces(table(tmp_path, "0;0,1\n0,5;-2,25\n")).export
    assert read.times is not None
    assert (read.times.tolist(), read.forces.tolist()) == ([0.0, 0.5], [0.1, -2.25])
    read = read_forces(table(tmp_path, "Time\tLoad, total\tForce [N]\n0\t1\t2\n1\t1\t3\n")).export
    assert read.times is not None
    assert (read.times.tolist(), read.forces.tolist()) == ([0.0, 1.0], [2.0, 3.0])


def placed(
    path: Path, pictures: dict[str, float] | None, at: float = 0.0, *, recorded: bool = False
) -> PlacedForces:
    return read_forces(path).placed(pictures, ClockPair(at, UTC_START), recorded=recorded)


def test_only_between_times_there_are_gaps(tmp_path: Path) -> None:
    """Pictures by name may be minutes apart; of a table with times a gap is three of its steps."""
    named = placed(table(tmp_path, "a0,100\na1,200\n"), {"a0.png": 0.0, "a1.png": 60.0})
    assert named.log(LoadConfig()).forces_one_zero([30.0]).tolist() == [150.0]

    def forces(text: str, times: list[float]) -> list[float]:
        found = placed(table(tmp_path, "time_s,force_N\n" + text), None, 100.0)
        return [float(f) for f in found.log(LoadConfig()).forces_one_zero(times)]

    assert forces("0,0\n1,10\n2,20\n6,60\n9,90\n", [100.5, 104.0, 107.5]) == pytest.approx([5.0, 40.0, 75.0])
    assert forces("0,0\n1,10\n2,20\n6,60\n", [101.5, 104.0]) == pytest.approx([15.0, math.nan], nan_ok=True)
    assert forces("0,0\n0.1,10\n0.2,20\n0.6,60\n", [100.4]) == pytest.approx([40.0])


@pytest.mark.parametrize("text", ["file,force_kN\na1.png,1\nshots/a0.png,-0.5\n", "a1,1000\na0.png,-500\n",
                                  "Bild;Kraft [N]\nC:\\shots\\a1.png;1000\na0.png;-500\n"])  # fmt: skip
def test_names_in_any_order_with_and_without_folder_and_ending(tmp_path: Path, text: str) -> None:
    found = placed(table(tmp_path, text), {"a0.png": 0.0, "a1.png": 1.0, "a2.png": 2.0})
    assert found.times.tolist() == [0, 1, 2]
    assert found.forces.tolist() == pytest.approx([-500, 1000, math.nan], nan_ok=True)
    assert not found.doubts


def test_half_of_the_names_without_a_picture_are_said(tmp_path: Path) -> None:
    pictures = {f"a{k}.png": float(k) for k in range(4)}
    text = "file,force_N\na0.png,1\na1.png,2\na2.png,3\nb0.png,4\n"
    few = placed(table(tmp_path, text), pictures)
    assert not few.doubts and "1 of 4 names are that of no picture: 'b0.png'" in few.remarks
    half = placed(table(tmp_path, text.replace("a2", "b2")), pictures)
    assert half.doubts == ("forces.csv: 2 of 4 names are that of no picture: 'b2.png', 'b0.png'",)
    counted = half.at_pictures("forces.csv", LoadConfig(), np.array([*pictures.values()]))
    assert counted.doubts[0] == "forces.csv: 2 of 4 pictures have a force"


@pytest.mark.parametrize("ending", [".png", ""])
def test_footers_below_the_names_are_no_names_without_a_picture(tmp_path: Path, ending: str) -> None:
    pictures = {f"a{k}.png": float(k) for k in range(2)}
    text = "file;force_N\n" + "".join(f"a{k}{ending};{k}.5\n" for k in range(2))
    found = placed(table(tmp_path, text + "\nMaximum;1.5\nMean;1.0\nMaximum;2.5\n"), pictures)
    assert found.forces.tolist() == [0.5, 1.5] and not found.doubts
    assert found.remarks == ("3 lines below the names left out: 'Maximum'",)
    lost = placed(table(tmp_path, text + f"b7{ending};2.5\n"), pictures)
    assert lost.remarks == (f"1 of 3 names are that of no picture: 'b7{ending}'",)


def test_without_times_and_names_there_is_a_row_for_each_picture(tmp_path: Path) -> None:
    path = table(tmp_path, "Index;Kraft [kN]\n1;0,5\n2;1\n3;1,5\n")
    found = placed(path, {"b.png": 4.0, "a.png": 5.0, "c.png": 6.0})
    assert (found.times.tolist(), found.forces.tolist(), found.by_picture) == (
        [4, 5, 6],
        [500, 1000, 1500],
        True,
    )
    assert "row k is taken as the force of picture k" in found.remarks[0]
    with pytest.raises(DataError, match=r"3 rows for 2 pictures; .* --load-column FORCE,TIME"):
        placed(path, {"a.png": 0.0, "b.png": 1.0})
    with pytest.raises(ConfigError, match="a row for each picture, but this source has times alone"):
        placed(path, None)


def test_clocks_begin_at_the_first_picture_and_unix_times_are_met(tmp_path: Path) -> None:
    pictures = {"a.png": 5.0, "b.png": 6.0}
    clock = table(tmp_path, "Time,Load [N]\n10:00:00.5,1\n10:00:01.0,2\n10:00:02.0,4\n")
    found = placed(clock, pictures)
    assert (
        found.times.tolist() == [5.0, 5.5, 6.5]
        and "the first row is taken as the first picture" in found.remarks[0]
    )
    with pytest.raises(ConfigError, match="times of the day"):
        placed(clock, None, 100.0, recorded=True)
    unix = UTC_START.timestamp()
    path = table(tmp_path, f"Time,Load [N]\n{unix + 0.5},1\n{unix + 1.5},2\n")
    assert placed(path, pictures).times.tolist() == [5.0, 6.0]
    assert placed(path, None, 100.0, recorded=True).times.tolist() == [100.5, 101.5]
    stamped = placed(path, {"a.png": unix, "b.png": unix + 1})
    assert (stamped.times - unix).tolist() == [0.5, 1.5] and stamped.remarks == ()


def test_no_picture_with_a_force_is_refused(tmp_path: Path) -> None:
    found = placed(table(tmp_path, "time_s,force_N\n120,1\n130,2\n"), {"a.png": 0.0, "b.png": 9.0})
    with pytest.raises(DataError, match=r"its times are 120 to 130 s from the first picture, .* 0 to 9 s"):
        found.at_pictures("forces.csv", LoadConfig(), np.array([0.0, 9.0]))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "holds no forces"),
        ("time_s,force_N\n", "holds no forces"),
        ("a,b,c\n1,2,3\n", "under the heading 'a, b, c'; wanted: a column force_N"),
        ("time_s,force_stone\n0,1\n", "'force_stone' has no unit; give --load-unit N, kN, kgf or lbf"),
        (
            "time_s,force (stone)\n0,1\n",
            "forces in 'stone' are not known; give N, kN, kgf or lbf: --load-unit",
        ),
        ("time_s,force_kg\n0,1\n", "forces in 'kg' are not known"),
        ("time (d),force_N\n0,1\n", "times in 'd' are not known; give s, ms"),
        ("time_s,force_N,load_N\n0,1,2\n", "'force_N', 'load_N': which one? give --load-column"),
        ("time_s,force_N\n0,1\n1,x7\n", "line 3: 'x7' in '1,x7' is not a number"),
        ("time_s,force_N\n0,1\n,2\n", "line 3: '' in ',2' is not a number"),
        ("time_s,force_N\n1,1\n0,2\n", "line 3: the times run backwards (0 s after 1 s)"),
        ("time_s,force_N\n1,1\n1,2\n", "line 3: the time 1 s stands twice"),
        ("Load (kN),Time\nN,s\n1,0\n", "'Load (kN)' has the unit 'N' below it"),
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
        read = read_forces(path).export
    except PhasedicError as error:
        assert "any.csv" in str(error)
    else:
        assert len(read.forces) > 0
        assert read.times is None or len(read.times) == len(read.forces)


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
def test_forces_by_time(
    shots: Path, tmp_path: Path, session: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    source = None
    if session:
        live = tmp_path / "run"
        assert main(["run", "--camera", f"files:{shots}", "--burst", "1", *SMALL, "--out", str(live)]) == 0
        source = str(live / "session.h5")
    text = "time_s,force_N\n" + "".join(f"{t},{10 * t}\n" for t in (0, 2, 4, 6))
    code, out = replayed(shots, tmp_path, text, source=source)
    assert code == 0
    assert ("the pictures have no times and are taken as 1 s apart" in capsys.readouterr().out) == (
        not session
    )
    with open_run(out) as run:
        np.testing.assert_allclose(run.force, 10 * run.strain.time_s, rtol=1e-9)
    if not session:
        replayed(shots, tmp_path, text, source=f"files:{shots}?fps=2")
        said = capsys.readouterr().out
        assert "pictures have a force" in said and "apart" not in said


def test_names_must_fit(shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert replayed(shots, tmp_path, "file,force_N\nb.png,1\n")[0] == 4
    assert "none of its 1 names is that of a picture" in capsys.readouterr().err
    assert replayed(shots, tmp_path, "file,force_N\na0.png,1\na0.png,2\n")[0] == 4
    assert "a picture is named twice" in capsys.readouterr().err
    stack = tmp_path / "stack.tif"
    assert cv2.imwritemulti(str(stack), [cv2.imread(str(shots / f"a{k}.png"), 0) for k in range(3)])
    assert replayed(shots, tmp_path, "file,force_N\na0.png,1\n", source=str(stack))[0] == 2
    assert "two pictures share a name" in capsys.readouterr().err


def test_what_was_taken_is_printed_and_the_sign_turns_forces_of_files_and_recordings(
    shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = "Zeit [s];Kraft [kN]\n" + "".join(f"{t};{-0.01 * t:.4f}\n".replace(".", ",") for t in range(6))
    code, out = replayed(shots, tmp_path, text, "--load-sign", "-1")
    assert code == 0
    assert (
        "forces.csv: column Kraft, kN, 6 rows, 0 to 50 N against Zeit (s); UTF-8, semicolons, decimal comma;"
        " 6 of 6 pictures have a force"
    ) in capsys.readouterr().out
    with open_run(out) as run:
        np.testing.assert_allclose(run.force, 10 * run.strain.time_s, rtol=1e-9)
    live = tmp_path / "run"
    cell = ["--load", "sim:?noise_N=3", "--camera", "sim:uniform?fps=20"]
    assert main(["run", *cell, "--seconds", "2", *SMALL, "--out", str(live)]) in (0, 5)  # 5: a busy machine
    forces = []
    for sign in ("1", "-1"):
        folder = tmp_path / f"sign{sign}"
        assert main(["replay", str(live), "--load-sign", sign, *SMALL, "--out", str(folder)]) == 0
        with open_run(folder) as run:
            forces.append(run.force)
    assert np.nanmax(np.abs(forces[0])) > 0
    np.testing.assert_allclose(forces[1], -forces[0])


def test_a_test_with_a_load_cell_takes_the_sign_from_its_address(tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text('[camera]\naddress = "sim:"\n[load]\naddress = "sim:"\nsign = -1\n', encoding="utf-8")
    assert main(["run", "--config", str(rig), "--seconds", "1", "--out", str(tmp_path / "out")]) == 2


def test_half_without_a_force_is_exit_code_5(
    shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert replayed(shots, tmp_path, "time_s,force_N\n" + "".join(f"{t},{t}\n" for t in range(3)))[0] == 5
    assert "3 of 6 pictures have a force" in capsys.readouterr().out
