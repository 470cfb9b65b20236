"""The scale on pictures with a known scale and tilt, and its way into rig file, report and exports."""

from __future__ import annotations

import math
import re
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from acquire.errors import ConfigError, DataError
from live.cli import main
from live.config.loading import load_config
from live.results.run_folder import open_run
from live.setup import scale as scale_module
from live.setup.region import Region, region_of
from live.setup.scale import (
    Board,
    Corners,
    _bands,
    _edge,
    _sides,
    _tilt,
    false_strain,
    from_board,
    from_points,
    from_width,
    specimen_width,
)
from tests.live.ended import code_of
from tests.live.made_run import CONFIG, make_run

CHECKER = Board(9, 6, 5.0)
CHARUCO = Board(8, 6, 6.0, 4.5)


def seen(board: Board, px_per_mm: float, degrees: float = 0.0, stand_off: float = 400.0) -> np.ndarray:
    """The board by a pinhole camera at ``stand_off`` mm, turned about an upright axis; 700 x 500 px, noisy."""
    fine = 12  # px of the print per mm
    if board.marker_mm:
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
        made = cv2.aruco.CharucoBoard(
            (board.columns, board.rows), board.square_mm, board.marker_mm, dictionary
        )
        size = int(board.columns * board.square_mm * fine), int(board.rows * board.square_mm * fine)
        printed = np.asarray(made.generateImage(size, marginSize=0), np.float32)
    else:
        square = int(board.square_mm * fine)
        rows, columns = np.mgrid[: (board.rows + 1) * square, : (board.columns + 1) * square] // square
        printed = (255.0 * ((rows + columns) % 2 == 0)).astype(np.float32)
    printed = np.pad(printed, 4 * fine, constant_values=255)
    height, width = printed.shape
    angle = math.radians(degrees)
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    mm = (corners - [width / 2, height / 2]) / fine
    depth = 1 + mm[:, 0] * math.sin(angle) / stand_off
    flat = np.stack([mm[:, 0] * math.cos(angle), mm[:, 1]], axis=1)
    there = flat * px_per_mm / depth[:, None] + [350, 250]
    # Twice the size, then halved: the edges of pixels are averages.
    h = cv2.getPerspectiveTransform(corners, (2 * there).astype(np.float32))
    large = cv2.warpPerspective(printed, h, (1400, 1000), flags=cv2.INTER_AREA, borderValue=180)
    picture = cv2.GaussianBlur(cv2.resize(large, (700, 500), interpolation=cv2.INTER_AREA), (0, 0), 0.7)
    noise = np.random.default_rng(0).normal(0, 2, picture.shape)
    return np.asarray(np.clip(40 + 0.7 * picture + noise, 0, 255).astype(np.uint8))


@pytest.mark.parametrize("board", [CHECKER, CHARUCO], ids=["checkerboard", "charuco"])
@pytest.mark.parametrize("px_per_mm", [8.0, 11.0])
def test_a_board_that_stands_square(board: Board, px_per_mm: float) -> None:
    scale = from_board(seen(board, px_per_mm), board)
    assert scale.mm_per_px == pytest.approx(1 / px_per_mm, abs=3 * scale.sigma)
    assert scale.relative < 1e-3
    assert scale.remarks == ()


@pytest.mark.parametrize("degrees", [4.0, 12.0])
def test_a_tilted_board_is_warned_of(degrees: float) -> None:
    scale = from_board(seen(CHECKER, 8.0, degrees), CHECKER, stand_off_mm=400)
    assert scale.mm_per_px == pytest.approx(1 / 8.0, abs=2 * scale.sigma)
    degrees_found = re.search(r"by (\d+) degrees", scale.remarks[0])
    assert float(degrees_found[1]) == pytest.approx(degrees, abs=1)


def strip(left: float, right: float, lean: float = 0.0, ground: float = 0.0) -> np.ndarray:
    """Speckle between two edges that lean, on a smooth ground or one with a pattern of its own."""
    rng = np.random.default_rng(5)
    y, x = np.mgrid[:480, :360]
    pattern = cv2.GaussianBlur(rng.normal(size=x.shape).astype(np.float32), (0, 0), 1.5)
    other = cv2.GaussianBlur(rng.normal(size=x.shape).astype(np.float32), (0, 0), 12)
    at = x + 0.5 - lean * (y - 240)
    inside = np.clip(at - left + 0.5, 0, 1) * np.clip(right - at + 0.5, 0, 1)
    picture = 110 + inside * 260 * pattern + (1 - inside) * (ground * other + 0.1 * y)
    return np.asarray(np.clip(picture + rng.normal(0, 1, x.shape), 0, 255).astype(np.uint8))


