"""Replay, report, export, batch, maps and page where a system has none of the modules that only POSIX has.

A stand-in for another system, no more: every process here still runs on Linux.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any
from urllib.request import HTTPCookieProcessor, build_opener

import pytest

from tests.live.made_run import make_run
from tests.live.ui.web.browser import Program

RECORDED = str(Path(__file__).parents[1] / "replay" / "recorded" / "session.h5")
HIDDEN = ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty")
HIDE = f"import sys\nfor name in {HIDDEN}:\n    sys.modules[name] = None\n"


@pytest.fixture
def hidden(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """In every process that is started from now on an import of a hidden module fails; a folder to work in."""
    place = tmp_path / "hidden"
    place.mkdir()
    (place / "sitecustomize.py").write_text(HIDE, encoding="utf-8")
    paths = [str(place), str(Path(__file__).parents[3]), os.environ.get("PYTHONPATH", "")]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, paths)))
    imports = [f"import {name}" for name in HIDDEN]
    missed = [subprocess.run([sys.executable, "-c", one], capture_output=True).returncode for one in imports]
    assert missed == [1] * len(HIDDEN), "they are hidden"
    return tmp_path


def phasedic(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "live.cli", *words]
    given: Any = {"cwd": folder, "stdin": subprocess.DEVNULL, "timeout": 250}
    return subprocess.run(command, capture_output=True, text=True, check=False, **given)


@pytest.mark.slow
def test_finished_tests(hidden: Path) -> None:
    make_run(hidden / "run")
    for words, made in (
        (["report", "run", "--out", "report.html"], "report.html"),
        (["export", "run", "--to", "csv", "--out", "table"], "table"),
        (["replay", RECORDED, "--out", "again", "--no-view", "--no-rrd"], "again/strain.h5"),
        (["batch", RECORDED, "--out", "many", "--workers", "1"], "many"),
    ):
        done = phasedic(hidden, *words)
        assert done.returncode == 0, (words, done.stdout, done.stderr)
        assert "Traceback" not in done.stderr
        assert (hidden / made).exists(), (words, done.stdout)


@pytest.mark.slow
def test_the_page(hidden: Path) -> None:
    words = ["page", "--camera", f"session:{RECORDED}", "--load", "none:", "--no-view", "--no-rrd"]
    program = Program(hidden, *words, "--page-port", "0")
    try:
        browser = build_opener(HTTPCookieProcessor())
        browser.open(program.address, timeout=60).close()  # the token goes into a cookie
        with browser.open(program.address.partition("?")[0], timeout=60) as answer:
            assert answer.status == 200 and b"phasedic" in answer.read()
        assert "Traceback" not in program.output
    finally:
        program.kill()


def test_a_simulated_port_is_refused_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    from acquire import system

    monkeypatch.setattr(system.sys, "platform", "win32")
    with pytest.raises(OSError, match="choose the load none:"):
        system.open_pty()
    assert system.cores() >= 1 and system.group_of(Path("/")) == ""
    system.lower_priority(1)
    system.lowest_priority()
    system.unblock_signals()


def test_times_and_memory_without_proc(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("psutil")
    from acquire import system

    known = system.processor_times()
    monkeypatch.setattr(system.sys, "platform", "darwin")
    times = system.processor_times()
    assert times is not None and known is not None
    assert times[0] == pytest.approx(known[0], rel=0.2) and times[1] >= 0
    assert system._memory_by_psutil() == pytest.approx(system.memory_MiB(), rel=0.5)
