"""``phasedic batch --scheduler``: a Dask cluster of real processes on loopback."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from acquire.errors import ConfigError
from live.cli import main
from live.replay.batch import cluster
from live.replay.batch.worker import NEEDED
from live.results import Strain
from tests.live.replay.batch.conftest import SETTINGS
from tests.live.replay.batch.running import (
    HERE,
    ONE_THREAD,
    Running,
    dask,
    differing,
    is_gone,
    parts,
    pid_of,
    rows,
    running,
    started,
)
from tests.live.ui.waiting import until

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def progress(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    with running(tmp_path_factory.mktemp("dask")) as made:
        yield made


def listening(pid: int) -> set[str]:
    """Local addresses, hexadecimal, at which a process takes connections."""
    fds = Path(f"/proc/{pid}/fd")
    inodes = {link.split("[")[1][:-1] for fd in fds.iterdir() if (link := read(fd)).startswith("socket:[")}
    found = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/{pid}/net/{table}").read_text(encoding="ascii").splitlines()[1:]:
            words = line.split()
            if words[3] == "0A" and words[9] in inodes:
                found.add(words[1].rpartition(":")[0])
    return found


def read(fd: Path) -> str:
    try:
        return str(fd.readlink())
    except OSError:
        return ""


LOOPBACK = {"0100007F"}


@pytest.mark.skipif(sys.platform != "linux", reason="listens to /proc")
def test_twelve_tests_as_by_the_pool(runs: Path, done: Path, progress: Running, tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = (runs / "*" / "session.h5", *SETTINGS, "--scheduler", progress.address, "--out", out)
    caller = started(*words)
    until(lambda: bool(parts(out)))
    assert {pid_of(part) for part in parts(out)} <= set(progress.pids)
    assert listening(progress.scheduler.pid) == LOOPBACK
    assert all(listening(worker.pid) == LOOPBACK for worker in progress.workers)
    assert listening(caller.pid) <= LOOPBACK
    assert caller.wait(120) == 0
    names = [row["test"] for row in rows(out)]
    assert len(names) == 12
    for name in names:
        assert not differing(out / name / "strain.h5", done / name / "strain.h5")
    mine, pools = (
        [{k: v for k, v in row.items() if k != "seconds"} for row in rows(at)] for at in (out, done)
    )
    assert mine == pools
    assert sorted(path.name for path in out.glob(".*")) == []


def test_a_long_one_in_chunks(
    long: Path,
    progress: Running,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Also with a scheduler that is given no more than two tasks at a time."""
    monkeypatch.setattr(cluster, "_MIN_QUEUED", 2)
    monkeypatch.setattr(cluster, "_PER_WORKER", 1)
    words = ["batch", str(long), "--zoi", "48", "--step", "16", "--chunk", "10", "--out"]
    assert main([*words, str(tmp_path / "there"), "--scheduler", progress.address]) == 0
    told = capsys.readouterr().out
    assert re.search(r"1 of 1 tests  [1-9]\d* instants  [\d,]+ ZOI/s", told)  # as the workers told
    assert main([*words, str(tmp_path / "here"), "--workers", "2"]) == 0
    with (
        Strain.open(tmp_path / "there" / "long" / "strain.h5") as one,
        Strain.open(tmp_path / "here" / "long" / "strain.h5") as other,
    ):
        np.testing.assert_array_equal(one.maps("eyy"), other.maps("eyy"))
    assert "joined of 3 chunks" in (tmp_path / "there" / "long" / "replay.txt").read_text(encoding="utf-8")


