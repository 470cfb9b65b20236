"""Signals at any time end a run cleanly; a lost terminal does not end it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from acquire.session.reader import Session

pytestmark = pytest.mark.slow
SIM = "sim:uniform?seconds={seconds}&fps=20&width=160&height=128&hold=1"


def started(folder: Path, seconds: float) -> subprocess.Popen[str]:
    command = [
        sys.executable,
        "-m",
        "live.cli",
        "run",
        "--camera",
        SIM.format(seconds=seconds),
        "--load",
        "sim:",
    ]
    more = ["--out", str(folder), "--no-view", "--no-rrd", "--zoi", "32", "--reference-burst", "4"]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    return subprocess.Popen(
        [*command, *more], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment
    )


def read_until(process: subprocess.Popen[str], word: str) -> str:
    assert process.stdout is not None
    seen = ""
    for line in process.stdout:
        seen += line
        if word in line:
            return seen
    raise AssertionError(f"{word!r} never came in:\n{seen}")


@pytest.mark.parametrize("moment", ["opening", "the test begins", "reference:"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_closes_everything(tmp_path: Path, number: signal.Signals, moment: str) -> None:
    process = started(tmp_path / "run", 60)
    seen = read_until(process, moment)
    process.send_signal(number)
    rest, _ = process.communicate(timeout=60)
    assert process.returncode == 130, seen + rest
    assert "Traceback" not in seen + rest
    if moment == "opening":
        return  # nothing need have been recorded yet
    assert "adds up" in rest
    with Session.open(tmp_path / "run" / "session.h5") as session:
        assert session.recovered is None
        assert session.ledger is not None
        assert session.ledger["recorded"] == len(session)


def test_a_lost_terminal_does_not_end_the_test(tmp_path: Path) -> None:
    process = started(tmp_path / "run", 4)
    read_until(process, "reference:")
    assert process.stdout is not None
    process.stdout.close()  # nobody reads any more: printing fails from now on
    process.send_signal(signal.SIGHUP)
    assert process.wait(timeout=60) == 0
    with Session.open(tmp_path / "run" / "session.h5") as session:
        assert session.ledger is not None
        assert session.ledger["recorded"] == len(session) > 60
