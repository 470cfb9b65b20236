"""Tasks on a cluster without Dask: what is submitted, taken, given up and told."""

from __future__ import annotations

import json
import socket
from concurrent.futures import CancelledError
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.errors import ConfigError, DataError
from live.replay.batch import cluster
from live.replay.batch.cluster import Cluster, advice, check, check_scheduler
from live.replay.batch.row import BatchRow
from live.replay.batch.scheduler import perform_all
from live.replay.batch.task import ROW_FILE, Task, TaskProgress
from live.replay.batch.test_list import deciding_versions
from live.replay.batch.worker import NEEDED, compile_on_worker
from tests.live.screens import RecordingScreen


class Future:
    """One task of the fake client."""

    def __init__(self, client: Client, key: str, line: str) -> None:
        self.client, self.key, self.task, self.status = client, key, Task.from_json(line), "pending"
        self.error: Exception | None = None
        self._done: list[Any] = []

    def add_done_callback(self, call: Any) -> None:
        self._done.append(call)

    def exception(self) -> Exception | None:
        return self.error

    def result(self) -> dict[str, Any]:
        if self.client.lost:
            raise OSError("lost")
        return {"test": self.task.name, "outcome": "done", "exit_code": 0}

    def end(self, status: str = "finished", error: Exception | None = None) -> None:
        self.status, self.error = status, error
        for call in self._done:
            call(self)


class Client:
    """In place of Dask's client; ``answers`` are of its workers."""

    def __init__(self, answers: dict[str, Any]) -> None:
        self.answers, self.status, self.futures = answers, "running", list[Future]()
        self.compiled, self.cancelled, self.closed, self.lost = list[Any](), list[Any](), 0, False
        self.threads: dict[str, int] = {"w": 1}

    def run(self, function: Any, token: str) -> dict[str, Any]:
        assert Path(token).exists(), "the token is there while the workers are asked"
        if isinstance(self.answers, Exception):
            raise self.answers
        return self.answers

    def submit(self, function: Any, *given: Any, pure: bool, **more: Any) -> Any:
        if function is compile_on_worker:
            self.compiled.append((more["workers"], pure))
            return more["workers"][0]
        self.more = more | {"given": given[1:], "pure": pure}
        self.futures.append(Future(self, more["key"], given[0]))
        return self.futures[-1]

    def gather(self, futures: list[Any], errors: str) -> list[Any]:
        return futures

    def subscribe_topic(self, topic: str, call: Any) -> None:
        self.event = call

    def nthreads(self) -> dict[str, int]:
        return self.threads

    def cancel(self, futures: list[Any], *, force: bool) -> None:
        self.cancelled += [(one.key, force) for one in futures]

    def close(self, timeout: float = 0.0) -> None:
        self.closed += 1


def answer(host: str = "a", **more: Any) -> dict[str, Any]:
    return {
        "host": host, "versions": dict(deciding_versions()), "slots": 1, "has_token": True,
        "threads": dict.fromkeys(NEEDED, "1"), **more,
    }  # fmt: skip


