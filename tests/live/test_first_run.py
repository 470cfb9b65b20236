"""The very first run after installation: nothing is compiled, and yet its bits are those of every later replay."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
RUN = (
    "run --camera sim:woven?lockstep=yes&seconds=2&fps=15&width=224&height=192&bits=12 --load sim: --zoi 48 --step 24"
    " --burst 3 --reference-burst 4 --no-view --no-rrd --out first"
)
REPLAY = "replay first/session.h5 --as-measured --no-view --no-rrd --out"


def phasedic(words: str, folder: Path, **more: str) -> str:
    """Run it with a cache that is empty the first time; what it printed."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(folder / "cache"), **more}
    command = [sys.executable, "-m", "live.cli", *words.split()]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def results(folder: Path) -> dict[str, np.ndarray]:
    """Every dataset but what the run alone knows: when, how late, how long."""
    found: dict[str, np.ndarray] = {}

    def keep(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and not name.endswith(("latency_s", "kernel_s")):
            found[name] = item[()]

    with h5py.File(folder / "strain.h5") as file:
        for group in ("strain", "mean"):
            file["entry"][group].visititems(lambda name, item, g=group: keep(f"{g}/{name}", item))
    return found


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_its_bits_are_those_of_every_replay(tmp_path: Path) -> None:
    assert "everything is compiled" in phasedic(RUN, tmp_path)
    first = results(tmp_path / "first")
    assert {"mean/exx", "mean/exx_errors", "strain/exx", "strain/exx_errors"} <= first.keys()
    for threads in ("1", "2"):
        told = phasedic(f"{REPLAY} again{threads}", tmp_path, NUMBA_NUM_THREADS=threads)
        assert "compiling" not in told
        again = results(tmp_path / f"again{threads}")
        assert first.keys() == again.keys()
        for name, values in first.items():
            np.testing.assert_array_equal(values, again[name], err_msg=name)
