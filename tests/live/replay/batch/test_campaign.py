"""A campaign without workers: what is done first, what fails, and its end."""

from __future__ import annotations

import csv
import dataclasses
import json
import os
import threading
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.errors import ConfigError, DataError
from live.replay.batch import campaign as module
from live.replay.batch.campaign import CampaignRequest, _planned, _task, run_campaign
from live.replay.batch.row import COLUMNS, BatchRow, _cell, as_csv, write_summary
from live.replay.batch.scheduler import ChunkPlan, perform_all
from live.replay.batch.task import ROW_FILE, Task
from live.replay.batch.test_list import BatchJob, _of_source, _pictures, key_of
from live.replay.batch.worker import Pool
from tests.live.screens import RecordingScreen


def sessions(folder: Path, names: str) -> list[BatchJob]:
    found = []
    for name in names:
        (folder / name).mkdir()
        (folder / name / "session.h5").write_bytes(name.encode())
        found.append(BatchJob(name, str(folder / name / "session.h5")))
    return found


def store(task: Task, **values: Any) -> None:
    """The results of a task that was done before."""
    task.folder.mkdir(parents=True)
    row = {"test": task.name, "outcome": "done", "exit_code": 0, **values}
    (task.folder / ROW_FILE).write_text(json.dumps({"key": key_of(task), "row": row}), encoding="utf-8")


