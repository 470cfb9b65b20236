"""A campaign as a process, and what it leaves."""

from __future__ import annotations

import csv
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).parents[3]


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
    """Datasets of numbers that are not the same to the last bit, but for what may never be."""
    first, second = datasets(one), datasets(other)
    assert len(first) > 20
    assert first.keys() == second.keys()
    differ = {name for name in first if first[name].tobytes() != second[name].tobytes()}
    return {name for name in differ if first[name].dtype != "O"} - {"entry/config", "entry/mean/kernel_s"}


def until(true: Callable[[], bool], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it did not come to that"
        time.sleep(0.01)


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
