"""Kernels in several threads: no process ends of it, whatever numba shares its loops among threads with."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

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
