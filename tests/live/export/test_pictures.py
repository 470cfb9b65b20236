"""png, mp4, webm, gif: the map lies where the specimen is by then."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from analysis.field.strain_field import StrainField
from live.cli import main
from live.finished import Display, open_run
from live.maps import ColourScale, Levels, Painter
from tests.live.made_run import make_run
from tests.live.made_up import make_grid

ZOOM = 4.375
SIZE = (560, 420)  # 128 x 96 px


def frames_of(path: Path) -> list[np.ndarray]:
    film = cv2.VideoCapture(str(path))
    found = []
    while (read := film.read())[0]:
        found.append(read[1])
    return found


def redness(image: np.ndarray) -> np.ndarray:
    return image[..., 2].astype(float) - image[..., 0]


@pytest.mark.parametrize("name", ["f.mp4", "f.webm"])
def test_films(run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    assert main(["export", str(run_dir), "--to", "mp4", "--out", str(tmp_path / name), "--fps", "5"]) == 0
    assert "do not play it" in capsys.readouterr().out
    frames = frames_of(tmp_path / name)
    assert len(frames) == 12
    middle = np.s_[100:300, 100:400]
    assert redness(frames[-1])[middle].mean() > redness(frames[0])[middle].mean() + 40


def test_gif(run_dir: Path, tmp_path: Path) -> None:
    pillow = pytest.importorskip("PIL.Image")
    assert (
        main(["export", str(run_dir), "--to", "gif", "--out", str(tmp_path / "f.gif"), "--from", "0.6"]) == 0
    )
    with pillow.open(tmp_path / "f.gif") as film:
        assert film.n_frames == 6


@pytest.mark.parametrize("field", ["eyy", "status", "v", "sigma_eyy"])
def test_pictures(run_dir: Path, tmp_path: Path, field: str) -> None:
    out = tmp_path / "p"
    assert (
        main(["export", str(run_dir), "--to", "png", "--out", str(out), "--fields", field, "--from", "1"])
        == 0
    )
    assert [path.name for path in sorted(out.iterdir())] == [f"{field}_00000.png", f"{field}_00001.png"]
    drawn = cv2.imread(str(out / f"{field}_00001.png"))
    assert drawn.shape[1] > SIZE[0] * 0.85
    assert drawn.std() > 5


def moved(number: int, strain: float) -> StrainField:
    """Everything has gone by 30 px to the right; nothing is strained but one ZOI."""
    grid = make_grid()
    eyy = np.zeros(grid.shape)
    eyy[2, 2] = 0.01
    return StrainField.from_values(grid, {"u": 30.0, "dv_dy": eyy}, 1e-5)


def test_a_map_moves_with_its_specimen(tmp_path: Path) -> None:
    with open_run(make_run(tmp_path, [0.0], session=False, field_of=moved)) as run:
        scale = ColourScale.of_run(run.strain, "eyy", [0], limit=0.01)
        painter = Painter(run.strain, "eyy", scale, (128, 96))
        assert painter.size == SIZE
        base = painter.picture(np.full((96, 128), 100, np.uint8), Levels(0, 255))
        painted = painter.over(base, 0)
        grid = run.strain.grid
        rows, columns = np.nonzero(redness(painted) > 60)
    place = grid.x[2] + 30, grid.y[2]
    assert np.mean(columns) == pytest.approx((place[0] + 0.5) * ZOOM, abs=1.5)
    assert np.mean(rows) == pytest.approx((place[1] + 0.5) * ZOOM, abs=1.5)
    # Left of the specimen there is the picture as it was.
    np.testing.assert_array_equal(painted[:, : round(25 * ZOOM)], base[:, : round(25 * ZOOM)])


def test_scales_are_in_the_unit_that_is_shown(run_dir: Path) -> None:
    with open_run(run_dir) as run:
        rows = range(run.strain.n)

        def scale_of(name: str, shown: Display) -> ColourScale:
            return ColourScale.of_run(run.strain, name, rows, None, shown.unit(name), shown.factor(name))

        plain, percent = scale_of("eyy", Display()), scale_of("eyy", Display(percent=True))
        shift = scale_of("v", Display(mm_per_px=0.5, y_up=True))
        v = run.strain.maps("v")
    assert (plain.unit, percent.unit, shift.unit) == ("µm/m", "%", "mm")
    assert plain.low == -plain.high
    assert plain.high == pytest.approx(1200, rel=0.3)
    assert percent.high == pytest.approx(0.12, rel=0.3)
    assert shift.low == pytest.approx(-0.5 * np.nanmax(v), rel=0.2)
