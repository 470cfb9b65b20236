"""Workers: when they load their libraries, their tasks, what they tell."""

from __future__ import annotations

import io
import json
import queue
import sys
import threading
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.errors import ConfigError, DataError
from analysis import PICTURE_KINDS, warm_up
from live.replay.batch import campaign, worker
from live.replay.batch.campaign import CampaignRequest, run_campaign
from live.replay.batch.row import BatchRow, failed
from live.replay.batch.scheduler import perform_all
from live.replay.batch.task import Task, TaskProgress
from live.replay.batch.test_list import find_tests, longest_first
from live.replay.batch.worker import NEEDED, ONE_THREAD, Pool, WorkerProcess, WorkerProcesses, describe_worker
from live.ui.terminal.screen import TerminalScreen
from tests.live.replay.batch.running import is_gone
from tests.live.ui.waiting import LONG_S


class Counted(WorkerProcesses):
    """Remembers its processes, and which were taken."""

    made: list[Counted]

    def __init__(self, count: int) -> None:
        super().__init__(count)
        self.pids, self.taken = [worker.pid for worker in self._idle], list[int]()
        Counted.made.append(self)

    def take(self) -> object:
        worker = super().take()
        self.taken.append(worker.pid)
        return worker


def ignore(task: Task, progress: TaskProgress) -> None:
    pass


class Appended:
    """In place of a scheduler: these tasks, whose rows are kept."""

    def __init__(self, tasks: list[Task], rows: list[BatchRow]) -> None:
        self.first, self._rows = lambda: tasks, rows

    def on_done(self, task: Task, row: BatchRow) -> tuple[Task, ...]:
        self._rows.append(row)
        return ()


def performed(tasks: list[Task], pool: Pool, rows: list[BatchRow]) -> None:
    with closing(pool):
        for _ in perform_all(Appended(tasks, rows), pool, 0.05):  # type: ignore[arg-type]
            pass


@pytest.fixture(autouse=True)
def counted(monkeypatch: pytest.MonkeyPatch) -> None:
    Counted.made = []
    monkeypatch.setattr(campaign, "WorkerProcesses", Counted)


def wanted(tmp_path: Path, tests: int, **more: object) -> CampaignRequest:
    """Tests whose recordings are no recordings."""
    for number in range(tests):
        (tmp_path / f"{number}").mkdir()
        (tmp_path / f"{number}" / "session.h5").write_bytes(b"nothing of a session")
    found = find_tests([str(tmp_path / "[0-9]" / "session.h5")])
    return CampaignRequest(**{"tests": found, "out": tmp_path / "out", "workers": 2, **more})


def test_they_are_there_before_it_is_known_what_they_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    planned, before = campaign._planned, []

    def plan(asked: CampaignRequest) -> object:
        before.extend(Counted.made[0].pids)
        return planned(asked)

    monkeypatch.setattr(campaign, "_planned", plan)
    run_campaign(wanted(tmp_path, 3), TerminalScreen(quiet=True), threading.Event())
    (made,) = Counted.made
    assert len(before) == 2
    assert made.taken
    assert set(made.taken) <= set(before), "others were started"
    assert all(map(is_gone, before))


def test_those_that_nobody_needs_are_let_go_of(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "0").mkdir()  # of other settings
    with pytest.raises(ConfigError, match="nothing is overwritten"):
        run_campaign(wanted(tmp_path, 2), TerminalScreen(quiet=True), threading.Event())
    (made,) = Counted.made
    assert len(made.pids) == 1
    assert not made.taken
    assert all(map(is_gone, made.pids))


def test_a_cluster_needs_none(tmp_path: Path) -> None:
    with pytest.raises(ConfigError):
        run_campaign(
            wanted(tmp_path, 1, scheduler="tcp://127.0.0.1:9x"), TerminalScreen(quiet=True), threading.Event()
        )
    assert not any(processes.pids for processes in Counted.made)


