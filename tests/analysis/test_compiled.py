"""Kernels in several threads at once, also where numba has only its own pool of threads."""

from __future__ import annotations

import subprocess
import sys

import pytest

PROGRAM = """
import threading
import numba
import numpy as np
from analysis import PhaseKernel, Roi, ZoiGrid

y, x = np.mgrid[:200, :200]
image = 100 + 40 * np.sin(x * 1.3 + 0.2 * y) * np.cos(0.9 * y - 0.35 * x)
kernel = PhaseKernel(image, ZoiGrid.cover(Roi(8, 8, 184, 184), size=32, step=4))
start = kernel.measure(image)
done = []

def work():
    for _ in range(20):
        done.append(kernel.measure(image, start=start).n_valid)

threads = [threading.Thread(target=work) for _ in range(3)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
print(numba.threading_layer(), len(done), len(set(done)))
"""


@pytest.mark.parametrize("layer", ["workqueue", "default"])
def test_measurements_in_several_threads_take_turns(layer: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_THREADING_LAYER", layer)
    monkeypatch.setenv("NUMBA_NUM_THREADS", "2")
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.split()[1:] == ["60", "1"]
    assert layer == "default" or done.stdout.startswith("workqueue")