class Running:
    """A cluster with these tasks and workers."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, out: Path, names: str, **answers: Any) -> None:
        self.client = Client(answers or {"one": answer()})
        self.rows: dict[str, BatchRow] = {}
        self.screen, self.progress, self.then = (
            RecordingScreen(),
            list[tuple[str, TaskProgress]](),
            dict[str, list[Task]](),
        )
        monkeypatch.setattr(cluster, "_connected", lambda address: self.client)
        self.tasks = [Task(name, str(out), f"/data/{name}.h5", key=f"key-{name}") for name in names]
        self.cluster = Cluster(
            "tcp://here:1",
            out,
            lambda task, progress: self.progress.append((task.name, progress)),
            self.screen,
        )
        plan = SimpleNamespace(first=lambda: self.tasks, on_done=self._done)
        self._loop = perform_all(plan, self.cluster, 0.0)  # type: ignore[arg-type]
        self.go_on()

    def go_on(self) -> bool:
        """Take what has ended and submit what there is room for; whether all is done."""
        next(self._loop, None)
        next(self._loop, None)
        return self.rows.keys() >= {task.name for task in self.tasks}

    def _done(self, task: Task, row: BatchRow) -> list[Task]:
        self.rows[task.name] = row
        return self.then.get(task.name, [])

    def names(self) -> str:
        return "".join(one.task.name for one in self.client.futures)


def test_tasks_are_submitted_with_their_keys_and_their_rows_taken(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    bench = Running(monkeypatch, tmp_path, "ab")
    assert list(tmp_path.iterdir()) == [], "the token is gone"
    assert [one.key for one in bench.client.futures] == [f"{tmp_path}/a-key-a", f"{tmp_path}/b-key-b"]
    assert bench.client.more["retries"] == 2 and bench.client.more["pure"] is False
    assert bench.client.more["given"] == (str(Path.cwd()), bench.cluster._topic)
    assert not bench.go_on()
    bench.client.futures[1].end()
    assert not bench.go_on() and list(bench.rows) == ["b"] and bench.rows["b"].is_well
    bench.client.event((0.0, ["a", 3, 9, 30]))
    bench.client.event((0.0, ["unknown", 3, 9, 30]))
    assert bench.progress == [("a", TaskProgress(3, 9, 30))]
    bench.client.futures[0].end()
    assert bench.go_on()
    bench.cluster.close()
    assert bench.client.cancelled == [] and bench.client.closed == 1


def test_what_follows_a_task_is_submitted_before_what_waits(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(cluster, "_MIN_QUEUED", 2)
    monkeypatch.setattr(cluster, "_PER_WORKER", 1)
    bench = Running(monkeypatch, tmp_path, "abcdef")
    assert bench.names() == "ab", "no more than two at once"
    bench.then["a"] = [Task("z", str(tmp_path), "/data/z.h5")]
    bench.client.futures[0].end()
    assert not bench.go_on()
    assert bench.names() == "abz"
    bench.client.futures[1].end()
    bench.client.futures[2].end()
    bench.go_on()
    assert bench.names() == "abzcd"


@pytest.mark.parametrize(("workers", "queued"), [(1, 200), (50, 200), (51, 204)])
def test_four_tasks_a_worker_are_queued_and_two_hundred_at_least(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, workers: int, queued: int
) -> None:
    answers = {f"w{k}": answer("a") for k in range(workers)}
    bench = Running(monkeypatch, tmp_path, "a", **answers)
    assert bench.cluster.at_once == queued
    assert bench.client.compiled == [([f"w{workers - 1}"], False)], "once on each machine"


def test_a_task_that_is_given_up_fails_with_why(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    bench = Running(monkeypatch, tmp_path, "abc")
    bench.client.futures[0].end("error", CancelledError("killed"))
    bench.client.futures[1].end("cancelled")
    (tmp_path / "c").mkdir()
    row = {"test": "c", "outcome": "done", "exit_code": 0}
    (tmp_path / "c" / ROW_FILE).write_text(json.dumps({"key": "key-c", "row": row}), encoding="utf-8")
    bench.client.futures[2].end("error", CancelledError("killed"))
    assert bench.go_on()
    assert [bench.rows[name].values["error"] for name in "abc"] == [
        "the cluster gave it up: CancelledError: killed",
        "the cluster gave it up: no result arrived (cancelled)",
        "",
    ]
    assert [bench.rows[name].values["exit_code"] for name in "abc"] == [1, 1, 0], "the last is on the disk"


def test_rows_that_do_not_come_are_read_from_the_disk(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    bench = Running(monkeypatch, tmp_path, "a")
    (tmp_path / "a").mkdir()
    row = {"test": "a", "outcome": "done", "exit_code": 0}
    (tmp_path / "a" / ROW_FILE).write_text(json.dumps({"key": "key-a", "row": row}), encoding="utf-8")
    bench.client.lost = True
    bench.client.futures[0].end()
    assert bench.go_on() and bench.rows["a"].is_well


def test_a_scheduler_that_is_away_for_five_seconds_has_ended(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    bench = Running(monkeypatch, tmp_path, "ab")
    bench.client.status = "connecting"
    bench.client.futures[0].end("error", CancelledError("killed"))
    for _ in range(5):
        bench.cluster.check(1.0)
        assert not bench.go_on()
    assert bench.rows == {}, "what is lost with the connection is no failure of a task"
    bench.client.status = "running"
    bench.cluster.check(1.0)
    bench.client.status = "connecting"
    for _ in range(5):
        bench.cluster.check(1.0)
    with pytest.raises(DataError, match="the scheduler has ended; complete tests are kept"):
        bench.cluster.check(0.1)
    bench.cluster.close()
    assert bench.client.cancelled == []


def test_where_nothing_ends_and_there_are_no_workers_a_note_comes_every_fifteen_seconds(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    bench = Running(monkeypatch, tmp_path, "ab")
    bench.client.threads = {}
    for _ in range(3):
        bench.cluster.check(5.0)
    assert bench.screen.lines == []
    bench.client.futures[0].end()
    bench.go_on()
    for _ in range(3):
        bench.cluster.check(5.0)
    assert bench.screen.lines == [], "counted anew since a task has ended"
    bench.cluster.check(0.1)
    note = "tcp://here:1 has no workers; waiting for some"
    assert bench.screen.lines == [note]
    for _ in range(4):
        bench.cluster.check(5.0)
    assert bench.screen.lines == [note] * 2
    bench.client.threads = {"w": 1}
    for _ in range(4):
        bench.cluster.check(5.0)
    assert len(bench.screen.lines) == 2
    bench.cluster.close()
    assert bench.client.cancelled == [(f"{tmp_path}/b-key-b", True)] and bench.client.closed == 1


def test_workers_that_do_not_fit_end_it_before_any_task(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    clients: list[Client] = []

    def connected(address: str) -> Client:
        clients.append(Client({"w": answer(slots=2)}))
        return clients[-1]

    monkeypatch.setattr(cluster, "_connected", connected)
    with pytest.raises(ConfigError, match="does 2 tasks at once"):
        Cluster("tcp://here:1", tmp_path, print, RecordingScreen())  # type: ignore[arg-type]
    assert clients[0].closed == 1 and clients[0].futures == [] and list(tmp_path.iterdir()) == []
    monkeypatch.setattr(cluster, "_connected", lambda address: Client(ValueError("x")))  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r"a worker cannot run phasedic \(ValueError: x\)"):
        Cluster("tcp://here:1", tmp_path, print, RecordingScreen())  # type: ignore[arg-type]


def test_what_is_asked_of_workers() -> None:
    with pytest.raises(ConfigError, match="has no workers"):
        check("tcp://here:1", {})
    check("tcp://here:1", {"w": answer()})
    with pytest.raises(ConfigError, match="does not find --out"):
        check("tcp://here:1", {"w": answer(), "v": answer(has_token=False)})
    older = answer()
    older["versions"]["numpy"] = "1.0\x1b[31m"
    with pytest.raises(ConfigError, match=r"worker w has numpy 1\.0[^\x1b]*, here it is"):
        check("tcp://here:1", {"w": older})
    del older["versions"]["numpy"]
    with pytest.raises(ConfigError, match="worker w has numpy not known"):
        check("tcp://here:1", {"w": older})
    many = answer(threads={**dict.fromkeys(NEEDED, "1"), NEEDED[1]: "4", NEEDED[2]: ""})
    (note,) = advice({"v": answer(), "w": many})
    assert note.startswith(
        f"note: 1 of 2 workers, such as w, were started without {NEEDED[1]}=1 {NEEDED[2]}=1;"
    )
    assert list(advice({"v": answer()})) == []


@pytest.mark.parametrize(
    "address", ["here:1", "http://here:1", "tcp://here", "tcp://here:123456", "tcp://a/b:1", " tcp://here:1", "tcp://:1"]
)  # fmt: skip
def test_what_is_no_address_of_a_scheduler(address: str) -> None:
    with pytest.raises(ConfigError, match="give tcp://HOST:PORT"):
        check_scheduler(address)


def test_a_scheduler_is_looked_for_where_no_certificate_is_needed() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        check_scheduler(f"tcp://127.0.0.1:{server.getsockname()[1]}")
        port = server.getsockname()[1]
    with pytest.raises(ConfigError, match="nothing answers there"):
        check_scheduler(f"tcp://127.0.0.1:{port}")
    check_scheduler(f"tls://127.0.0.1:{port}")
