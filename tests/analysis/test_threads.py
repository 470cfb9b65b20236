"""Kernels in several threads and processes: layers of numba, locks, and no helper process that stays."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numba
import pytest

from analysis import threads
from analysis.compiled import threads as cores
from analysis.compiled.layer import give_start_lock
from analysis.compiled.loops import ExclusiveLoop

MISSING = 3  # what the program below ends with where the layer cannot be loaded

CODE = f"""
import importlib
import sys
import threading
import numba
import numpy as np
from analysis import PhaseKernel, Roi, ZoiGrid
from tests.analysis.speckle import picture

layer = sys.argv[1]
numba.config.THREADING_LAYER = layer
pool = {{"omp": "omppool", "tbb": "tbbpool", "workqueue": "workqueue"}}[layer]
try:
    importlib.import_module("numba.np.ufunc." + pool)
except ImportError as error:
    print(error, file=sys.stderr)
    sys.exit({MISSING})

grid = ZoiGrid.cover(Roi(8, 8, 208, 168), size=32, step=8)
images = [picture(u=0.1 * k) for k in range(4)]
alone = [PhaseKernel(images[0], grid, noise=1.0).measure(i, noise=1.0).parameters for i in images]
found = {{}}

def work(number):
    kernel = shared if number else PhaseKernel(images[0], grid, noise=1.0)
    found[number] = [kernel.measure(images[(k + number) % 4], noise=1.0).parameters for k in range(24)]

shared = PhaseKernel(images[0], grid, noise=1.0)
threads = [threading.Thread(target=work, args=(n,)) for n in range(3)]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
for n, many in found.items():
    assert all(np.array_equal(p, alone[(k + n) % 4], equal_nan=True) for k, p in enumerate(many))
print(numba.threading_layer(), len(found))
"""


@pytest.mark.parametrize(
    "layer",
    ["workqueue", pytest.param("omp", marks=pytest.mark.slow), pytest.param("tbb", marks=pytest.mark.slow)],
)
def test_two_kernels_in_three_threads(layer: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", CODE, layer],
        capture_output=True, text=True, cwd=Path(__file__).parents[2], check=False,
    )  # fmt: skip
    if done.returncode == MISSING and layer != "workqueue":  # that one is a part of numba
        pytest.skip(f"numba has no {layer} here: {done.stderr.strip()}")
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [layer, "3"]


class Together:
    """A loop that notes how many of it are at work at the same time."""

    def __init__(self) -> None:
        self.running = self.most = self.done = 0

    def __call__(self) -> None:
        self.running += 1
        for _ in range(200):
            time.sleep(0)  # lets another thread in
            self.most = max(self.most, self.running)
        self.running -= 1
        self.done += 1


def test_two_loops_are_never_at_work_at_once() -> None:
    """Nor two different ones: numba's own work queue ends the process where two begin together."""
    together = Together()
    threads = [threading.Thread(target=ExclusiveLoop(together)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (together.done, together.most) == (4, 1)


def test_a_loop_that_fails_lets_the_next_one_in() -> None:
    def failing() -> None:
        raise ValueError("of the loop")

    with pytest.raises(ValueError, match="of the loop"):
        ExclusiveLoop(failing)()
    assert ExclusiveLoop(lambda: 7)() == 7


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
