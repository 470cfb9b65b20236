"""The end of a run: by a full disk, a signal, a lost terminal or a kill; what was written is readable."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from acquire.session.reader import Session
from live.results.reader import Strain
from tests.live.run.kill_program import kill_once, replays

pytestmark = pytest.mark.slow

PROGRAM = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
from live.cli import main
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), int(sys.argv[1])))
sys.exit(main(sys.argv[2:]))
"""


@pytest.mark.parametrize(("limit", "full"), [(2_000_000, "session.h5"), (200_000, "strain.h5")])
def test_the_run_goes_on(tmp_path: Path, limit: int, full: str) -> None:
    camera = "sim:uniform?lockstep=yes&seconds=4&fps=15&width=224&height=192&bits=12"
    more = ["--zoi", "32", "--step", "8", "--no-view", "--no-rrd", "--out", str(tmp_path / "run")]
    record = [] if full == "session.h5" else ["--no-record"]
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            PROGRAM,
            str(limit),
            "run",
            "--camera",
            camera,
            "--load",
            "sim:",
            *more,
            *record,
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    said = done.stdout + done.stderr
    assert done.returncode == 5, said
    assert "Traceback" not in said
    assert "all else goes on" in said or "measuring goes on" in said
    assert "measured 60 bursts" in said
    if full == "session.h5":
        with Session.open(tmp_path / "run" / "session.h5") as session:
            assert 5 < len(session) < 61
            assert session.frame(len(session) - 1).image.shape == (192, 224)
    else:
        with Strain.open(tmp_path / "run" / "strain.h5") as strain:
            assert 0 < strain.n < 60


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
    assert "every frame is accounted for" in rest
    with Session.open(tmp_path / "run" / "session.h5") as session:
        assert session.recovered is None
        assert session.frame_counts is not None
        assert session.frame_counts["recorded"] == len(session)


def test_a_lost_terminal_does_not_end_the_test(tmp_path: Path) -> None:
    process = started(tmp_path / "run", 4)
    read_until(process, "reference:")
    assert process.stdout is not None
    process.stdout.close()  # nobody reads any more: printing fails from now on
    process.send_signal(signal.SIGHUP)
    assert process.wait(timeout=60) == 0
    with Session.open(tmp_path / "run" / "session.h5") as session:
        assert session.frame_counts is not None
        assert session.frame_counts["recorded"] == len(session) > 60


@pytest.mark.slow
def test_a_killed_run_is_complete_and_replays(tmp_path: Path) -> None:
    remains = kill_once(tmp_path / "run", 0.3, fps=50.0)
    assert remains.gaps == 0 and remains.frames > 20 and remains.samples > 10
    # How young the newest frame is depends on the machine's load here; the script measures it.
    assert remains.frame_age_s < 2.0
    assert replays(tmp_path / "run" / "session.h5", tmp_path / "again")
