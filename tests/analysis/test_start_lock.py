"""Measuring leaves no helper process of Python's behind, whatever Python's way to start processes is."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from analysis.compiled.layer import give_start_lock

# The default of Python 3.14, on any Python; the process is ended as the workers of a batch are.
PROGRAM = """
import multiprocessing, os, signal
multiprocessing.set_start_method("forkserver")
import numpy as np
from analysis.compiled.loops import parallel
from numba import prange

@parallel
def doubled(values):
    for k in prange(values.size):
        values[k] *= 2.0

values = np.arange(8.0)
doubled(values)
print(values.sum(), flush=True)
os.kill(os.getpid(), signal.SIGTERM)
"""


@pytest.mark.slow
def test_a_process_that_is_ended_is_not_complained_about(tmp_path: Path) -> None:
    program = tmp_path / "program.py"  # numba's cache wants a file
    program.write_text(PROGRAM)
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, program],
        capture_output=True,
        text=True,
        timeout=300,
        env={**os.environ, "PYTHONPATH": str(root)},
    )
    assert (done.stdout, done.stderr) == ("56.0\n", "")


def test_a_lock_that_is_there_stays_and_one_that_is_not_needed_is_not_made() -> None:
    there, other = SimpleNamespace(_backend_init_process_lock="numba's"), SimpleNamespace()
    give_start_lock(there)
    give_start_lock(other)
    assert vars(there) == {"_backend_init_process_lock": "numba's"} and vars(other) == {}


def test_numba_without_semaphores_is_left_to_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(_: str) -> object:
        raise ValueError("cannot find context for 'fork'")

    monkeypatch.setattr(multiprocessing, "get_context", refused)
    threads = SimpleNamespace(_backend_init_process_lock=None)
    give_start_lock(threads)
    assert threads._backend_init_process_lock is None
