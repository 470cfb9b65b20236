"""The readout time: measured by ``phasedic readout``, and corrected by ``camera.readout_ms``, live as in a replay."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from live.cli import main
from live.config.loading import load_config
from live.results.reader import Strain
from tests.live.test_end_to_end import assert_replay_is_bit_equal

READOUT_MS = 25.0
SIZE = "width=160&height=240&noise=0.3&lockstep=yes"
QUIET = ["--no-view", "--no-rrd"]


def test_a_lamp_gives_the_time_and_the_rig_file_keeps_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text("# mine\n")
    camera = f"sim:?{SIZE}&fps=29.3&flicker=8&readout_ms={READOUT_MS}"
    assert main(["readout", camera, "--lamp", "100", "--config", str(rig)]) == 0
    found = load_config(rig, {}).camera
    assert abs(found.readout_ms - READOUT_MS) < 3 * found.sigma_readout_ms < 0.3
    assert "from the first line to the last" in capsys.readouterr().out
    assert rig.read_text().startswith("# mine")


def test_a_moved_specimen_gives_the_time(tmp_path: Path) -> None:
    view = f"{SIZE}&seconds=3&fps=20&hold=0.5&end=0.5&max_strain=1e-8&drift_y=30&drift_x=10&readout_ms={READOUT_MS}"
    run = tmp_path / "run"
    rig = tmp_path / "rig.toml"
    arguments = ["--camera", f"sim:?{view}", "--roi", "30,40,100,150", "--zoi", "48", "--burst", "1"]
    assert main(["run", *arguments, "--reference-burst", "1", "--out", str(run), *QUIET]) == 0
    assert main(["readout", str(run / "session.h5"), "--config", str(rig)]) == 0
    found = load_config(rig, {}).camera
    assert abs(found.readout_ms - READOUT_MS) < 3 * found.sigma_readout_ms < 3
    with Strain.open(run / "strain.h5") as strain:
        assert abs(strain.values["eyy"]).max() > 1e-3  # what the time takes off


@pytest.mark.parametrize(
    ("camera", "arguments", "words"),
    [
        (
            f"sim:?{SIZE}&fps=29.3&readout_ms=25",
            ["--lamp", "100"],
            "no bands that move from picture to picture",
        ),
        (f"sim:?{SIZE}&fps=25&readout_ms=25&flicker=8", ["--lamp", "100"], "does not divide its frequency"),
        (
            f"sim:?{SIZE}&fps=20&seconds=2&hold=0.5&max_strain=1e-8&end=0.5",
            ["--roi", "30,40,100,150"],
            "too little motion",
        ),
    ],
    ids=["even light", "bands stand still", "no motion"],
)
def test_what_does_not_show_it_is_refused(
    camera: str, arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = tmp_path / "rig.toml"
    assert main(["readout", camera, *arguments, "--config", str(rig)]) == 4
    assert words in capsys.readouterr().err
    assert not rig.exists()


VIEW = (
    "width=160&height=240&seconds=4&fps=5&hold=0.5&end=0.1&max_strain=1e-8&drift_y=34&readout_ms=33&noise=0.2"
)
SMALL = ["--no-view", "--no-rrd", "--zoi", "48", "--step", "16", "--burst", "1", "--reference-burst", "1"]


def run(folder: Path, readout: str) -> Path:
    folder.mkdir()
    (folder / "rig.toml").write_text(f'[camera]\naddress = "sim:?{VIEW}&lockstep=yes"\n{readout}')
    words = ["--config", str(folder / "rig.toml"), "--roi", "40,40,80,160", *SMALL]
    assert main(["run", *words, "--out", str(folder / "run")]) == 0
    return folder / "run"


def moving(folder: Path) -> np.ndarray:
    """eyy while the specimen moves at 10 px/s."""
    with Strain.open(folder / "strain.h5") as strain:
        return np.asarray(strain.values["eyy"][(strain.time_s > 1) & (strain.time_s < 3.5)])


def test_motion_is_no_strain_where_the_readout_is_known(tmp_path: Path) -> None:
    plain, corrected = run(tmp_path / "plain", ""), run(tmp_path / "known", "readout_ms = 33\n")
    assert np.mean(moving(plain)) == pytest.approx(10 * 0.033 / 239, abs=25e-6)
    assert np.mean(moving(corrected)) == pytest.approx(0, abs=25e-6)
    assert_replay_is_bit_equal(corrected, tmp_path / "again")
