"""``python -m tests.bench.campaign``: what workers bring, what each of them takes, and what empty tasks cost.

One session of 1280 x 1024 px (12 bit, 240 bursts of two) under four names is replayed by one worker and by two, and
in chunks; the memory is the most that the kernel of the system saw of a worker. ``--empty N`` gives N tasks that are
done already to two workers of the pool, and to two of a Dask cluster. ``--json`` prints one JSON object.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from live.cli import main as phasedic
from live.replay.batch.cluster import Cluster
from live.replay.batch.row import BatchRow, failed
from live.replay.batch.scheduler import BatchProgress, perform_all
from live.replay.batch.task import Task
from live.replay.batch.worker import Pool, WorkerProcesses
from live.ui.terminal.screen import TerminalScreen
from tests.bench import machine
from tests.bench.soak import children, status
from tests.live.replay.batch.running import running

assert sys.platform != "win32"  # no getrusage there
SESSIONS = 4
CAMERA = "sim:hole?lockstep=yes&fps=20&width=1280&height=1024&bits=12"
RUN = ["--load", "sim:", "--burst", "2", "--reference-burst", "8", "--no-view", "--no-rrd", "--roi", "all"]
LOOK_S = 0.05


def recorded(folder: Path, seconds: float) -> Path:
    """The session, under ``SESSIONS`` names."""
    with contextlib.redirect_stdout(sys.stderr):
        first = folder / "1"
        assert phasedic(["run", "--camera", f"{CAMERA}&seconds={seconds:g}", *RUN, "--out", str(first)]) == 0
    for number in range(2, SESSIONS + 1):
        (folder / str(number)).mkdir()
        os.link(first / "session.h5", folder / str(number) / "session.h5")
    return first / "session.h5"


def peak_MB(pid: int) -> float:
    """The most memory that process ever held."""
    lines = [line for line in status(pid) if line.startswith("VmHWM")]
    return int(lines[0].split()[1]) / 1024 if lines else 0.0


def replayed(out: Path, *words: object) -> dict[str, Any]:
    """``phasedic batch`` with ``words``: seconds, CPU seconds, the one over the other, MB of the largest worker."""
    command = [sys.executable, "-m", "live.cli", "batch", *map(str, words), "--out", str(out)]
    before, began, most = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter(), 0.0
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    while process.poll() is None:
        most = max([most, *(peak_MB(pid) for pid in children(process.pid))])
        time.sleep(LOOK_S)
    took, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    assert process.returncode == 0, f"exit code {process.returncode}"
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {
        "s": round(took, 2), "CPU s": round(cpu, 2), "cores busy": round(cpu / took, 2), "MB a worker": round(most),
    }  # fmt: skip


def speed(folder: Path, seconds: float) -> list[dict[str, Any]]:
    session = recorded(folder, seconds)
    every = folder / "[1-9]" / "session.h5"
    replayed(folder / "warm", session, "--workers", 1)
    one = replayed(folder / "one", every, "--workers", 1)
    two = replayed(folder / "two", every, "--workers", 2)
    alone = replayed(folder / "alone", session, "--workers", 1)
    cut = replayed(folder / "cut", session, "--workers", 2, "--chunk", seconds / 2)
    return [
        {"case": f"{SESSIONS} sessions of {session.stat().st_size / 1e6:.0f} MB, one worker"} | one,
        {"case": "two workers"} | two | {"faster": round(one["s"] / two["s"], 2)},
        {"case": "one session, one worker"} | alone,
        {"case": "in two chunks, two workers"} | cut
        | {"faster": round(alone["s"] / cut["s"], 2), "CPU over": round(cut["CPU s"] / alone["CPU s"], 2)},
    ]  # fmt: skip


# -- empty tasks --------------------------------------------------------------------------------


def empty(folder: Path, count: int) -> list[dict[str, Any]]:
    """Tasks that are done already, which a worker finds by their ``batch.json``."""
    tasks = [Task(f"{number:05d}", str(folder), "nothing.h5", key="key") for number in range(count)]
    for task in tasks:
        task.folder.mkdir()
        row = failed(task.name, task.source, "", 0).values
        (task.folder / "batch.json").write_text(json.dumps({"key": task.key, "row": row}), encoding="utf-8")
    with contextlib.closing(WorkerProcesses(0)) as on_start:
        found = [_emptied("pool", tasks, lambda told: Pool(2, told, on_start))]
    with running(folder) as cluster:
        screen = TerminalScreen(quiet=True)
        made = _emptied("Dask", tasks, lambda told: Cluster(cluster.address, folder, told, screen))
        found.append(made | {"MB scheduler": round(peak_MB(cluster.scheduler.pid))})
    return found


def _emptied(name: str, tasks: list[Task], start: Callable[..., Pool | Cluster]) -> dict[str, Any]:
    done: list[str] = []
    standing, first = BatchProgress(len(tasks), time.monotonic), 0.0
    began = time.perf_counter()

    def ended(task: Task, row: BatchRow) -> tuple[Task, ...]:
        nonlocal first
        first = first or time.perf_counter() - began
        done.append(task.name)
        return ()

    plan: Any = SimpleNamespace(first=lambda: tasks, on_done=ended)
    with contextlib.closing(start(lambda task, progress: standing.update(task.title, progress))) as workers:
        for _ in perform_all(plan, workers, LOOK_S):
            pass
        took = time.perf_counter() - began
    assert len(done) == len(tasks)
    return {
        "case": f"{len(tasks)} empty tasks, {name}", "s": round(took, 2), "first after s": round(first, 2),
        "ms a task": round(1e3 * (took - first) / len(tasks), 3), "MB caller": round(peak_MB(os.getpid())),
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.campaign", description=__doc__)
    parser.add_argument(
        "--seconds", type=float, default=24.5, help="of the session (default 24.5: 240 bursts)"
    )
    parser.add_argument("--empty", type=int, metavar="N", help="N empty tasks instead")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of lines")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = empty(Path(folder), options.empty) if options.empty else speed(Path(folder), options.seconds)
    about = {"machine": machine.describe(), "date": f"{datetime.now(UTC):%Y-%m-%d}"}
    if options.json:
        print(json.dumps(about | {"rows": rows}, indent=1))
        return
    print(f"{about['machine']}; {about['date']}")
    for row in rows:
        print("  ".join(f"{value}" if name == "case" else f"{name} {value}" for name, value in row.items()))


if __name__ == "__main__":
    main()
