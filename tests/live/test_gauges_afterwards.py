"""An area gauge that is added to a finished run reads what it would have read during the test."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from live.cli import main
from live.commands.more_gauges import add_gauges
from live.results.run_folder import open_run

SIM = (
    "sim:woven?cell=60&seconds=3&hold=0.5&fps=5&max_strain=0.004&width=240&height=240&noise=0.5&lockstep=yes"
)
BOX = "kind = 'area'\nbox = [60, 40, 100, 130]\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    at = tmp_path_factory.mktemp("afterwards")
    rig, out = at / "rig.toml", at / "run"
    rig.write_text(
        f'[camera]\naddress = "{SIM}"\n[measure]\nroi = [16, 16, 208, 208]\nzoi = 32\nstep = 16\nburst = 1\n'
        f"reference_burst = 1\n[specimen]\naxis = 'y'\n[gauges.during]\n{BOX}",
        encoding="utf-8",
    )
    (at / "later.toml").write_text(f"[gauges.later]\n{BOX}", encoding="utf-8")
    assert main(["run", "--config", str(rig), "--out", str(out), "--no-view", "--no-rrd", "--no-record"]) == 0
    return out


def differences(folder: Path) -> np.ndarray:
    with open_run(folder) as run:
        add_gauges(run, folder.parent / "later.toml")
        return np.asarray(run.gauges["later"].value - run.gauges["during"].value)


def test_its_values_are_those_of_the_test_to_the_digits_of_the_maps(folder: Path) -> None:
    assert np.abs(differences(folder)).max() < 3e-8
    with h5py.File(folder / "strain.h5") as file:
        normal = file["entry/references/normal"]
        assert normal.shape[0] == 1, "one reference"
        assert normal.id.get_storage_size() < 21 * 4 * normal.shape[2] * normal.shape[3] + 200


@pytest.mark.parametrize("value", [np.nan, 0.0, -1.0])
def test_damaged_normal_matrices_are_refused(folder: Path, tmp_path: Path, value: float) -> None:
    spoilt = tmp_path / "run"
    spoilt.mkdir()
    (spoilt / "strain.h5").write_bytes((folder / "strain.h5").read_bytes())
    with h5py.File(spoilt / "strain.h5", "a") as file:
        file["entry/references/normal"][...] = value
    assert main(["export", str(spoilt), "--gauges", str(folder.parent / "later.toml"), "--to", "csv"]) == 4


def test_a_file_without_normal_matrices_is_read_as_before(folder: Path, tmp_path: Path) -> None:
    old = tmp_path / "run"
    old.mkdir()
    (old / "strain.h5").write_bytes((folder / "strain.h5").read_bytes())
    (tmp_path / "later.toml").write_text(f"[gauges.later]\n{BOX}", encoding="utf-8")
    with h5py.File(old / "strain.h5", "a") as file:
        del file["entry/references"]
    assert 3e-7 < np.abs(differences(old)).max() < 1e-4
