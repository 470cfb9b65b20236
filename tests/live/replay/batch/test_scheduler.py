"""The chunks of a long session, the order of tasks, and the progress in words; no session is measured."""

from __future__ import annotations

import dataclasses
import os
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.errors import DataError
from live.replay.batch import scheduler as module
from live.replay.batch.row import BatchRow, failed, row_of_chunk
from live.replay.batch.scheduler import (
    BatchProgress,
    ChunkPlan,
    Scheduler,
    _edges,
    cut,
    join_task,
    sweep_chunks,
)
from live.replay.batch.task import FIELDS_FILE, Task, TaskProgress, _host, staging_dir
from live.replay.batch.test_list import key_of_chunk
from tests.live.screens import RecordingScreen


def edges(times: Any, seconds: float) -> list[int]:
    return list(_edges(np.asarray(times, np.float64), seconds))


def test_a_chunk_begins_with_the_first_burst_of_its_time_counted_from_the_first_one() -> None:
    assert edges(5.0 + np.arange(400) / 10, 12.0) == [120, 240]  # the rest of 40 would be too short
    assert edges(5.0 + np.arange(460) / 10, 12.0) == [120, 240, 360]
    assert edges(np.arange(400) / 10, 40.0) == []


@pytest.mark.parametrize(("count", "expected"), [(199, []), (200, [100]), (299, [100]), (300, [100, 200])])
def test_no_chunk_is_shorter_than_a_hundred_bursts(count: int, expected: list[int]) -> None:
    assert edges(np.arange(count) / 10, 10.0) == expected
    assert edges(np.arange(count) / 10, 1.0) == expected, "chunks that would be shorter are longer"


def test_a_pause_in_the_session_makes_no_chunk_of_its_own() -> None:
    times = np.r_[np.arange(150) / 10, 100 + np.arange(250) / 10]
    assert edges(times, 20.0) == [150]


TASK = Task("long", "/out", "session:/data/long/session.h5", chunk_s=10.0, key="k" * 64)


