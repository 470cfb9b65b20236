"""What Ctrl-C and SIGTERM do to a command, by the number of times."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]
GIVEN = """
import os, signal, sys
from live.commands.signals import signals
stops = []
with signals(lambda: stops.append(1), lambda line: print(line, flush=True)):
    for _ in range(int(sys.argv[1])):
        signal.raise_signal(signal.SIGTERM)
print(len(stops), "stops", flush=True)
"""


def given(times: int) -> tuple[int, str]:
    done = subprocess.run(
        [sys.executable, "-c", GIVEN, str(times)], env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout


def test_the_first_two_signals_close_and_the_third_ends_at_once() -> None:
    code, output = given(2)
    assert (code, output.splitlines()[-1]) == (0, "2 stops")
    assert "closing the files ..." in output and "a third signal ends it at once" in output
    code, output = given(3)
    assert code == -15 and "stops" not in output
