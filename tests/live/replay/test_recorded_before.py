"""A session recorded by an earlier version replays to the strain that it replayed to then.

``recorded/session.h5`` was recorded by ``phasedic run`` on the simulated rig (sim:woven, 144 x 112 px,
8 bit, 10 fps, bursts of 2) before the code was laid out in rooms; ``strain.npz`` is what its replay
--as-measured gave then. The last bits belong to a processor, a version of numba and one of the loops.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from analysis import numerics
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


def write_json(path: Path, name: str, value: dict[str, Any]) -> None:
    with h5py.File(path, "r+") as file:
        del file["entry"][name]
        file["entry"][name] = np.bytes_(json.dumps(value))


def test_a_session_whose_bursts_were_shortened_replays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Earlier versions could fit the length of a burst to the motion; a replay of all frames no longer does."""
    path = tmp_path / "session.h5"
    shutil.copy(RECORDED / "session.h5", path)
    with h5py.File(path) as file:
        config = json.loads(file["entry/config"][()])
    config["measure"]["shorten_bursts"] = True
    write_json(path, "config", config)
    command = ["replay", str(path), "--no-view", "--no-rrd", "--out"]
    assert main([*command, str(tmp_path / "all")]) == 0
    assert "the run shortened its bursts" in capsys.readouterr().out
    assert main([*command, str(tmp_path / "same"), "--as-measured"]) == 0
    assert "shortened" not in capsys.readouterr().out
    then, now = np.load(RECORDED / "strain.npz"), tmp_path / "same" / "strain.h5"
    with h5py.File(now) as file:
        np.testing.assert_allclose(file["entry/strain/eyy"][()], then["eyy"], rtol=1e-4, atol=1e-7)


def test_a_replay_says_where_the_last_digits_may_differ(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Elsewhere processor, vectors or loops are others; what was not written down then is not told."""
    path = tmp_path / "session.h5"
    shutil.copy(RECORDED / "session.h5", path)
    command = ["replay", str(path), "--as-measured", "--no-view", "--no-rrd", "--out"]
    write_json(path, "versions", {"vectors": "4 float32", "loops": "\x1b[31m"})
    assert main([*command, str(tmp_path / "other")]) == 0
    told = capsys.readouterr().out
    assert (
        "recorded with vectors 4 float32 (here" in told
        and "the last digits of the results may differ" in told
    )
    assert "\x1b" not in told
    write_json(path, "versions", numerics())
    assert main([*command, str(tmp_path / "same")]) == 0
    assert "vectors" not in capsys.readouterr().out
