"""What the operating system tells: processes, processors, memory, signals."""

from __future__ import annotations

import math
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

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
@pytest.mark.parametrize(
    ("platform", "given", "asked"),
    [("linux", None, [(-8, 2)]), ("linux", "4", []), ("darwin", None, []), ("win32", None, [])],
)
def test_memory_has_two_pools_unless_the_user_says_another(
    platform: str, given: str | None, asked: list[tuple[int, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    found: list[tuple[int, int]] = []
    library = SimpleNamespace(mallopt=lambda what, value: found.append((what, value)))
    monkeypatch.setattr("ctypes.CDLL", lambda name: library)
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setenv("MALLOC_ARENA_MAX", given) if given else monkeypatch.delenv(
        "MALLOC_ARENA_MAX", raising=False
    )
    system.limit_memory_pools()
    assert found == asked


def test_another_c_library_has_no_pools_to_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MALLOC_ARENA_MAX", raising=False)
    monkeypatch.setattr("ctypes.CDLL", lambda name: SimpleNamespace())
    system.limit_memory_pools()


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


def blocked() -> set[signal.Signals]:
    """What this thread does not get now."""
    return {signal.Signals(number) for number in signal.pthread_sigmask(signal.SIG_BLOCK, [])}


@pytest.mark.skipif(sys.platform == "win32", reason="cannot block signals")
def test_signals_are_blocked_within_and_as_before_after() -> None:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGUSR1])
    try:
        with pytest.raises(LookupError), system.blocked_signals(signal.SIGINT, signal.SIGTERM):
            assert blocked() >= {signal.SIGINT, signal.SIGTERM, signal.SIGUSR1}
            system.unblock_signals(signal.SIGTERM)
            assert signal.SIGTERM not in blocked() and signal.SIGINT in blocked()
            raise LookupError
        assert blocked() == {*before, signal.SIGUSR1}
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@linux
def test_a_thread_is_nicer_by_as_much_as_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[tuple[int, int, int]] = []
    monkeypatch.setattr(system.threading, "get_native_id", lambda: 77)
    monkeypatch.setattr(os, "getpriority", lambda which, who: 3)
    monkeypatch.setattr(os, "setpriority", lambda which, who, nice: given.append((which, who, nice)))
    system.lower_priority(4)
    assert given == [(os.PRIO_PROCESS, 77, 7)]


@linux
def test_a_process_that_is_not_ours_runs_and_a_zombie_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    answers: dict[int, type[Exception] | None] = {
        11: None,
        12: PermissionError,
        13: ProcessLookupError,
        14: None,
    }

    def kill(pid: int, number: int) -> None:
        assert number == 0, "it is only asked after"
        if error := answers[pid]:
            raise error

    monkeypatch.setattr(os, "kill", kill)
    proc(monkeypatch, **{"11_stat": stat("S", 1, 1), "14_stat": stat("Z", 1, 1)})
    assert [system.is_running(pid) for pid in (11, 12, 13, 14)] == [True, True, False, False]


def test_what_takes_nothing_does_not_keep_a_sender() -> None:
    ours, its = socket.socketpair()
    with ours, its:
        system.send_within(ours, 0.05)
        ours.sendall(b"abc")
        assert its.recv(100) == b"abc"
        with pytest.raises((BlockingIOError, TimeoutError)):
            while True:
                ours.send(bytes(1 << 16))


def test_a_connection_is_closed_by_its_other_end_alone() -> None:
    ours, its = socket.socketpair()
    with ours:
        its.sendall(b"still to be read")
        its.close()
        system.wait_until_closed(ours)
        assert ours.recv(100) == b"still to be read"


@linux
def test_where_proc_tells_nothing_psutil_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    proc(monkeypatch, self_statm="no numbers")
    monkeypatch.setitem(sys.modules, "psutil", None)
    assert math.isnan(system.memory_MiB()) and system.processor_times() is None

    class Process:
        def memory_info(self) -> Any:
            return SimpleNamespace(rss=5 * 2**20)

        def children(self) -> list[Any]:
            return [SimpleNamespace(cpu_times=lambda: SimpleNamespace(user=1.5, system=0.25))] * 2

    class Times(NamedTuple):
        user: float
        system: float
        idle: float
        iowait: float

    fake = SimpleNamespace(Process=Process, cpu_times=lambda: Times(10, 2, 900, 40), Error=OSError)
    monkeypatch.setitem(sys.modules, "psutil", fake)
    assert system.memory_MiB() == 5.0
    assert system._times_by_psutil() == (12.0, 3.5)


def test_a_pseudo_terminal_passes_bytes_as_they_are() -> None:
    ours, port, name = system.open_pty()
    try:
        os.write(ours, b"\x03\r\xff\n")
        assert os.read(port, 100) == b"\x03\r\xff\n" and name.startswith("/dev/")
        with pytest.raises(BlockingIOError):
            os.read(ours, 1)
    finally:
        os.close(ours)
        os.close(port)