@pytest.mark.parametrize("lean", [0.0, 0.04])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_width_of_the_specimen(lean: float, axis: str) -> None:
    picture = strip(100.3, 260.8, lean)
    picture = picture if axis == "y" else np.ascontiguousarray(picture.T)
    region = region_of(load_config(None, {"measure.zoi": 32}), picture)
    scale = from_width(picture, region, axis, 16.05)
    assert scale.mm_per_px == pytest.approx(0.1, abs=2 * scale.sigma)
    assert scale.relative < 0.02


def test_a_specimen_without_edges_has_no_width() -> None:
    region = Region(None, None, "fills the picture", found=True)
    with pytest.raises(DataError, match="give two points"):
        from_width(strip(0, 400), region, "y", 10)


def test_the_rig_file_gets_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cv2.imwrite(str(tmp_path / "board.png"), seen(CHECKER, 8.0))
    rig = tmp_path / "rig.toml"
    rig.write_text(f"# mine\n[camera]\naddress = 'files:{tmp_path}/board.png'\n")
    arguments = ["--config", str(rig), "--checkerboard", "9x6", "--square", "5", "--stand-off", "400"]
    assert main(["scale", *arguments]) == 0
    output = capsys.readouterr().out
    assert "0.1 mm toward the camera at a stand-off of 400 mm gives a false strain of 250 µm/m" in output
    found = load_config(rig, {"measure.zoi": "5 mm"})
    assert found.scale.mm_per_px == pytest.approx(0.125, rel=1e-3)
    assert found.measure.zoi == 40
    assert 0 < found.scale.sigma_mm_per_px < 1e-3
    assert found.scale.stand_off_mm == 400
    assert found.scale.date is not None
    assert "# mine" in rig.read_text()
    assert main(["scale", "--config", str(rig), "--points", "0,0,100,0", "--length", "20"]) == 0
    assert load_config(rig, {}).scale.mm_per_px == 0.2
    assert load_config(rig, {}).scale.stand_off_mm == 400
    assert false_strain(400) == 2.5e-4


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        ([], 2, "give one of --points"),
        (["--points", "1,2,3,4", "--width", "3"], 2, "not 2 of them"),
        (["--points", "1,2,3"], 2, "give 4 numbers, as 12,30"),
        (["--points", "1,2,nan,9", "--length", "3"], 2, "give 4 numbers"),
        (["--points", "1,2,30,4"], 2, "--length MM is needed"),
        (["--points", "1,2,30,4", "--length", "-1"], 2, "--length: '-1': give a number above 0"),
        (["--width", "--camera", "sim:"], 2, "give the width of the specimen"),
        (["--width", "10"], 2, "no camera is given"),
        (["--width", "nan"], 2, "--width: 'nan': give a number above 0"),
        (["--width", "10", "--sigma", "-0.1"], 2, "--sigma: '-0.1': give a number from 0"),
        (["--width", "10", "--stand-off", "-1"], 2, "--stand-off: '-1': give a number above 0"),
        (["--checkerboard", "9by6", "--camera", "sim:uniform"], 2, "give 2 numbers, as 9x6"),
        (["--checkerboard", "900x6", "--square", "1", "--camera", "sim:uniform"], 2, "3 to 60 columns"),
        (["--checkerboard", "9x6", "--square", "1", "--camera", "sim:uniform"], 4, "no checkerboard of 9 x 6"),
        (["--charuco", "9x6", "--square", "2", "--marker", "3", "--camera", "sim:uniform"], 2, "smaller than"),
        (["--charuco", "9x6", "--square", "2", "--marker", "1", "--camera", "sim:uniform", "--dictionary", "!"],
         2, "no dictionary of markers '!'"),
        (["--charuco", "20x20", "--square", "2", "--marker", "1", "--camera", "sim:uniform"], 2, "too few markers"),
        (["--charuco", "5x5", "--square", "2", "--marker", "1", "--camera", "sim:uniform"], 4, "no ChArUco board"),
    ],
)  # fmt: skip
def test_what_cannot_be(
    capsys: pytest.CaptureFixture[str], arguments: list[str], code: int, message: str
) -> None:
    assert code_of(["scale", *arguments]) == code
    assert message in capsys.readouterr().err


