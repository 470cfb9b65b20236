"""Real images through ``phasedic replay``; run where PHASEDIC_DATA names the image sets.

Open-hole tension of a carbon-fibre composite: DIC Challenge 1.0, sample 12 (SEM/iDICs), with the gold
displacements of DICe's regression tests. Tension of a polymer bar: the muDIC examples.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from analysis import Status
from live.cli import main
from live.results.reader import Strain

pytestmark = [pytest.mark.data, pytest.mark.slow]


def specimen_mask(path: Path, threshold: float, out: Path) -> Path:
    """Where the picture is bright enough over a neighbourhood to be painted specimen."""
    picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    mask = (cv2.GaussianBlur(picture, (0, 0), 4) > threshold).astype(np.uint8)
    for step in (cv2.MORPH_CLOSE, cv2.MORPH_OPEN):
        mask = cv2.morphologyEx(mask, step, np.ones((15, 15), np.uint8))
    cv2.imwrite(str(out), 255 * cv2.erode(mask, np.ones((5, 5), np.uint8)))
    return out


@pytest.fixture(scope="module")
def open_hole(data_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = data_dir / "dic_challenge_1_sample12_ohtcfrp"
    work = tmp_path_factory.mktemp("oht")
    mask = specimen_mask(folder / "oht_cfrp_00.tiff", 30, work / "mask.png")
    arguments = ["--mask", str(mask), "--zoi", "32", "--step", "5", "--no-view", "--no-rrd"]
    assert main(["replay", f"files:{folder}/*.tiff", "--out", str(work / "out"), *arguments]) == 0
    return work / "out" / "strain.h5"


@pytest.mark.parametrize(("row", "gold"), [(0, "02"), (1, "04"), (4, "11")])
def test_displacements_agree_with_dice(open_hole: Path, data_dir: Path, row: int, gold: str) -> None:
    text = data_dir / "dic_challenge_1_sample12_ohtcfrp" / f"DICe_solution_{gold}.txt"
    with text.open(encoding="utf-8") as file:
        table = np.genfromtxt(
            (line for line in file if not line.startswith("***")), delimiter=",", names=True
        )
    with Strain.open(open_hole) as strain:
        columns = np.searchsorted(strain.grid.x, table["COORDINATE_X"])
        u, v = strain.maps("u", row), strain.maps("v", row)
        rows = np.searchsorted(strain.grid.y, table["COORDINATE_Y"])
        inside = (columns > 0) & (columns < len(strain.grid.x)) & (rows > 0) & (rows < len(strain.grid.y))
        table, columns, rows = table[inside], columns[inside], rows[inside]
        # The grid is fine: the displacement between its points is linear.
        du = interpolated(u, strain.grid.x, strain.grid.y, table) - table["DISPLACEMENT_X"]
        dv = interpolated(v, strain.grid.x, strain.grid.y, table) - table["DISPLACEMENT_Y"]
    common = np.isfinite(du) & np.isfinite(dv)
    assert common.sum() > 100
    print(f"frame {gold}: {common.sum()} points, median |du| {np.median(np.abs(du[common])):.4f} px,"
          f" |dv| {np.median(np.abs(dv[common])):.4f} px, largest {np.abs(dv[common]).max():.3f}")  # fmt: skip
    assert np.median(np.abs(du[common])) <= 0.02
    assert np.median(np.abs(dv[common])) <= 0.02
    # Nothing wrong is passed off as right: the two codes differ by less than 0.2 px everywhere.
    assert max(np.abs(du[common]).max(), np.abs(dv[common]).max()) < 0.2


def interpolated(field: np.ndarray, x: np.ndarray, y: np.ndarray, table: np.ndarray) -> np.ndarray:
    column = (table["COORDINATE_X"] - x[0]) / (x[1] - x[0])
    row = (table["COORDINATE_Y"] - y[0]) / (y[1] - y[0])
    i, j = np.floor(row).astype(int), np.floor(column).astype(int)
    a, b = row - i, column - j
    top = field[i, j] * (1 - b) + field[i, j + 1] * b
    low = field[i + 1, j] * (1 - b) + field[i + 1, j + 1] * b
    return np.asarray(top * (1 - a) + low * a)


def test_the_strain_concentrates_beside_the_hole(open_hole: Path) -> None:
    with Strain.open(open_hole) as strain:
        eyy = strain.maps("eyy", -1)
        x, y = np.meshgrid(strain.grid.x, strain.grid.y)
    # The hole: centre about (193, 541), radius 52 px.
    away = (np.abs(y - 541) > 300) & np.isfinite(eyy)
    beside = (np.abs(y - 541) < 25) & (np.abs(np.abs(x - 193) - 75) < 15) & np.isfinite(eyy)
    above = (np.abs(x - 193) < 25) & (np.abs(np.abs(y - 541) - 75) < 15) & np.isfinite(eyy)
    far = np.median(eyy[away])
    assert 0.005 < far < 0.009
    assert np.median(eyy[beside]) > 1.6 * far
    assert np.median(eyy[above]) < 0.5 * far


def test_the_bar_is_followed_to_the_onset_of_necking(data_dir: Path, tmp_path: Path) -> None:
    """Large strains: the frames left out between those of the set make steps of many percent."""
    source = f"files:{data_dir}/mudic_tension/*.tif"
    arguments = ["--roi", "330,250,190,1300", "--zoi", "48", "--step", "24", "--no-view", "--no-rrd"]
    assert main(["replay", source, "--out", str(tmp_path / "out"), *arguments]) == 0
    with Strain.open(tmp_path / "out" / "strain.h5") as strain:
        status = strain.maps("status")
        eyy = strain.maps("eyy")
    valid = (status == Status.OK).mean(axis=(1, 2))
    print("valid:", np.round(valid, 3), "mean eyy:", np.round(np.nanmean(eyy, axis=(1, 2)), 4))
    assert (valid[:4] > 0.93).all()
    assert 0.8 < valid[4] < 1.0  # the neck is beyond what can be followed, and is said to be
    mean = np.nanmean(eyy, axis=(1, 2))
    assert (np.diff(mean) > 0).all()