@pytest.fixture
def session(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """A session with these times of its bursts."""
    given: dict[str, Any] = {"times": np.arange(310) / 10}

    @contextmanager
    def open_source(request: Any) -> Any:
        if isinstance(given["times"], str):
            raise DataError("broken")
        yield SimpleNamespace(times=given["times"]), None

    monkeypatch.setattr(module, "open_source", open_source)
    return given


def test_each_chunk_measures_twenty_bursts_before_it_that_are_not_kept(session: dict[str, Any]) -> None:
    found = cut(TASK)
    assert [(chunk.name, chunk.numbers, chunk.run_in) for chunk in found.chunks] == [
        ("0000", (0, 100), 0), ("0001", (80, 200), 20), ("0002", (180, 310), 20),
    ]  # fmt: skip
    for chunk in found.chunks:
        assert (chunk.of, chunk.source, chunk.title) == ("long", TASK.source, f"long#{chunk.name}")
        assert chunk.folder == Path(f"/out/.long.{'k' * 12}.chunks") / chunk.name
        assert chunk.key == key_of_chunk(dataclasses.replace(chunk, key=TASK.key)) != TASK.key
    joined = join_task(TASK, found)
    assert joined.request(Path("/x")).parts == [chunk.folder / FIELDS_FILE for chunk in found.chunks]
    assert (joined.key, joined.numbers, joined.title) == (TASK.key, None, "long")
    request = found.chunks[1].request(Path("/x"))
    assert request.numbers == range(80, 200) and request.parts == []


def test_a_chunk_that_begins_early_has_a_shorter_run_in(
    session: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MIN_CHUNK", 5)
    session["times"] = np.arange(20) / 10
    found = cut(dataclasses.replace(TASK, chunk_s=0.5))
    assert [(chunk.numbers, chunk.run_in) for chunk in found.chunks] == [
        ((0, 5), 0), ((0, 10), 5), ((0, 15), 10), ((0, 20), 15),
    ]  # fmt: skip


def test_what_is_not_cut(session: dict[str, Any]) -> None:
    assert cut(dataclasses.replace(TASK, source="files:/data/*.png")) == ChunkPlan(why="pictures are not cut")
    for times in (np.arange(199) / 10, None, "broken"):
        session["times"] = times
        assert cut(TASK) == ChunkPlan()


def done(name: str) -> BatchRow:
    return BatchRow.of({"test": name, "outcome": "done", "exit_code": 0})


class Plan:
    """A long test in three chunks and a short one."""

    def __init__(self) -> None:
        self.short = Task("short", "/out", "session:/data/short/session.h5")
        chunks = [dataclasses.replace(TASK, name=f"{k:04d}", of="long", numbers=(k, k + 1)) for k in range(3)]
        self.now, self.rows, self.screen = 100.0, dict[str, BatchRow](), RecordingScreen()
        self.progress = BatchProgress(2, lambda: self.now)
        cuts = {"long": ChunkPlan(tuple(chunks)), "short": ChunkPlan(why="pictures are not cut")}
        self.scheduler = Scheduler([TASK, self.short], cuts, self.rows, self.progress, self.screen)
        self.chunks = chunks


def test_the_chunks_come_first_and_the_join_when_all_are_done() -> None:
    plan = Plan()
    assert plan.scheduler.first() == [*plan.chunks, plan.short]
    for k in (2, 0):
        assert plan.scheduler.on_done(plan.chunks[k], row_of_chunk("c", "s", True, 1.0)) == ()
    (join,) = plan.scheduler.on_done(plan.chunks[1], row_of_chunk("c", "s", True, 1.0))
    assert join.name == "long" and [Path(chunk).name for chunk in join.chunks] == ["0000", "0001", "0002"]
    assert not plan.rows
    assert plan.scheduler.on_done(join, done("long")) == ()
    assert plan.rows == {"long": plan.rows["long"]} and plan.rows["long"].is_well and plan.screen.lines == []


def test_a_chunk_that_fails_fails_its_test_once() -> None:
    plan = Plan()
    plan.scheduler.first()
    assert plan.scheduler.on_done(plan.chunks[1], failed("long#0001", "s", "no pattern", 4)) == ()
    assert plan.scheduler.on_done(plan.chunks[0], failed("long#0000", "s", "another", 3)) == ()
    assert plan.scheduler.on_done(plan.chunks[2], row_of_chunk("c", "s", True, 1.0)) == ()
    values = plan.rows["long"].values
    assert (values["test"], values["outcome"], values["error"], values["exit_code"]) == (
        "long", "failed", "no pattern", 4,
    )  # fmt: skip
    assert plan.screen.lines == ["long: failed: no pattern"]
    assert plan.progress.words().startswith("1 of 2 tests")


def test_where_a_reference_was_renewed_the_test_is_measured_whole() -> None:
    plan = Plan()
    plan.scheduler.first()
    assert plan.scheduler.on_done(plan.chunks[0], row_of_chunk("c", "s", False, 1.0)) == [TASK]
    assert plan.scheduler.on_done(plan.chunks[1], row_of_chunk("c", "s", False, 1.0)) == ()
    assert plan.scheduler.on_done(plan.chunks[2], row_of_chunk("c", "s", True, 1.0)) == ()
    assert plan.screen.lines == ["long: a reference was renewed in it; it is not cut, but measured whole"]
    plan.now = 110.0
    plan.scheduler.on_progress(TASK, TaskProgress(50, 100, 0))
    assert plan.progress.words().endswith("0:30 left"), "a quarter of all: chunks count no more"


def test_progress_is_the_share_of_all_tests_with_the_time_that_is_left() -> None:
    plan = Plan()
    plan.scheduler.first()
    assert plan.progress.words() == "0 of 2 tests  0 instants"
    plan.now = 110.0
    assert plan.progress.words() == "0 of 2 tests  0 instants  0 ZOI/s"
    plan.scheduler.on_progress(plan.chunks[0], TaskProgress(60, 120, 6000))
    plan.scheduler.on_progress(plan.short, TaskProgress(30, 120, 3000))
    # Of the long one a half of a third, of the short one a quarter: 5/24 of both, after 10 s.
    assert plan.progress.words() == "0 of 2 tests  90 instants  900 ZOI/s  0:38 left"
    plan.scheduler.on_done(plan.chunks[0], row_of_chunk("c", "s", True, 1.0))
    plan.scheduler.on_done(plan.short, done("short"))
    # A third and all: 2/3 of both.
    assert plan.progress.words() == "1 of 2 tests  90 instants  900 ZOI/s  0:05 left"
    plan.scheduler.on_progress(plan.chunks[1], TaskProgress(300, 120, 0))
    plan.scheduler.on_progress(plan.chunks[2], TaskProgress(5, None, 0))
    assert plan.progress.words().endswith("  0:02 left"), (
        "no more than all of it; of an unknown length nothing"
    )


def test_a_join_reports_no_progress_of_its_own() -> None:
    plan = Plan()
    plan.scheduler.first()
    plan.scheduler.on_progress(dataclasses.replace(TASK, chunks=["a", "b"]), TaskProgress(300, 300, 9000))
    assert plan.progress.words() == "0 of 2 tests  0 instants"


def test_chunks_are_removed_with_their_test_or_where_settings_are_others(tmp_path: Path) -> None:
    task = dataclasses.replace(TASK, out=str(tmp_path))
    mine, old = tmp_path / f".long.{'k' * 12}.chunks", tmp_path / f".long.{'o' * 12}.chunks"
    other, finished = tmp_path / f".other.{'k' * 12}.chunks", tmp_path / f".a.b.{'k' * 12}.chunks"
    for folder in (mine, old, other, finished):
        folder.mkdir()
    sweep_chunks(tmp_path, {"a.b"}, {"long": task})
    assert sorted(path for path in tmp_path.iterdir()) == sorted([mine, other])


def test_chunks_that_another_process_works_on_are_left(tmp_path: Path) -> None:
    task = dataclasses.replace(TASK, out=str(tmp_path))
    outdated, finished = tmp_path / f".long.{'o' * 12}.chunks", tmp_path / f".a.b.{'k' * 12}.chunks"
    working = staging_dir(outdated / "0001").with_name(f".0001.{_host()}.{os.getppid()}.part")
    elsewhere = finished / ".0001.another-host.1.part"
    ended = staging_dir(outdated / "0002").with_name(f".0002.{_host()}.{2**22 + 1}.part")
    for folder in (working, elsewhere, ended):
        folder.mkdir(parents=True)
    sweep_chunks(tmp_path, {"a.b"}, {"long": task})
    assert working.is_dir() and elsewhere.is_dir(), "of a process of this machine, and of another machine"
    working.rmdir()
    sweep_chunks(tmp_path, {"a.b"}, {"long": task})
    assert not outdated.exists() and elsewhere.is_dir()