def test_export_and_report_have_it(tmp_path: Path) -> None:
    folder = make_run(tmp_path / "run", [0.0, 1e-3], config={**CONFIG, "scale": {"mm_per_px": 0.05}})
    assert main(["export", str(folder), "--to", "npz", "--mm", "--out", str(tmp_path / "a.npz")]) == 0
    with np.load(tmp_path / "a.npz") as held, open_run(folder) as run:
        np.testing.assert_allclose(held["v"], 0.05 * run.strain.maps("v"), rtol=1e-6)
    assert main(["report", str(folder), "--out", str(tmp_path / "r.html")]) == 0
    assert "0.05 mm/px" in (tmp_path / "r.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("stored", [None, "0.05", -1, 0, True, math.nan, math.inf, [1]])
def test_what_is_no_scale_is_none(tmp_path: Path, stored: object) -> None:
    with open_run(make_run(tmp_path, [0.0], config={**CONFIG, "scale": {"mm_per_px": stored}})) as run:
        assert run.mm_per_px is None


def test_the_scale_of_a_board_is_the_mean_of_its_two_directions(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tilt shortens one of them; half of the difference is uncertain."""
    rows, columns = np.mgrid[:6, :9]
    mm = np.stack([columns.ravel(), rows.ravel()], axis=1) * 5.0
    monkeypatch.setattr("live.setup.scale.find_corners", lambda *_: Corners(mm, mm * [10.0, 8.0] + 7.0))
    scale = from_board(np.zeros((9, 9)), CHECKER)
    assert scale.mm_per_px == pytest.approx(1 / math.sqrt(80))
    assert scale.relative == pytest.approx(0.2 / math.sqrt(12))
    assert "by 20.0% between directions" in scale.remarks[0]
    assert from_board(np.zeros((9, 9)), CHECKER, sigma_mm=4.0).relative == pytest.approx(
        math.hypot(0.2 / math.sqrt(12), 4.0 / 40.0)
    )


def test_a_scale_from_points_needs_a_distance_and_a_length() -> None:
    assert from_points((0, 0, 1.01, 0), 1.0).mm_per_px == pytest.approx(1 / 1.01)
    for points, length in (((0, 0, 1.0, 0), 1.0), ((0, 0, 9, 0), 0.0), ((0, 0, 9, 0), math.inf)):
        with pytest.raises(ConfigError, match="more than 1 px apart and a length above 0 mm"):
            from_points(points, length)
    found = from_points((0, 0, 30, 40), 25.0)
    assert found.method == "two points 50.0 px apart, 25 mm" and found.relative == pytest.approx(
        math.sqrt(2) / 50
    )
    assert found.changes(400.0)["scale.stand_off_mm"] == 400.0 and "scale.stand_off_mm" not in found.changes()
    assert from_points((10, 20, 310, 420), 50.0, sigma_mm=0.5).sigma == pytest.approx(
        0.1 * math.hypot(math.sqrt(2) / 500, 0.01)
    )
    assert found.changes()["scale.mm_per_px"] == 0.5 and found.changes()["scale.sigma_mm_per_px"] == 0.014


def test_without_a_visible_edge_the_width_is_that_of_the_mask_and_less_certain() -> None:
    mask = np.zeros((300, 400), bool)
    mask[20:280, 100:301] = True
    even = np.random.default_rng(0).normal(100, 20, (300, 400))
    region = Region((0, 0, 400, 300), mask, "", True)
    for axis, picture, one in (("y", even, mask), ("x", even.T, mask.T)):
        scale = from_width(picture, replace(region, mask=one), axis, 20.1)
        assert scale.mm_per_px == pytest.approx(0.1)
        assert scale.relative == pytest.approx(math.sqrt(2) * 6 / 201)
        assert scale.remarks == ("the edges are known to some px only: two points or a board are better",)
    wide = replace(region, mask=np.ones((300, 400), bool))
    with pytest.raises(DataError, match="the edges of the specimen leave the picture"):
        from_width(even, wide, "y", 20.0)
    with pytest.raises(DataError, match="the edges of the specimen are not visible"):
        from_width(even, replace(region, found=False), "y", 20.0)


def test_the_scatter_of_the_bands_and_the_edges_make_the_uncertainty_of_a_width(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mask = np.zeros((400, 300), bool)
    mask[:, 50:150] = True
    for found, known in (([100.0, 102.0, None, 106.0], True), ([100.0, None, None, None], False)):
        widths = iter(found)
        monkeypatch.setattr(scale_module, "_band_width", lambda grey, mask, widths=widths: next(widths))
        px, sigma = specimen_width(np.zeros((400, 300)), Region(None, mask, "", True), "y")
        spread = 1.25 * math.sqrt((2.667**2 + 0.667**2 + 3.333**2) / 3) / math.sqrt(3)
        expected = (102.0, math.hypot(spread, math.sqrt(2))) if known else (100.0, math.sqrt(2) * 6)
        assert (px, sigma) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("first", "stop", "sides"), [(1, 299, (1.0, 299.0)), (0, 299, None), (1, 300, None), (9, 9, None)]
)
def test_a_mask_that_reaches_the_edge_of_the_picture_has_no_sides(
    first: int, stop: int, sides: tuple[float, float] | None
) -> None:
    mask = np.zeros((10, 300), bool)
    mask[:6, first:stop] = True
    assert _sides(mask) == sides
    mask[5] = False
    assert _sides(mask) is None, "of half of the rows it is no side"


def test_the_width_is_looked_for_in_the_middle_half_by_bands() -> None:
    def bands(first: int, last: int) -> list[tuple[int, int]]:
        mask = np.zeros((500, 10), bool)
        mask[first:last] = True
        return [(band.start, band.stop) for band in _bands(mask)]

    assert bands(100, 300) == [(150, 198), (198, 246)]
    assert bands(100, 140) == [(110, 130)]
    assert bands(100, 110) == [(102, 114)]


def test_an_edge_is_where_the_scatter_falls_to_the_middle() -> None:
    scatter = np.full(200, 1.0, np.float32)
    scatter[:101] = 21.0
    scatter[101] = 16.0
    assert _edge(scatter, 100, 21.0) == pytest.approx(101.5 + 5 / 15)
    scatter[123] = 21.0
    assert _edge(scatter, 100, 21.0) is None, "it falls no more where the search ends"
    assert _edge(scatter, 100, 2.0) is None, "the background scatters as much"
    assert _edge(scatter, 100, math.nan) is None


@pytest.mark.parametrize(
    ("change", "uneven", "told"), [(0.005, 0.005, False), (0.0051, 0.0, True), (0.0, 0.0051, True)]
)
def test_a_tilt_is_told_from_half_a_percent_on(change: float, uneven: float, told: bool) -> None:
    assert len(list(_tilt(change, uneven, 50.0, None))) == told


def test_the_tilt_in_degrees_is_from_the_distance_or_from_the_shortening() -> None:
    (words,) = _tilt(0.025, 0.0152, 50.0, 400.0)  # sin of 11.5 degrees is 0.2
    assert "by 12 degrees: the scale changes by 2.5% over it, by 1.5% between directions" in words
    (words,) = _tilt(0.025, 0.0152, 50.0, None)  # cos of 10 degrees is 0.9848
    assert "by 10 degrees" in words


@pytest.mark.parametrize(
    ("columns", "rows", "square", "marker", "good"),
    [(3, 60, 0.1, 0.0, True), (2, 60, 1, 0, False), (3, 61, 1, 0, False), (3, 3, 0, 0, False),
     (3, 3, 1, 1, False), (3, 3, 1, 0.9, True), (3, 3, 1, -0.1, False)],
)  # fmt: skip
def test_the_limits_of_a_board(columns: int, rows: int, square: float, marker: float, good: bool) -> None:
    words = r"a board has 3 to 60|smaller than its squares"
    with nullcontext() if good else pytest.raises(ConfigError, match=words):
        assert Board(columns, rows, square, marker).dictionary == "4X4_50"
