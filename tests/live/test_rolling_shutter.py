"""``camera.readout_ms`` from the configuration to the results, live as in a replay."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from live.cli import main
from live.results.reader import Strain

VIEW = (
    "width=160&height=240&seconds=4&fps=5&hold=0.5&end=0.1&max_strain=1e-8&drift_y=34&readout_ms=33&noise=0.2"
)
QUIET = ["--no-view", "--no-rrd", "--zoi", "48", "--step", "16", "--burst", "1", "--reference-burst", "1"]


def run(folder: Path, readout: str) -> Path:
    folder.mkdir()
    (folder / "rig.toml").write_text(f'[camera]\naddress = "sim:?{VIEW}&lockstep=yes"\n{readout}')
    out = folder / "run"
    assert (
        main(
            ["run", "--config", str(folder / "rig.toml"), "--roi", "40,40,80,160", "--out", str(out), *QUIET]
        )
        == 0
    )
    return out


def moving(folder: Path) -> np.ndarray:
    """eyy while the specimen moves at 10 px/s."""
    with Strain.open(folder / "strain.h5") as strain:
        return np.asarray(strain.values["eyy"][(strain.time_s > 1) & (strain.time_s < 3.5)])


def test_motion_is_no_strain_where_the_readout_is_known(tmp_path: Path) -> None:
    plain, corrected = run(tmp_path / "plain", ""), run(tmp_path / "known", "readout_ms = 33\n")
    assert np.mean(moving(plain)) == pytest.approx(10 * 0.033 / 239, abs=25e-6)
    assert np.mean(moving(corrected)) == pytest.approx(0, abs=25e-6)
    again = tmp_path / "again"
    session = str(corrected / "session.h5")
    assert main(["replay", session, "--as-measured", "--out", str(again), "--no-view", "--no-rrd"]) == 0
    np.testing.assert_array_equal(moving(again), moving(corrected))
