"""A campaign and a Dask cluster as processes, for the tests."""

from __future__ import annotations

import csv
import dataclasses
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from unittest.mock import patch

import h5py
import numpy as np

from live.replay.batch import cluster
from live.replay.batch.worker import NEEDED
from tests.live.ui.waiting import until

ROOT = Path(__file__).parents[4]


def rows(out: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((out / "summary.csv").read_text(encoding="utf-8").splitlines()))


def parts(out: Path) -> list[Path]:
    return [path for path in out.glob(".*.part") if path.is_dir()]


def datasets(path: Path) -> dict[str, np.ndarray]:
    found: dict[str, np.ndarray] = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, item: (
                found.update({name: np.asarray(item[()])}) if isinstance(item, h5py.Dataset) else None
            )
        )
    return found


def differing(one: Path, other: Path) -> set[str]:
    """Datasets that are not the same to the last bit, except settings, times and the number of threads."""
    first, second = datasets(one), datasets(other)
    assert len(first) > 20
    assert first.keys() == second.keys()
    differ = {name for name in first if first[name].tobytes() != second[name].tobytes()}
    return differ - {"entry/config", "entry/mean/kernel_s", "entry/versions"}


def started(*words: object) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "live.cli", "batch", *map(str, words)]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL)


def pid_of(part: Path) -> int:
    return int(part.name.split(".")[-2])


def is_gone(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").split(") ")[1][0] == "Z"
    except OSError:
        return True


# -- a cluster ----------------------------------------------------------------------------------

HERE = ["--host", "127.0.0.1", "--dashboard-address", "127.0.0.1:0"]
PATIENCE_S = 200.0
"""Within pytest-timeout's; only a machine that is stuck takes so long."""

ONE_THREAD = dict.fromkeys(NEEDED, "1")


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Running:
    """A scheduler and its workers."""

    address: str
    scheduler: subprocess.Popen[bytes]
    workers: list[subprocess.Popen[bytes]]

    @property
    def pids(self) -> list[int]:
        return [process.pid for process in (self.scheduler, *self.workers)]


def dask(role: str, *words: object, **more: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", f"distributed.cli.dask_{role}", *map(str, words)]
    nothing = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen(command, cwd=ROOT, env=os.environ | more, **nothing)


def address_in(told: Path) -> str:
    """Where the scheduler is to be reached; empty until it has written all of its file."""
    try:
        return str(json.loads(told.read_bytes())["address"])
    except (OSError, ValueError):
        return ""


@contextmanager
def running(folder: Path, workers: int = 2, **more: str) -> Iterator[Running]:
    """As docs/scale.md says to start them, once all of them are there; on a busy machine that may take long."""
    told = folder / "scheduler.json"
    scheduler = dask("scheduler", *HERE, "--port", 0, "--scheduler-file", told)
    made: list[subprocess.Popen[bytes]] = []
    try:
        until(lambda: address_in(told) != "", PATIENCE_S)
        address = address_in(told)
        one = [address, "--nthreads", 1, "--no-nanny", *HERE, "--local-directory", folder]
        made += [dask("worker", *one, **(more or ONE_THREAD)) for _ in range(workers)]
        with patch.object(cluster, "_CONNECT_S", PATIENCE_S):
            with closing(cluster._connected(address)) as client:
                client.wait_for_workers(workers, timeout=PATIENCE_S) if workers else None
            yield Running(address, scheduler, made)
    finally:
        for process in (*made, scheduler):
            process.kill()
            process.wait()
