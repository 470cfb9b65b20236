"""Where neither OpenMP nor TBB is found: which layer is used, and that its threads have all cores."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from analysis import threads
from analysis.compiled import threads as cores

HIDDEN = """
import sys
sys.modules["numba.np.ufunc.omppool"] = sys.modules["numba.np.ufunc.tbbpool"] = None
"""
"""As where libgomp and libtbb are missing: numba's modules for them cannot be imported."""
CALLER = """
import numba
import numpy as np
from analysis.compiled.threads import _thread, caller, keep_apart
from analysis.compiled.layer import threading_layer

@numba.njit(parallel=True)
def loop(threads):
    calling = caller()
    for part in numba.prange(64):
        keep_apart(calling)
        threads[part] = _thread()
    return calling

@numba.njit
def alone(taken_by, shift):
    # What a thread does where all cores are free, its own, or another's.
    _, cores, taken = caller()
    taken[:] = taken_by * (_thread() + shift)
    keep_apart((np.int64(0), cores, taken))
    return np.count_nonzero(taken == _thread())

threading_layer()
"""


def run(code: str, hidden: str = HIDDEN) -> list[str]:
    """What a process prints, without OpenMP and TBB."""
    done = subprocess.run(
        [sys.executable, "-c", hidden + code],
        capture_output=True, text=True, cwd=Path(__file__).parents[2], check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_the_layer_is_named() -> None:
    known = {f"{numba.get_num_threads()} by {by}" for by in ("OpenMP", "TBB", "numba's workqueue")}
    assert threads() in known
    assert run("from analysis import threads; print(threads())") == [
        f"{numba.get_num_threads()} by numba's workqueue"
    ]


def test_the_command_and_the_files_of_a_run_name_it() -> None:
    code = "from live.results.folder import versions; print(versions()['threads'], flush=True)\n"
    code += "from live.cli import main; main(['devices'])"
    recorded, *shown = run(code)
    assert recorded == "numba's workqueue"
    assert f"threads that measure: {numba.get_num_threads()} by {recorded}" in shown


@pytest.mark.skipif(not cores.LINUX, reason="threads are told apart on Linux only")
def test_a_caller_that_waits_has_no_core() -> None:
    """Its threads would keep off its core otherwise, and share those that are left."""
    code = """
threads = np.zeros(64, np.int64)
thread, _, taken = loop(threads)
print(thread in threads, taken.size > 0, thread in taken, set(taken[taken != 0].tolist()) <= set(threads.tolist()))
"""
    assert run(CALLER + code) == ["False True False True"]


@pytest.mark.skipif(not cores.LINUX, reason="threads are told apart on Linux only")
def test_a_thread_keeps_a_core_that_is_free_and_leaves_that_of_another() -> None:
    code = """
import os
allowed = os.sched_getaffinity(0)
for taken_by, shift in ((0, 0), (1, 0), (1, 1)):
    print(alone(taken_by, shift), len(allowed) - len(os.sched_getaffinity(0)))
    os.sched_setaffinity(0, allowed)
"""
    left = int(len(os.sched_getaffinity(0)) > 1)
    assert run(CALLER + code) == ["1 0", "1024 0", f"0 {left}"]


@pytest.mark.slow
def test_the_same_strain_from_the_same_compiled_loops() -> None:
    """What is compiled with one layer is loaded with another, and gives the same bits."""
    code = """
import hashlib
from analysis import PhaseKernel, Roi, ZoiGrid
from tests.analysis.speckle import picture
kernel = PhaseKernel(picture(), ZoiGrid.cover(Roi(8, 8, 208, 168), size=32, step=8), noise=1.0)
print(hashlib.sha256(kernel.measure(picture(u=0.3), noise=1.0).parameters.tobytes()).hexdigest())
"""
    run(code)  # the process that compiles a loop may sum in another order
    assert run(code) == run(code, hidden="")