def test_a_caller_that_is_killed(
    runs: Path, progress: Running, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    words = (runs / "*" / "session.h5", *SETTINGS, "--scheduler", progress.address, "--out", out)
    caller = started(*words)
    until(lambda: bool(parts(out)))
    caller.kill()
    caller.wait()
    assert not (out / "summary.csv").exists()
    until(lambda: not parts(out))  # what had begun is ended by its worker
    whole = [folder for folder in out.iterdir() if not folder.name.startswith(".")]
    assert all((folder / "batch.json").exists() for folder in whole)
    assert len(whole) < 12
    assert main(["batch", *map(str, words)]) == 0
    assert f"12 tests: {len(whole)} done before" in capsys.readouterr().out
    assert [row["outcome"] for row in rows(out)] == ["done"] * 12
    assert not list(out.glob(".*"))


def test_a_worker_and_then_the_scheduler_are_killed(
    runs: Path, done: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    with running(tmp_path) as made:
        words = (runs / "*" / "session.h5", *SETTINGS, "--scheduler", made.address, "--out", out)
        caller = started(*words)
        until(lambda: bool(parts(out)))
        killed = pid_of(parts(out)[0])
        os.kill(killed, signal.SIGKILL)
        before = len(list(out.glob("*/batch.json")))
        until(lambda: len(list(out.glob("*/batch.json"))) >= before + 3)  # the other one goes on
        made.scheduler.kill()
        assert caller.wait(60) == 4
        assert "the scheduler has ended" in capfd.readouterr().err
        left = [worker for worker in made.workers if worker.pid != killed]
        until(lambda: not any(not is_gone(pid_of(part)) for part in parts(out)) or left[0].poll() is not None)
    assert not (out / "summary.csv").exists()
    whole = [folder for folder in out.iterdir() if not folder.name.startswith(".")]
    assert all((folder / "batch.json").exists() for folder in whole)
    words = (runs / "*" / "session.h5", *SETTINGS, "--workers", "2", "--out", out)
    assert main(["batch", *map(str, words)]) == 0
    assert [row["outcome"] for row in rows(out)] == ["done"] * 12
    assert not list(out.glob(".*"))
    for name in ("hole-1", "woven-4"):
        assert not differing(out / name / "strain.h5", done / name / "strain.h5")


def test_workers_of_another_kind(runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["batch", str(runs / "hole-1" / "session.h5"), "--out", str(tmp_path / "out"), "--scheduler"]
    with running(tmp_path, 0) as made:
        assert main([*words, made.address]) == 2
        assert "has no workers; start some with 'dask worker tcp://127.0.0.1:" in capsys.readouterr().err
        two = ["--no-nanny", "--nthreads", 2, *HERE, "--local-directory", tmp_path]
        with two_at_once(dask("worker", made.address, *two, **dict.fromkeys(NEEDED, "2"))):
            until(lambda: main([*words, made.address]) == 2 and "2 tasks at once" in capsys.readouterr().err)
    assert not (tmp_path / "out" / "hole-1").exists()
    assert not list((tmp_path / "out").glob(".*"))


@contextmanager
def two_at_once(worker: subprocess.Popen[bytes]) -> Iterator[None]:
    try:
        yield
    finally:
        worker.kill()
        worker.wait()


def test_nobody_is_there(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "_CONNECT_S", 1)
    words = ["batch", str(runs / "hole-1" / "session.h5"), "--out", str(tmp_path / "out"), "--scheduler"]
    assert main([*words, "tcp://127.0.0.1:9"]) == 2
    assert "nothing answers there" in capsys.readouterr().err
    assert main([*words, "tls://127.0.0.1:9"]) == 2
    assert "no certificate is known here" in capsys.readouterr().err
    assert main([*words, "nonsense://1"]) == 2
    assert "give tcp://HOST:PORT" in capsys.readouterr().err


ELSEWHERE = """
import live
live.VERSION = "0.0.1"
"""
"""As ``sitecustomize``: a machine that has another version of phasedic installed."""


def test_a_worker_with_another_version_is_refused(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "sitecustomize.py").write_text(ELSEWHERE, encoding="utf-8")
    paths = os.pathsep.join([str(tmp_path / "elsewhere"), os.environ.get("PYTHONPATH", "")])
    words = ["batch", str(runs / "hole-1" / "session.h5"), "--out", str(tmp_path / "out"), "--scheduler"]
    with running(tmp_path, 1, **ONE_THREAD, PYTHONPATH=paths) as made:
        assert main([*words, made.address]) == 2
    said = capsys.readouterr().err
    assert "has phasedic 0.0.1, here it is" in said
    assert "install the same there" in said
    assert not list((tmp_path / "out").iterdir())


@pytest.mark.parametrize(("late", "reached"), [(2, True), (3, False)])
def test_on_a_busy_machine_dask_is_started_again(
    late: int, reached: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Dask gives up, with an AssertionError, when its own thread has not begun after ten seconds."""
    client, tries = object(), list[str]()

    def begin(address: str, **_options: object) -> object:
        tries.append(address)
        assert len(tries) > late
        return client

    monkeypatch.setattr("distributed.Client", begin)
    if reached:
        assert cluster._connected("tcp://127.0.0.1:9") is client
    else:
        with pytest.raises(ConfigError, match="too busy, try again"):
            cluster._connected("tcp://127.0.0.1:9")
    assert len(tries) == 3
