"""From an installation and a camera to results.

The first run after installation compiles, and its bits are those of every later replay. ``init``, ``check`` and
``run`` give values of all gauges, on the simulated rig and on two real image sets played as a camera (with
PHASEDIC_DATA): the first picture stands still for a while, each frame with new sensor noise, then the specimen moves.
"""

from __future__ import annotations

import datetime
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest

from acquire.errors import ConfigError
from live.cli import main
from live.results.folder import make_folder


def test_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    now = datetime.datetime(2026, 5, 9, 7, 35, 25, tzinfo=datetime.UTC)
    first, second = make_folder(None, now), make_folder(None, now)
    assert first == Path("runs/20260509T073525Z")
    assert second == Path("runs/20260509T073525Z-2")
    (tmp_path / "mine").mkdir()
    assert make_folder("mine", now) == Path("mine")
    (tmp_path / "mine" / "strain.h5").touch()
    with pytest.raises(ConfigError, match="nothing is overwritten"):
        make_folder("mine", now)
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, match="cannot be made"):
        make_folder("file/below", now)


ROOT = Path(__file__).parents[3]
RUN = (
    "run --camera sim:woven?lockstep=yes&seconds=2&fps=15&width=224&height=192&bits=12 --load sim: --zoi 48 --step 24"
    " --burst 3 --reference-burst 4 --no-view --no-rrd --out first"
)
REPLAY = "replay first/session.h5 --as-measured --no-view --no-rrd --out"


def phasedic(words: str, folder: Path, **more: str) -> str:
    """Run it with a cache that is empty the first time; returns its output."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(folder / "cache"), **more}
    command = [sys.executable, "-m", "live.cli", *words.split()]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def results(folder: Path) -> dict[str, np.ndarray]:
    """Every dataset except times of the run: latency and duration."""
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
        output = phasedic(f"{REPLAY} again{threads}", tmp_path, NUMBA_NUM_THREADS=threads)
        assert "compiling" not in output
        again = results(tmp_path / f"again{threads}")
        assert first.keys() == again.keys()
        for name, values in first.items():
            np.testing.assert_array_equal(values, again[name], err_msg=name)


STILL = 16


def gone_through(folder: Path, camera: str, *arguments: str, ready: int = 0) -> dict[str, np.ndarray]:
    """Run the three commands as a person types them, ``check`` ends with ``ready``; returns the gauges of the run."""
    rig, out = str(folder / "rig.toml"), folder / "run"
    assert main(["init", rig, "--camera", camera, "--reference-burst", "8", *arguments]) == 0
    assert main(["check", "--config", rig]) == ready
    assert main(["run", "--config", rig, "--no-view", "--no-rrd", "--out", str(out)]) == 0
    with h5py.File(out / "strain.h5") as file:
        gauges = file["entry/gauges"]
        return {name: gauges[name][()] for name in ("extension", "width", "area")}


def played(folder: Path, paths: Sequence[Path], noise: float, light: float) -> str:
    """Pictures as frames of a camera, scaled by ``light`` so that nothing is saturated."""
    rng = np.random.default_rng(0)
    shots = [paths[0]] * STILL + list(paths[1:])
    (folder / "shots").mkdir()
    for number, path in enumerate(shots):
        picture = light * cv2.imread(str(path), cv2.IMREAD_GRAYSCALE).astype(np.float64)
        picture = np.clip(np.rint(picture + rng.normal(0, noise, picture.shape)), 0, 255)
        cv2.imwrite(str(folder / "shots" / f"shot{number:03}.png"), picture.astype(np.uint8))
    return f"files:{folder}/shots/*.png"


@pytest.mark.slow
@pytest.mark.timed
def test_the_simulated_rig(tmp_path: Path) -> None:
    sim = "sim:hole?seconds=10&hold=5&fps=15&width=320&height=320&hole=30"
    found = gone_through(tmp_path, sim, "--section", "10,2", "--zoi", "48")
    assert all(np.isfinite(values).all() for values in found.values())
    assert found["extension"][-1] > 1e-3
    assert found["width"][-1] < 0


@pytest.mark.data
@pytest.mark.slow
def test_the_open_hole(tmp_path: Path, data_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its speckle radius of 1.09 px is finer than the limit: not ready for that reason alone."""
    paths = sorted((data_dir / "dic_challenge_1_sample12_ohtcfrp").glob("*.tiff"))
    found = gone_through(tmp_path, played(tmp_path, paths, 3.0, 1.0), ready=6)
    looks = [line for line in capsys.readouterr().out.splitlines() if line.startswith("LOOK")]
    assert [line.split()[1:3] for line in looks] == [["speckle", "radius"]]
    pulled = {name: values[-len(paths) + 1 :] for name, values in found.items()}
    assert all(np.isfinite(values).all() for values in found.values())
    assert np.abs(found["extension"][: -len(paths) + 1]).max() < 5e-5
    assert (np.diff(pulled["extension"]) > 0).all()
    assert pulled["area"][-1] == pytest.approx(pulled["extension"][-1], rel=0.3)
    assert pulled["width"][-1] < -5e-4


@pytest.mark.data
@pytest.mark.slow
def test_the_polymer_bar(tmp_path: Path, data_dir: Path) -> None:
    """To 3 %; each picture has noise of its own that the still ones do not show, so it is given."""
    paths = sorted((data_dir / "mudic_tension").glob("*.tif"))[:3]
    arguments = ["--noise", "6", "--crop", "260,230,330,1340"]
    found = gone_through(tmp_path, played(tmp_path, paths, 1.0, 0.9), *arguments)
    assert all(np.isfinite(values).all() for values in found.values())
    assert found["extension"][-1] == pytest.approx(0.031, abs=0.002)
    assert found["area"][-1] == pytest.approx(found["extension"][-1], rel=0.03)
    poisson = -found["width"][-1] / found["extension"][-1]
    assert 0.3 < poisson < 0.55
