"""Maps as PNG: drawn, treated only on request, and refused with words."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle
from live.cli import main
from live.maps import Picture


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("maps")
    speckle = Speckle((160, 192), radius=2.0, seed=3)
    for i, strain in enumerate((0.0, 1e-3)):
        picture = 255 * speckle.render(Affine(dv_dy=strain, x0=96, y0=80), (160, 192))
        cv2.imwrite(str(folder / f"a{i}.png"), np.rint(picture).astype(np.uint8))
    arguments = ["--zoi", "48", "--step", "8", "--no-view", "--no-rrd", "--out", str(folder / "out")]
    assert main(["replay", f"files:{folder}/*.png", *arguments]) == 0
    return folder


@pytest.mark.parametrize(
    "more",
    [
        ["--field", "eyy"],
        ["--field", "v", "--over", "a0.png"],
        ["--field", "status"],
        ["--field", "sigma_eyy", "--row", "0", "--limit", "1e-3"],
        ["--field", "eyy", "--median", "3", "--low-pass", "9", "--deconvolve", "2"],
    ],
)
def test_a_picture_comes_out(results: Path, tmp_path: Path, more: list[str]) -> None:
    more = [str(results / word) if word.endswith(".png") else word for word in more]
    png = tmp_path / "map.png"
    assert main(["map", str(results / "out" / "strain.h5"), str(png), *more]) == 0
    drawn = cv2.imread(str(png))
    assert min(drawn.shape[:2]) > 300
    assert drawn.std() > 5


def test_what_was_done_is_named() -> None:
    assert Picture("eyy").treatment == ""
    named = Picture("eyy", median=3, low_pass_px=9, deconvolution=2).treatment
    assert named == "deconvolved, 2 steps, median 3 x 3, low-pass 9 px"


@pytest.mark.parametrize(
    ("more", "code", "says"),
    [
        (["--field", "ezz"], 4, "no map 'ezz'"),
        (["--row", "7"], 4, "no row 7"),
        (["--field", "status", "--median", "3"], 2, "neither filtered nor deconvolved"),
        (["--deconvolve", "-1"], 2, "must not be negative"),
    ],
)
def test_refusals(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], more: list[str], code: int, says: str
) -> None:
    assert main(["map", str(results / "out" / "strain.h5"), str(tmp_path / "x.png"), *more]) == code
    assert says in capsys.readouterr().err
    assert not (tmp_path / "x.png").exists()
