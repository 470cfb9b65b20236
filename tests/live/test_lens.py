"""``phasedic lens`` and the correction, from pictures to results: the truth of the simulated camera, by value."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from acquire.errors import ConfigError
from analysis import Roi, ZoiGrid
from analysis.field import StrainField
from analysis.optics import LensCorrection, LensModel, strain_of_shift
from hw_mocks.deformation import Affine
from hw_mocks.optics import Lens as TrueLens
from hw_mocks.optics import Optics, PlaneMotion, Seen
from hw_mocks.speckle import Speckle
from live.cli import main
from live.config.loading import Config, from_dict, load_config
from live.config.rig_file import write_rig
from live.results.reader import Strain
from live.results.run_folder import open_run
from live.setup.lens import from_boards, lens_for, lens_of_corners
from live.setup.scale import Board, Corners
from tests.live.test_end_to_end import assert_replay_is_bit_equal

WIDTH, HEIGHT, DISTORTION = 400, 300, -0.005
QUIET = ["--no-view", "--no-rrd"]
VIEW = (
    f"width={WIDTH}&height={HEIGHT}&seconds=5&fps=16&hold=0.5&end=0.5&max_strain=0.001&drift_x=12&drift_y=20"
    f"&stand_off_mm=500&distortion={100 * DISTORTION}&noise=0.5&lockstep=yes"
)
# Off the middle, where a shift shows most.
TEST = ["--roi", "200,20,180,160", "--zoi", "40", "--step", "20", "--burst", "1", "--reference-burst", "1",
        *QUIET]  # fmt: skip
SHIFTS = [(0, 0), (35, 0), (-35, 0), (0, 30), (0, -30), (25, 25), (-25, 25)]


@pytest.fixture(scope="module")
def lens(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Calibrated from pictures of the still specimen, shifted in its plane."""
    folder = tmp_path_factory.mktemp("shifted")
    through = TrueLens.of(Optics(500.0, DISTORTION), PlaneMotion(), ((WIDTH - 1) / 2, (HEIGHT - 1) / 2), 20.0)
    speckle, rng = Speckle((HEIGHT, WIDTH), seed=4), np.random.default_rng(2)
    for number, (u, v) in enumerate(SHIFTS):
        light = 200 * speckle.fast(Seen(Affine(u, v), through)) + rng.normal(0, 1, (HEIGHT, WIDTH))
        assert cv2.imwrite(
            str(folder / f"{number}.png"), np.clip(light + 20, 0, 255).round().astype(np.uint8)
        )
    out = folder / "lens.toml"
    pictures = f"files:{folder}/*.png"
    assert (
        main(["lens", pictures, "--roi", "5,5,390,290", "--zoi", "40", "--square-on", "--out", str(out)]) == 0
    )
    return out