def test_a_pool_starts_more_where_they_are_not_enough(tmp_path: Path) -> None:
    tasks = [Task(str(k), str(tmp_path), "nothing.h5", key="key") for k in range(2)]
    rows = []
    processes = Counted(1)
    performed(tasks, Pool(2, ignore, processes), rows)
    processes.close()
    assert [row.values["outcome"] for row in rows] == [failed("0", "", "", 1).values["outcome"]] * 2
    assert processes.pids[0] in processes.taken
    assert len(set(processes.taken)) == 2
    assert all(map(is_gone, processes.taken))


def test_what_is_not_compiled_is_compiled_by_the_caller(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Workers say what they find; only then are they given anything."""
    asked: list[tuple[object, int]] = []
    monkeypatch.setattr(WorkerProcess, "is_ready", lambda process: False)
    monkeypatch.setattr(
        campaign, "compile_ahead", lambda kinds, **more: asked.append((kinds, len(Counted.made[0].taken)))
    )
    run_campaign(wanted(tmp_path, 1), TerminalScreen(quiet=True), threading.Event())
    assert asked == [(PICTURE_KINDS, 0)]


def test_the_first_word_of_a_worker() -> None:
    warm_up()
    processes = WorkerProcesses(1)
    assert processes.are_ready()
    killed = processes.take()
    killed.end()
    assert not killed.is_ready()


def test_no_worker_can_be_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*words: object, **more: object) -> None:
        raise BlockingIOError(11, "Resource temporarily unavailable")

    asked = wanted(tmp_path, 1)
    monkeypatch.setattr("live.replay.batch.worker.subprocess.Popen", none)
    with pytest.raises(DataError, match=r"no process can be started .* end other programs"):
        run_campaign(asked, TerminalScreen(quiet=True), threading.Event())


def test_no_worker_can_be_started_any_more(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Each task is a row with its error."""

    class Empty(WorkerProcesses):
        def take(self) -> WorkerProcess:
            raise BlockingIOError("too many")

    rows: list[BatchRow] = []
    tasks = [Task(str(k), str(tmp_path), "nothing.h5", key="key") for k in range(3)]
    performed(tasks, Pool(2, ignore, Empty(0)), rows)
    assert len(rows) == 3
    assert all("3 died at once: it cannot be started" in str(row.values["error"]) for row in rows)
    assert "too many" in caplog.text


def test_the_longest_first(tmp_path: Path) -> None:
    for name, length in (("short", 10), ("long", 1000), ("cut", 400)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "session.h5").write_bytes(b"x" * length)
    (tmp_path / "cut" / "session.1.h5").write_bytes(b"x" * 800)  # where it was continued
    (tmp_path / "pictures").mkdir()
    sources = [tmp_path / name / "session.h5" for name in ("short", "long", "gone", "cut")]
    tasks = [Task(source.parent.name, "", str(source)) for source in sources]
    tasks.insert(0, Task("pictures", "", f"files:{tmp_path / 'pictures'}/*.tif"))
    assert [task.name for task in longest_first(tasks)] == ["cut", "long", "short", "pictures", "gone"]


def test_a_worker_describes_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in NEEDED:
        monkeypatch.setenv(name, "1")
    monkeypatch.delenv(NEEDED[0])
    of_dask = SimpleNamespace(state=SimpleNamespace(nthreads=3))
    found = describe_worker(str(tmp_path / "none"), of_dask)
    assert (found["slots"], found["has_token"]) == (3, False)
    assert list(found["threads"].values()) == ["", "1", "1"]
    (tmp_path / "token").touch()
    assert describe_worker(str(tmp_path / "token"))["slots"] == 1
    assert describe_worker(str(tmp_path / "token"))["has_token"]
    assert NEEDED == ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS") and len(ONE_THREAD) == 5


def test_a_worker_of_this_machine_answers_in_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = io.StringIO()
    worker._put_progress(answers, TaskProgress(3, None, 30))
    worker._put(answers, {"row": {"test": "a"}})
    assert [json.loads(line) for line in answers.getvalue().splitlines()] == [
        {"progress": {"done": 3, "expected": None, "zois": 30}}, {"row": {"test": "a"}},
    ]  # fmt: skip
    ended: list[tuple[int, int]] = []
    monkeypatch.setattr(sys, "stdin", io.StringIO("one\ntwo\n"))
    monkeypatch.setattr(
        worker, "os", SimpleNamespace(kill=lambda *given: ended.append(given), getpid=lambda: 7)
    )
    tasks: queue.Queue[str] = queue.Queue()
    worker._listen(tasks)
    assert [tasks.get_nowait(), tasks.get_nowait()] == ["one\n", "two\n"] and ended == [(7, 15)]


def test_a_worker_of_a_cluster_reports_its_progress_every_two_seconds(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    sent: list[Any] = []
    now = [100.0]
    me = SimpleNamespace(
        loop=SimpleNamespace(add_callback=lambda call, *given: sent.append(given)), log_event=None
    )
    monkeypatch.setitem(sys.modules, "distributed", SimpleNamespace(get_worker=lambda: me))
    monkeypatch.setattr(worker, "time", SimpleNamespace(monotonic=lambda: now[0]))

    def perform(task: Task, on_progress: Any) -> BatchRow:
        assert Path.cwd() == tmp_path
        for k in range(6):
            now[0] = 100.0 + k
            on_progress(TaskProgress(k, 9, 10 * k))
        me.loop = None
        now[0] = 200.0
        on_progress(TaskProgress(8, 9, 80))
        return BatchRow.of({"test": task.name, "exit_code": 0})

    monkeypatch.setattr(worker, "perform", perform)
    before = Path.cwd()
    line = Task("0001", str(tmp_path), "a.h5", of="a").to_json()
    found = worker.perform_on_worker(line, str(tmp_path), "topic")
    assert found["test"] == "0001" and Path.cwd() == before
    assert sent == [("topic", ["a#0001", k, 9, 10 * k]) for k in (0, 2, 4)]


DIES = """import os, sys
print("Traceback (most recent call last):", file=sys.stderr)
print("ImportError: libsomething.so.3: cannot open shared object file", file=sys.stderr)
print(file=sys.stderr)
sys.exit(1)"""


def dying(monkeypatch: pytest.MonkeyPatch, script: str) -> None:
    monkeypatch.setattr(
        "live.replay.batch.worker.python_command", lambda module: [sys.executable, "-c", script]
    )


@pytest.mark.parametrize("workers", [1, 4])
def test_where_every_worker_dies_at_once_it_stops_with_the_error_of_the_worker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], workers: int
) -> None:
    dying(monkeypatch, DIES)
    tasks = [Task(str(k), str(tmp_path), "nothing.h5", key="key") for k in range(12)]
    rows: list[BatchRow] = []
    processes = Counted(0)
    performed(tasks, Pool(workers, ignore, processes), rows)
    assert len(processes.taken) < 3 + workers, "those that had begun"
    assert sorted(int(str(row.values["test"])) for row in rows) == list(range(12))
    words = {str(row.values["error"]) for row in rows}
    assert words == {
        "no worker can work here, 3 died at once: ImportError: libsomething.so.3: cannot open shared object file"
    }
    assert capfd.readouterr().err.count("ImportError") == len(processes.taken), "it is passed on"


