"""A process forked off after measuring is refused, and its parent does not wait for ever."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import multiprocessing, sys
import numpy as np
from analysis import PhaseKernel, Roi, ZoiGrid
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle

picture = 255 * Speckle((96, 96), radius=2.0, seed=3).render(Affine(), (96, 96)).astype(np.float32)
grid = ZoiGrid.cover(Roi(8, 8, 80, 80), 32, 16)

def anew(_):
    return float(np.nanmax(np.abs(PhaseKernel(picture, grid).measure(picture).u)))

def again(_):
    return float(np.nanmax(np.abs(kernel.measure(picture).u)))

if sys.argv[1] == "after":
    kernel = PhaseKernel(picture, grid)
    again(None)
with multiprocessing.get_context("fork").Pool(1) as pool:
    for what in (anew, again) if sys.argv[1] == "after" else (anew,):
        try:
            print("measured", pool.apply(what, (None,)) < 1e-3, flush=True)
        except RuntimeError as error:
            print(error, flush=True)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("when", "message"), [("after", "forked off after its parent"), ("before", "measured True")]
)
def test_a_fork(when: str, message: str) -> None:
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, when], capture_output=True, text=True, timeout=300, cwd=root
    )
    assert done.returncode == 0, done.stderr
    assert all(message in line for line in done.stdout.splitlines())
    assert done.stdout