@pytest.fixture(scope="module")
def corrected(lens: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its calibration file is gone when it is replayed."""
    out = tmp_path_factory.mktemp("corrected") / "run"
    used = Path(shutil.copy(lens, out.parent / "used.toml"))
    rig = ["--camera", f"sim:?{VIEW}", "--load", "sim:", "--section", "10,4", "--report"]
    assert main(["run", *rig, *TEST, "--lens", str(used), "--out", str(out)]) == 0
    used.unlink()
    return out


def test_shifted_pictures_show_the_lens(lens: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = load_config(lens, {}).lens
    corner = math.hypot((WIDTH - 1) / 2, (HEIGHT - 1) / 2)
    sigma = math.sqrt(found.covariance[3][3])
    assert found.k1 == pytest.approx(DISTORTION * (found.focal_px / corner) ** 2, abs=4 * sigma)
    assert sigma < 0.1 * abs(found.k1)
    assert found.picture == (WIDTH, HEIGHT)
    assert found.rms_px < 0.02


@pytest.mark.slow
def test_a_specimen_that_moves_and_stretches_shows_its_own_strain(corrected: Path, tmp_path: Path) -> None:
    raw = tmp_path / "raw"
    session = str(corrected / "session.h5")
    assert main(["replay", session, "--as-measured", "--no-lens", "--out", str(raw), *QUIET]) == 0
    with Strain.open(raw / "strain.h5") as strain:
        before = float(strain.values["eyy"][-1]) - 1e-3
        assert "lens_eyy" not in strain.values
    with Strain.open(corrected / "strain.h5") as strain:
        last = {name: float(values[-1]) for name, values in strain.values.items()}
    assert abs(before) > 100e-6
    assert last["eyy"] == pytest.approx(1e-3, abs=3 * last["sigma_eyy"])
    assert abs(last["eyy"] - 1e-3) < 0.15 * abs(before)
    assert last["lens_eyy"] == pytest.approx(before + 1e-3 - last["eyy"], abs=2e-7)  # small strain
    assert 0 < last["sigma_lens_eyy"] < 0.15 * abs(before)
    assert last["sigma_eyy"] >= last["sigma_lens_eyy"]
    assert last["exx"] == pytest.approx(-0.33e-3, abs=3 * last["sigma_exx"])


def test_a_replay_is_bit_equal_and_takes_another_lens(corrected: Path, lens: Path, tmp_path: Path) -> None:
    session, again, other = str(corrected / "session.h5"), tmp_path / "again", tmp_path / "other"
    assert_replay_is_bit_equal(corrected, again)
    rig = tmp_path / "rig.toml"
    weak = tmp_path / "weak.toml"
    weak.write_text(
        f"[lens]\nfocal_px = 300\ncentre = [199.5, 149.5]\nk1 = -1e-9\npicture = [{WIDTH}, {HEIGHT}]\n"
    )
    rig.write_text(f'lens = "{weak}"\n')
    assert main(["replay", session, "--config", str(rig), "--out", str(other), *QUIET]) == 0
    with Strain.open(other / "strain.h5") as strain:
        assert abs(float(strain.values["lens_eyy"][-1])) < 1e-9
        assert strain.config["lens"]["covariance"] is None


def test_report_budget_and_check_name_the_lens(
    corrected: Path, lens: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    text = (corrected / "report.html").read_text()
    assert "6 shifted pictures of the specimen, camera square to it" in text
    with open_run(corrected) as run:
        largest = 1e6 * float(np.nanmax(np.abs(run.strain.values["lens_eyy"])))
    assert f"{largest:.3g} of eyy of the region were the lens" in text
    assert "<td>lens</td>" in text
    assert "not stated: --lens" not in text
    capfd.readouterr()
    still = f"sim:?width={WIDTH}&height={HEIGHT}&distortion={100 * DISTORTION}&lockstep=yes&noise=0.5"
    main(["check", "--camera", still, *TEST[:-2], "--lens", str(lens), "--no-view"])
    shown = capfd.readouterr().out
    assert "ok    lens" in shown
    assert "a shift of 10 px shows" in shown


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"k1": -9.0}, "its terms fold the picture"),
        ({"centre": None}, "give centre"),
        ({"k4": 1.0}, "unknown key lens.k4"),
    ],
)
def test_a_lens_that_cannot_be_is_refused(given: dict[str, object], words: str) -> None:
    table = {"focal_px": 250.0, "centre": [199.5, 149.5], "k1": -0.005, "picture": [WIDTH, HEIGHT]} | given
    grid = ZoiGrid.cover(Roi(20, 20, 360, 260), 40, 20)
    with pytest.raises(ConfigError, match=words):
        lens_for(from_dict({"lens": table}, {}, "rig.toml"), WIDTH, HEIGHT, grid)


def test_a_file_without_a_lens_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "rig.toml").write_text("[camera]\naddress = 'sim:'\n")
    assert main(["replay", str(tmp_path), "--lens", str(tmp_path / "rig.toml")]) == 2
    assert "has no section [lens]; phasedic lens makes one" in capfd.readouterr().err
    (tmp_path / "self.toml").write_text(f'lens = "{tmp_path / "self.toml"}"\n')
    assert main(["replay", str(tmp_path), "--config", str(tmp_path / "self.toml")]) == 2
    assert "has no section [lens]" in capfd.readouterr().err


def test_a_lens_is_stored_and_no_lens_is_not(lens: Path) -> None:
    config = load_config(lens, {})
    assert from_dict(config.as_dict(), {}, "session") == config
    assert "lens" not in Config().as_dict()  # versions before do not have the section
    assert from_dict(config.as_dict(), {"lens": {}}, "session").lens == Config().lens


BOARD = Board(8, 6, 10.0)
FOCAL, MIDDLE = 620.0, (243.0, 176.0)
TRUE = LensModel(np.array([FOCAL, *MIDDLE, -0.12, 0.05, 1e-3, -8e-4, 0.0]), np.zeros((8, 8)))


def board_seen(
    turn: tuple[float, float, float], place: tuple[float, float, float], seed: int
) -> NDArray[np.uint8]:
    """``BOARD`` through ``TRUE``, 480 x 360 px: each pixel is 3 x 3 rays to the plane of the board."""
    y, x = (np.mgrid[: 360 * 3, : 480 * 3] - 1) / 3
    rotation = cv2.Rodrigues(np.radians(turn))[0]
    flat = cv2.undistortPoints(
        np.stack([x.ravel(), y.ravel()], 1)[:, None],
        np.array([[FOCAL, 0, MIDDLE[0]], [0, FOCAL, MIDDLE[1]], [0, 0, 1]]), TRUE.parameters[3:],
    )[:, 0]  # fmt: skip
    rays = np.column_stack([flat, np.ones(len(flat))])
    plane = np.column_stack([rotation[:, :2], place])
    on = rays @ np.linalg.inv(plane).T
    column, row = np.floor(on[:, 0] / on[:, 2] / 10 + 4.5), np.floor(on[:, 1] / on[:, 2] / 10 + 3.5)
    inside = (column >= 0) & (column < 9) & (row >= 0) & (row < 7)
    light = (
        np.where(inside & ((row + column) % 2 == 0), 40.0, 210.0).reshape(360, 3, 480, 3).mean(axis=(1, 3))
    )
    light = cv2.GaussianBlur(light, (0, 0), 0.7) + np.random.default_rng(seed).normal(0, 1.5, light.shape)
    return np.clip(light, 0, 255).round().astype(np.uint8)


VIEWS = [
    ((0, 0, 2), (0, 0, 160)), ((25, 0, 0), (-20, 8, 170)), ((-25, 5, 5), (18, -10, 165)), ((0, 25, -5), (10, 12, 165)),
    ((5, -25, 0), (-12, -8, 170)), ((18, 18, 10), (15, 10, 175)), ((-18, 18, -8), (-18, 12, 170)),
    ((18, -18, 0), (18, -12, 165)), ((-15, -20, 90), (0, 5, 170)), ((3, 2, -3), (-8, -4, 140)),
]  # fmt: skip


@pytest.mark.slow
def test_boards_show_the_lens_with_honest_uncertainty(tmp_path: Path) -> None:
    pictures = [board_seen(turn, place, k) for k, (turn, place) in enumerate(VIEWS)]
    blank = np.full((360, 480), 128, np.uint8)
    found = from_boards([*pictures, blank], BOARD)
    lens = found.fit.lens
    sigma = np.sqrt(np.diag(lens.covariance))[:7]
    assert sigma[0] < 0.01 * FOCAL
    assert np.max(np.abs(lens.parameters - TRUE.parameters)[:7] / sigma) < 4
    assert found.fit.rms_px < 0.25
    assert "in 10 of 11 pictures" in found.method
    grid = ZoiGrid.cover(Roi(60, 60, 300, 200), 40, 20)
    strain, stated = strain_of_shift(lens, grid, 10.0)
    truth = strain_of_shift(TRUE, grid, 10.0)[0]
    assert truth > 100e-6
    assert abs(strain - truth) < 3 * stated < 0.75 * truth
    write_rig(tmp_path / "lens.toml", found.changes)
    stored = lens_for(load_config(tmp_path / "lens.toml", {}), 480, 360, grid)
    np.testing.assert_array_equal(stored.parameters, lens.parameters)


def test_the_stated_uncertainty_of_boards_covers_the_truth() -> None:
    """Errors of the strain that 15 px of motion make, over their sigma, with noise of the corners of 0.1 px."""
    rng, row_column = np.random.default_rng(5), np.mgrid[:6, :8].reshape(2, -1).T
    mm = 10.0 * row_column[:, ::-1] - [35.0, 25.0]
    camera = np.array([[FOCAL, 0, MIDDLE[0]], [0, FOCAL, MIDDLE[1]], [0, 0, 1]])
    flat = np.column_stack([mm, np.zeros(len(mm))])
    exact = [
        cv2.projectPoints(flat, np.radians(turn), np.array(place, float), camera, TRUE.parameters[3:])[0][
            :, 0
        ]
        for turn, place in VIEWS
    ]
    grid = ZoiGrid.cover(Roi(60, 60, 150, 120), 40, 20)
    moved = StrainField.from_values(grid, {"u": np.full(grid.shape, 10.0), "v": np.full(grid.shape, 11.0)})
    truth = LensCorrection(TRUE, grid).apply(moved)[1]
    errors = []
    for _ in range(60):
        corners = [Corners(mm, px + rng.normal(0, 0.1, px.shape)) for px in exact]
        read = LensCorrection(lens_of_corners(corners, (480, 360)).lens, grid).apply(moved)[1]
        errors += [(read.exx - truth.exx) / read.sigma_exx, (read.eyy - truth.eyy) / read.sigma_eyy]
    assert 0.8 < np.sqrt(np.mean(np.square(errors))) < 1.2
    assert np.mean(np.abs(errors) < 1.96) > 0.9
