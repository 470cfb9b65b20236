"""What the operating system tells: processes, processors, memory, signals."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from acquire import system

linux = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


def proc(monkeypatch: pytest.MonkeyPatch, **texts: str) -> None:
    """Files of /proc with these texts, by their names with _ for /."""

    class File:
        def __init__(self, path: str) -> None:
            self._name = path.removeprefix("/proc/").replace("/", "_")

        def read_text(self, **_: Any) -> str:
            if self._name not in texts:
                raise FileNotFoundError(self._name)
            return texts[self._name]

    monkeypatch.setattr(system, "Path", File)


def stat(state: str, user: int, own: int) -> str:
    """The line of a process whose name has spaces and a bracket; ticks in user and in system mode."""
    return f"11 (a) b) {state} " + "0 " * 10 + f"{user} {own} 9 9 20"


@linux
def test_the_memory_of_this_process_is_in_mebibytes(monkeypatch: pytest.MonkeyPatch) -> None:
    pages = 3 * 2**20 // os.sysconf("SC_PAGE_SIZE")
    proc(monkeypatch, self_statm=f"99999 {pages} 7 1 0 5 0")
    assert system.memory_MiB() == 3.0


@linux
def test_a_process_that_has_ended_does_not_run() -> None:
    """Also before its parent has asked for its exit code."""
    child = subprocess.Popen(["true"])
    os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)
    assert not system.is_running(child.pid)
    child.wait()
    assert not system.is_running(child.pid)
    assert system.is_running(os.getpid())


@linux
def test_processor_time_is_that_of_work_and_not_of_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    tick = os.sysconf("SC_CLK_TCK")
    monkeypatch.setattr(system, "_children", lambda: ["11", "12", "13"])
    proc(
        monkeypatch,
        stat="cpu  100 20 30 40000 5000 6 7 0 0 0\ncpu0 1 2 3",
        **{"11_stat": stat("S", 70, 30), "12_stat": stat("R", 5, 1)},
    )
    assert system.processor_times() == ((100 + 20 + 30 + 6 + 7) / tick, (70 + 30 + 5 + 1) / tick)


@linux
def test_cores_are_those_that_this_process_may_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 3, 5})
    assert system.cores() == 3


@pytest.mark.skipif(sys.platform == "win32", reason="has no nice values")
def test_the_nice_value_of_a_process_is_the_one_given(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [5]

    def nice(more: int) -> int:
        now[0] += more
        return now[0]

    monkeypatch.setattr(os, "nice", nice)
    system.lowest_priority(12)
    assert now == [12]


def test_signals_call_what_they_called_before() -> None:
    heard: list[str] = []
    first = signal.signal(signal.SIGINT, lambda number, frame: heard.append("outer"))
    try:
        with system.signal_handler(lambda number, frame: heard.append("inner"), signal.SIGINT):
            signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, first)
    assert heard == ["inner", "outer"]


def test_the_group_of_a_file_is_known_where_it_has_a_name(tmp_path: Path) -> None:
    assert system.group_of(tmp_path / "nothing") == ""