def test_how_a_worker_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    for script, why in (
        ("import os; os.kill(os.getpid(), 9)", "signal 9"),
        ("import os; os.write(2, b'no memory\\n'); os.kill(os.getpid(), 9)", "no memory; signal 9"),
        ("raise SystemExit(7)", "exit code 7"),
    ):  # fmt: skip
        dying(monkeypatch, script)
        worker = WorkerProcess()
        worker._process.wait(LONG_S)
        worker.end()
        assert worker.why() == why


def test_a_task_that_kills_its_worker_stops_no_others_once_one_was_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = """import json, os, sys
for line in sys.stdin:
    if json.loads(line)["name"] != "0": os.kill(os.getpid(), 9)
    print(json.dumps({"row": {"test": "0", "outcome": "measured"}}), flush=True)"""
    dying(monkeypatch, script)
    tasks = [Task(str(k), str(tmp_path), "nothing.h5", key="key") for k in range(3)]
    rows: list[BatchRow] = []
    processes = Counted(0)
    performed(tasks, Pool(1, ignore, processes), rows)
    processes.close()
    words = [str(row.values.get("error")) for row in rows[1:]]
    assert len(set(processes.taken)) == 6 and all(
        one == "its worker died 3 times (signal 9); is there memory enough for --workers?" for one in words
    )
