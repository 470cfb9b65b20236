"""Maps as pictures: colours, units and ticks, the file with its filters, and refusals."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.cv2_loader import drawn_letters
from acquire.errors import ConfigError
from analysis import Roi, ZoiGrid
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle
from live.cli import main
from live.commands.map import MapRequest, draw
from live.results.maps import painting
from live.results.maps.colours import (
    MICROSTRAIN,
    PERCENT,
    colour,
    diverging_table,
    nice_above,
    number,
    sequential_table,
    ticks,
    unit_for,
)
from live.results.maps.scale import ColourScale
from live.results.reader import Strain
from tests.live.ended import code_of


def test_the_table_runs_from_blue_over_near_white_to_red_without_jumps() -> None:
    table = diverging_table().astype(int)
    assert table.shape == (256, 3)
    assert table[0].argmax() == 2
    assert table[-1].argmax() == 0
    assert table[127:129].min() > 215
    assert np.abs(np.diff(table, axis=0)).max() <= 8
    luminance = table @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(luminance[:127]) > -0.5).all()
    assert (np.diff(luminance[129:]) < 0.5).all()


def test_rejected_is_transparent_and_the_ends_hold() -> None:
    rgba = colour(np.array([[-2.0, -1.0, 0.0, 1.0, 2.0, np.nan]]), -1.0, 1.0, diverging_table(), alpha=200)[0]
    assert rgba[:, 3].tolist() == [200] * 5 + [0]
    assert (rgba[0] == rgba[1]).all()
    assert (rgba[3] == rgba[4]).all()
    assert rgba[2, :3].min() > 215


@pytest.mark.parametrize("is_diverging", [False, True])
def test_the_ramp_runs_from_the_lowest_value_to_the_highest(is_diverging: bool) -> None:
    ramp, table = (
        ColourScale(-1.0, 1.0, "%", 100.0, is_diverging).ramp(64),
        diverging_table() if is_diverging else sequential_table(),
    )
    assert ramp.shape == (64, 3)
    assert (ramp[0] == table[0]).all() and (ramp[-1] == table[-1]).all()


@given(st.floats(1e-7, 1e7))
def test_nice_is_above_and_near(value: float) -> None:
    nice = nice_above(value)
    assert value * (1 - 1e-6) <= nice <= value * 1.35


@given(st.floats(-1e4, 1e4), st.floats(1e-3, 1e4))
def test_ticks_are_inside_and_a_few(low: float, span: float) -> None:
    marks = ticks(low, low + span, 6)
    assert 2 <= len(marks) <= 7
    slack = 1e-6 * (abs(low) + span)
    assert low - slack <= marks[0] <= marks[-1] <= low + span + slack


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (-2500.0, "−2 500"), (0.125, "0.125"), (12000.0, "12 000"), (3e9, "3e+09")],
)
def test_numbers_read_well(value: float, text: str) -> None:
    assert number(value) == text.replace(" ", "\u202f")


def test_percent_from_one_percent_on() -> None:
    assert unit_for(0.0099) == MICROSTRAIN
    assert unit_for(0.02) == PERCENT


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
        ["--field", "eyy", "--deconvolve", "2", "--sharpen", "3"],
    ],
)
def test_a_picture_comes_out(results: Path, tmp_path: Path, more: list[str]) -> None:
    more = [str(results / word) if word.endswith(".png") else word for word in more]
    png = tmp_path / "map.png"
    assert main(["map", str(results / "out" / "strain.h5"), str(png), *more]) == 0
    drawn = cv2.imread(str(png))
    assert min(drawn.shape[:2]) > 300
    assert drawn.std() > 5


def test_that_a_map_lies_on_the_reference_is_told_where_it_matters(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    over = ["--over", str(results / "a1.png")]
    assert main(["map", str(results / "out" / "strain.h5"), str(tmp_path / "a.png"), *over]) == 0
    assert "note:" not in capsys.readouterr().out, "nothing has moved as far as a person sees"
    monkeypatch.setattr("live.commands.map._VISIBLE_PX", 0.05)
    assert main(["map", str(results / "out" / "strain.h5"), str(tmp_path / "b.png"), *over]) == 0
    assert "note: the ZOIs lie where they were in the reference" in capsys.readouterr().out


def test_what_was_done_is_named() -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 192, 160), 48, 8)
    assert MapRequest("eyy").treatment(grid) == ""
    named = MapRequest("eyy", median=3, low_pass_px=9, deconvolution=3).treatment(grid)
    assert named == "deconvolved, 3 steps: l_10% 62 px, noise x 0.86, median 3 x 3, low-pass 9 px"
    assert (
        MapRequest("u", deconvolution=3).treatment(grid) == "deconvolved, 3 steps: l_10% 62 px, noise x 1.05"
    )
    sharpened = MapRequest("u", deconvolution=2, sharpened=4).treatment(grid)
    assert sharpened == "deconvolved, 2 steps, sharpened 4 x: l_10% 51 px, noise x 1.02"


@pytest.mark.parametrize(
    ("key", "value"), [("order", 2), ("window", "uniform"), ("estimator", "phase")], ids=str
)
def test_only_a_known_blur_is_taken_off(results: Path, key: str, value: object) -> None:
    with Strain.open(results / "out" / "strain.h5") as strain:
        strain.config.setdefault("measure", {})[key] = value
        with pytest.raises(ConfigError, match=f"only maps measured with {key} = .* can be deconvolved"):
            draw(strain, MapRequest("eyy", deconvolution=3), None)


@pytest.mark.parametrize(
    ("more", "code", "message"),
    [
        (["--field", "ezz"], 4, "no map 'ezz'"),
        (["--row", "7"], 4, "no row 7"),
        (["--field", "status", "--median", "3"], 2, "neither filtered nor deconvolved"),
        (["--deconvolve", "-1"], 2, "allowed: 0 to 100 steps"),
        (["--deconvolve", "100000000"], 2, "allowed: 0 to 100 steps"),
        (["--deconvolve", "2", "--sharpen", "5"], 2, "allowed: 0 to 4 times"),
        (["--sharpen", "1"], 2, "only a deconvolved map can be sharpened; add --deconvolve STEPS"),
        (["--limit", "nan"], 2, "give a number"),
        (["--limit", "inf"], 2, "give a number"),
        (["--limit", "0"], 2, "a limit of 0.0"),
        (["--limit", "-1"], 2, "a limit of -1.0"),
        (["--median", "4"], 2, "an odd number from 1 to 51"),
        (["--median", "-3"], 2, "an odd number"),
        (["--median", "1000001"], 2, "an odd number"),
        (["--low-pass", "1e9"], 2, "the extent of the grid"),
        (["--low-pass", "nan"], 2, "give a number"),
        (["--low-pass", "-1"], 2, "a low-pass of -1"),
        (["--field", "sigma_eyy", "--deconvolve", "3"], 2, "has no blur"),
    ],
)
def test_refusals(
    results: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    more: list[str],
    code: int,
    message: str,
) -> None:
    assert code_of(["map", str(results / "out" / "strain.h5"), str(tmp_path / "x.png"), *more]) == code
    assert message in capsys.readouterr().err
    assert not (tmp_path / "x.png").exists()


@pytest.mark.parametrize(
    ("name", "code", "message"),
    [
        ("/proc/x.png", 4, "cannot be written"),
        ("x.xyz", 2, "ends in .png"),
        ("x", 2, "ends in .png"),
        ("taken.png", 2, "is not overwritten"),
    ],
)
def test_places_that_cannot_be_written(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, code: int, message: str
) -> None:
    (tmp_path / "taken.png").touch()
    assert main(["map", str(results / "out" / "strain.h5"), str(tmp_path / name)]) == code
    assert message in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["taken.png"]


def test_a_title_fits_however_long_it_is_and_whatever_is_in_it(results: Path, tmp_path: Path) -> None:
    sizes = []
    for k, title in enumerate(("a", r"$\frac$ ± 3 µm/m Prüfung \U0001f600" * 9)):
        png = tmp_path / f"{k}.png"
        assert main(["map", str(results / "out" / "strain.h5"), str(png), "--title", title]) == 0
        picture = cv2.imread(str(png))
        sizes.append(picture.shape)
        assert (picture[:, -10:] == 255).all(), "nothing runs over the edge"
    assert sizes[0] == sizes[1]


def test_letters_that_an_older_opencv_has_not_are_written_plainly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(cv2, "FontFace", raising=False)
    assert drawn_letters("Prüfung, −3 ± 1 µm/m, 2×2") == "Prufung, -3 +- 1 um/m, 2x2"


def test_cells_of_a_coarse_overlay_lie_where_their_zois_have_moved() -> None:
    # 5 columns from x = 21.5 and 3 rows from y = 31.5.
    grid = ZoiGrid.cover(Roi(10, 20, 72, 48), size=24, step=12)
    cells = np.zeros((*grid.shape, 4), np.uint8)
    cells[-1, -1] = 0, 0, 255, 255  # blue, nothing of the picture through it
    picture = np.zeros((50, 60, 3), np.uint8)
    painting.overlay_cells(picture, 0.5, grid, cells, (4.0, -2.0))
    rows, columns = np.nonzero(picture[..., 0])
    # Of the last ZOI: half a step about (69.5 + 4, 55.5 - 2), halved.
    assert (columns.min(), columns.max() + 1) == (34, 40) and (rows.min(), rows.max() + 1) == (24, 30)
    assert not picture[..., 1:].any()