class Made:
    """A campaign of tests a, b and c, of which a was done before."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
        self.wanted = CampaignRequest(sessions(folder, "abc"), folder / "out", 2)
        store(_task(self.wanted, self.wanted.tests[0]))
        self.screen, self.stopping, self.done = RecordingScreen(), threading.Event(), list[str]()
        processes = SimpleNamespace(close=lambda: self.done.append("closed"))
        monkeypatch.setattr(module, "_processes", lambda wanted: processes)
        monkeypatch.setattr(module, "_work", self._work)
        monkeypatch.setattr("live.replay.batch.row.as_parquet", lambda rows: None)
        self.codes = {"b": 0, "c": 0}

    def _work(self, wanted: Any, tasks: Any, rows: Any, *_: Any) -> None:
        for task in tasks:
            self.done.append(task.name)
            outcome = "done" if self.codes[task.name] == 0 else "failed"
            rows[task.name] = BatchRow.of(
                {"test": task.name, "outcome": outcome, "exit_code": self.codes[task.name]}
            )


def test_only_what_is_missing_is_replayed_and_the_table_has_all(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    bench = Made(monkeypatch, tmp_path)
    found = run_campaign(bench.wanted, bench.screen, bench.stopping)
    assert sorted(bench.done) == ["b", "c", "closed"] and bench.done[-1] == "closed"
    assert (found.new, found.exit_code, found.files) == (2, 0, (tmp_path / "out" / "summary.csv",))
    assert [row.values["test"] for row in found.rows] == ["a", "b", "c"]
    assert bench.screen.lines == [f"3 tests: 1 done before, 2 to replay into {tmp_path / 'out'}"]
    with (tmp_path / "out" / "summary.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["test"] for row in rows] == ["a", "b", "c"] and list(rows[0]) == list(COLUMNS)


def test_one_that_is_not_well_gives_code_5(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    bench = Made(monkeypatch, tmp_path)
    bench.codes["c"] = 4
    assert run_campaign(bench.wanted, bench.screen, bench.stopping).exit_code == 5


def test_one_that_is_interrupted_writes_no_table(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    bench = Made(monkeypatch, tmp_path)
    bench.stopping.set()
    found = run_campaign(bench.wanted, bench.screen, bench.stopping)
    assert (found.exit_code, found.files, found.new) == (130, (), 2)
    assert not (tmp_path / "out" / "summary.csv").exists()


def test_a_test_whose_files_cannot_be_read_fails_and_others_go_on(tmp_path: Path) -> None:
    tests = [*sessions(tmp_path, "a"), BatchJob("gone", str(tmp_path / "gone" / "session.h5"))]
    rows, tasks = _planned(CampaignRequest(tests, tmp_path / "out", 1))
    assert [task.name for task in tasks] == ["a"] and tasks[0].key == key_of(tasks[0])
    values = rows["gone"].values
    assert (values["outcome"], values["exit_code"]) == ("failed", 4)
    assert "No such file" in str(values["error"])


def test_results_of_other_settings_are_not_overwritten(tmp_path: Path) -> None:
    wanted = CampaignRequest(sessions(tmp_path, "ab"), tmp_path / "out", 1)
    for test in wanted.tests:
        store(_task(wanted, test))
    assert _planned(wanted)[1] == []
    other = dataclasses.replace(wanted, overrides={"measure.zoi": 32})
    with pytest.raises(ConfigError, match=r"out/a and 1 more: holds results of other settings"):
        _planned(other)


def test_settings_of_a_test_come_before_those_of_all(tmp_path: Path) -> None:
    job = BatchJob("a", "a.h5", config="own.toml", forces="f.csv", overrides={"measure.zoi": 48})
    wanted = CampaignRequest(
        [job], tmp_path, 1, config="all.toml", overrides={"measure.zoi": 32, "measure.step": 8}, start_s=1.0,
        end_s=2.0, as_measured=True, chunk_s=9.0,
    )  # fmt: skip
    task = _task(wanted, job)
    assert task.config == str(Path("own.toml").absolute()) and task.forces == str(Path("f.csv").absolute())
    assert task.overrides == {"measure.zoi": 48, "measure.step": 8} and task.reference is None
    assert (task.start_s, task.end_s, task.as_measured, task.chunk_s) == (1.0, 2.0, True, 9.0)
    assert _task(wanted, BatchJob("b", "b.h5")).config == str(Path("all.toml").absolute())


def test_those_that_cannot_be_cut_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    plans = {"a": ChunkPlan(why="pictures are not cut"), "b": ChunkPlan()}
    monkeypatch.setattr(module, "cut", lambda task: plans[task.name])
    screen = RecordingScreen()
    tasks = [Task(name, "", name, chunk_s=None if name == "c" else 9.0) for name in "abc"]
    assert module._cuts(tasks, screen) == plans
    assert screen.lines == ["a: done whole: pictures are not cut"]


def test_a_table_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "summary.csv"
    path.mkdir()
    (path / "inside").touch()
    with pytest.raises(DataError, match=r"summary\.csv"):
        write_summary([], tmp_path)
    assert list(tmp_path.iterdir()) == [path], "no part is left"
    (tmp_path / "other").mkdir()
    written = write_summary([], tmp_path / "other")
    assert written[0].read_bytes() == as_csv([])


def test_no_cell_is_a_formula() -> None:
    assert [_cell(value) for value in ("=1+1", "+a", "-@b", "\tc", "d=1", None, -2.5, 0)] == [
        "1+1", "a", "b", "c", "d=1", "", -2.5, 0,
    ]  # fmt: skip
    assert as_csv([]).decode().splitlines() == [",".join(COLUMNS)]


def test_pictures_are_those_of_a_folder_a_file_or_a_glob_in_order(tmp_path: Path) -> None:
    for name in ("b.png", "a.png", "c.tif"):
        (tmp_path / name).write_bytes(b"x" * len(name))
    (tmp_path / "folder").mkdir()
    assert [path.name for path in _pictures(tmp_path)] == ["a.png", "b.png", "c.tif"]
    assert [path.name for path in _pictures(tmp_path / "c.tif")] == ["c.tif"]
    assert [path.name for path in _pictures(tmp_path / "*.png")] == ["a.png", "b.png"]
    settings, stamps = _of_source(f"files:{tmp_path}/*.png?gray=luma")
    assert settings == {"gray": "luma"}
    about = (tmp_path / "a.png").stat()
    assert stamps[0] == ["a.png", 5, about.st_mtime_ns]
    os.utime(tmp_path / "a.png", (1, 1))
    assert _of_source(f"files:{tmp_path}/*.png?gray=luma")[1] != stamps


class Dying:
    """Worker processes that die over tasks of this name, and do all others."""

    def __init__(self, name: str) -> None:
        self.name, self.tried, self.ended, self.taken = name, list[str](), 0, 0
        self.given_back = 0

    def take(self) -> Any:
        self.taken += 1
        return self

    def perform(self, task: Task, on_progress: Any) -> BatchRow | None:
        self.tried.append(task.name)
        on_progress(task, None)
        if task.name == self.name:
            return None
        return BatchRow.of({"test": task.name, "outcome": "done", "exit_code": 0})

    def give_back(self, worker: Any) -> None:
        self.given_back += 1

    def end(self) -> None:
        self.ended += 1

    kill = end

    def why(self) -> str:
        return "signal 9"


def test_a_task_whose_worker_dies_is_tried_three_times_after_all_others() -> None:
    processes, rows = Dying("a"), dict[str, BatchRow]()
    later = Task("z", "", "z")

    def done(task: Task, row: BatchRow) -> list[Task]:
        rows[task.name] = row
        return [later] if task.name == "b" else []

    tasks = [Task(name, "", name) for name in "abc"]
    scheduler = SimpleNamespace(first=lambda: tasks, on_done=done)
    with closing(Pool(1, lambda task, progress: None, processes)) as pool:  # type: ignore[arg-type]
        for _ in perform_all(scheduler, pool, 0.05):  # type: ignore[arg-type]
            pass
    assert processes.tried == ["a", "b", "z", "c", "a", "a"]
    assert (processes.taken - processes.given_back, processes.ended) == (3, 3), "a new one after each death"
    assert (
        rows["a"].values["error"]
        == "its worker died 3 times (signal 9); is there memory enough for --workers?"
    )
    assert rows["z"].is_well and rows["a"].values["exit_code"] == 1
