"""A session recorded by an earlier version replays to the strain that it replayed to then.

``recorded/session.h5`` was recorded by ``phasedic run`` on the simulated rig (sim:woven, 144 x 112 px,
8 bit, 10 fps, bursts of 2) before the code was laid out in rooms; ``strain.npz`` is what its replay
--as-measured gave then. The last bits belong to a processor, a version of numba and one of the loops.
"""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from live.cli import main

RECORDED = Path(__file__).with_name("recorded")


def test_an_old_session_gives_the_same_strain(tmp_path: Path) -> None:
    out, session = tmp_path / "again", str(RECORDED / "session.h5")
    assert main(["replay", session, "--as-measured", "--out", str(out), "--no-view", "--no-rrd"]) == 0
    then = np.load(RECORDED / "strain.npz")
    with h5py.File(out / "strain.h5") as file:
        now = file["entry/strain"]
        for name in set(then.files) - {"cpu", "iterations"}:
            np.testing.assert_allclose(now[name][()], then[name], rtol=1e-4, atol=1e-7, err_msg=name)
