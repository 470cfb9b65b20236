"""``phasedic batch``: its results, what it repeats, and what remains when a process dies."""

from __future__ import annotations

import os
import platform
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet

from acquire import hdf5
from acquire.hdf5 import FlushTimer
from live.cli import main
from live.replay.batch.task import Task, perform
from live.results import strain_h5
from tests.live.replay.batch.conftest import SETTINGS
from tests.live.replay.batch.running import datasets, differing, is_gone, parts, pid_of, rows, started
from tests.live.ui.waiting import until

ROOT = Path(__file__).parents[4]


def batch(*words: object) -> int:
    return main(["batch", *map(str, words)])


@pytest.mark.slow
def test_twelve_tests_in_one_table(done: Path) -> None:
    table = rows(done)
    assert [row["test"] for row in table] == sorted(
        f"{k}-{n}" for k in ("hole", "uniform", "woven") for n in (1, 2, 3, 4)
    )
    assert {(row["outcome"], row["zoi_px"], row["exit_code"]) for row in table} == {("done", "48", "0")}
    assert {row["burst"] for row in table} == {"2"}
    assert all(float(row["Rm_MPa"]) > 0 and 0 < float(row["strain_noise"]) < 0.01 for row in table)
    typed = parquet.read_table(done / "summary.parquet")
    assert typed.column("test").to_pylist() == [row["test"] for row in table]
    assert typed.column("Rm_MPa").to_pylist() == [float(row["Rm_MPa"]) for row in table]
    assert not parts(done)


LIMITED = """
import resource, sys
from live.cli import main
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), int(sys.argv[1])))
sys.exit(main(["batch", *sys.argv[2:]]))
"""


@pytest.mark.slow
@pytest.mark.parametrize(("limit", "code"), [(60000, "5"), (20000, "4")])
def test_a_full_disk_is_a_line_of_each_test(runs: Path, tmp_path: Path, limit: int, code: str) -> None:
    """The limit on the size of files stands in for the disk; at 20000 bytes strain.h5 has no room for its groups."""
    words = [str(runs / f"hole-{n}" / "session.h5") for n in (1, 2)]
    command = [
        sys.executable,
        "-c",
        LIMITED,
        str(limit),
        *words,
        *SETTINGS,
        "--burst",
        "1",
        "--out",
        str(tmp_path / "o"),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    said = done.stdout + done.stderr
    assert done.returncode == 5 and "Traceback" not in said, said
    assert len(said.splitlines()) < 14 and "ignored" not in said and ".part/" not in done.stdout, said
    assert {row["exit_code"] for row in rows(tmp_path / "o")} == {code}
    assert all("cannot be written (File too large)" in row["error"] for row in rows(tmp_path / "o"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["uniform-1", "hole-2", "woven-4"])
def test_bit_equal_to_a_replay(runs: Path, done: Path, tmp_path: Path, name: str) -> None:
    """In a process of its own: this one may have compiled loops for other tests, with another last digit."""
    words = ["replay", str(runs / name / "session.h5"), *SETTINGS, "--no-view", "--no-rrd"]
    command = [sys.executable, "-m", "live.cli", *words, "--out", str(tmp_path / "alone")]
    subprocess.run(command, check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
    assert not differing(done / name / "strain.h5", tmp_path / "alone" / "strain.h5")


def test_the_results_say_where_they_lie(done: Path) -> None:
    assert b".part" not in (done / "hole-1" / "strain.h5").read_bytes()
    assert b".part" not in (done / "hole-1" / "replay.txt").read_bytes()


def test_rows_of_a_task_are_flushed_seldom(
    runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody would have them from a broken one; those of a replay can be followed."""
    session, paces = str(runs / "hole-1" / "session.h5"), []
    monkeypatch.setattr(
        hdf5, "FlushTimer", lambda every_s, now: paces.append(every_s) or FlushTimer(every_s, now)
    )
    settings = {"measure.zoi": 48, "measure.step": 12}
    row = perform(Task("task", str(tmp_path), session, overrides=settings))
    assert row.values["outcome"] == "done"
    assert (
        main(["replay", session, *SETTINGS, "--no-view", "--no-rrd", "--out", str(tmp_path / "alone")]) == 0
    )
    assert paces == [10.0, strain_h5.FLUSH_S]


def test_one_that_fails_stops_no_other(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "session.h5").write_bytes(b"no session at all" * 100)
    shutil.copytree(runs / "hole-1", tmp_path / "good")
    words = (tmp_path / "*" / "session.h5", *SETTINGS, "--out", tmp_path / "out")
    assert batch(*words) == 5
    told = rows(tmp_path / "out")
    assert [(row["test"], row["outcome"], row["exit_code"]) for row in told] == [
        ("broken", "failed", "4"),
        ("good", "done", "0"),
    ]
    assert "session.h5" in told[0]["error"]
    assert f"broken: failed: {told[0]['error']}" in capsys.readouterr().out
    assert not (tmp_path / "out" / "broken").exists()
    shutil.copy(runs / "hole-2" / "session.h5", tmp_path / "broken" / "session.h5")
    assert batch(*words) == 0
    assert "1 done before, 1 to replay" in capsys.readouterr().out


@pytest.mark.slow
def test_a_worker_that_is_killed(runs: Path, done: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    caller = started(runs / "[hu]*" / "session.h5", *SETTINGS, "--workers", 2, "--out", out)
    until(lambda: bool(parts(out)))
    os.kill(pid_of(parts(out)[0]), signal.SIGKILL)
    assert caller.wait(120) == 0
    assert [row["outcome"] for row in rows(out)] == ["done"] * 8
    assert not parts(out)
    for name in ("hole-1", "uniform-4"):
        ours, other = datasets(out / name / "strain.h5"), datasets(done / name / "strain.h5")
        assert all(
            np.array_equal(ours[key], other[key], equal_nan=True) for key in ours if key.endswith("/eyy")
        )


@pytest.mark.slow
def test_a_caller_that_is_killed(runs: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = (runs / "hole-*" / "session.h5", *SETTINGS, "--workers", 2, "--out", out)
    caller = started(*words)
    until(lambda: bool(parts(out)))
    caller.kill()
    caller.wait()
    left = parts(out)
    until(lambda: all(is_gone(pid_of(part)) for part in left))
    assert not (out / "summary.csv").exists()
    assert all(
        (folder / "batch.json").exists() for folder in out.iterdir() if not folder.name.startswith(".")
    )
    assert batch(*words) == 0
    assert [row["outcome"] for row in rows(out)] == ["done"] * 4
    assert not parts(out)


def test_interrupted(runs: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    caller = started(runs / "*" / "session.h5", *SETTINGS, "--workers", 2, "--out", out)
    until(lambda: bool(parts(out)))
    workers = [pid_of(part) for part in parts(out)]
    caller.send_signal(signal.SIGINT)
    assert caller.wait(60) == 130
    assert all(is_gone(pid) for pid in workers)
    assert not parts(out)
    assert not (out / "summary.csv").exists()


def test_parts_of_others(runs: Path, done: Path) -> None:
    """Of this machine by their process; of another one when the test is whole."""
    host = platform.node().replace(".", "-")
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    names = [f".new.{host}.{ended.pid}", f".new.{host}.{os.getppid()}", ".new.else.1", ".hole-1.else.1"]
    for name in names:
        (done / f"{name}.part").mkdir()
    assert batch(runs / "*" / "session.h5", *SETTINGS, "--out", done) == 0
    assert {part.name for part in parts(done)} == {f"{name}.part" for name in names[1:3]}
    for part in parts(done):
        part.rmdir()
