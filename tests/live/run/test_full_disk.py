"""A disk that takes no more: results and recording stop, the program goes on, and what was written is readable."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from acquire.session.reader import Session
from live.results.reader import Strain

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
