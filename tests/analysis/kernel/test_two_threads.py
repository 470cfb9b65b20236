"""Two kernels in two threads: safe also where numba has neither OpenMP nor TBB."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

CODE = """
import threading
import numba
import numpy as np
from analysis import PhaseKernel, Roi, ZoiGrid
from tests.analysis.speckle import picture

grid = ZoiGrid.cover(Roi(8, 8, 208, 168), size=32, step=8)
images = [picture(u=0.1 * k) for k in range(4)]
alone = [PhaseKernel(images[0], grid, noise=1.0).measure(i, noise=1.0).parameters for i in images]
found = {}

def work(number):
    kernel = PhaseKernel(images[0], grid, noise=1.0)
    found[number] = [kernel.measure(image, noise=1.0).parameters for _ in range(6) for image in images]

threads = [threading.Thread(target=work, args=(n,)) for n in range(2)]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
assert all(np.array_equal(p, alone[k % 4], equal_nan=True) for many in found.values() for k, p in enumerate(many))
print(numba.threading_layer(), len(found))
"""


@pytest.mark.parametrize("layer", ["workqueue", "omp"])
def test_two_kernels_in_two_threads(layer: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", f"import numba; numba.config.THREADING_LAYER = {layer!r}\n{CODE}"],
        capture_output=True, text=True, cwd=Path(__file__).parents[3], check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [layer, "2"]
