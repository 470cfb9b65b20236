"""Painted maps by value: cells, ticks, bar, legend, filters, and limits."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from acquire.errors import DataError
from analysis import Roi, ZoiGrid
from analysis.field import Status
from analysis.field.strain_field import StrainField
from live.commands.map import MapRequest, draw, for_display, save
from live.results.maps.colours import diverging_table, sequential_table
from live.results.maps.painting import Levels, Painter, _mixed, caption, overlay_cells, overlay_quads
from live.results.maps.scale import OPACITY, AutoRange, ColourScale, range_kind, status_colours
from live.results.reader import Strain
from live.results.run_folder import open_run
from live.results.stored_fields import _nearest
from tests.live.made_run import make_run
from tests.live.made_up import make_grid

LINE, PLAIN = [120, 115, 110], 150
DEFORMED = {"u": 2.0, "v": -1.0, "du_dx": 0.1, "du_dy": 0.2, "dv_dx": 0.3, "dv_dy": 0.4}


def deformed(number: int, strain: float) -> StrainField:
    return StrainField.from_values(make_grid(), DEFORMED, 1e-5)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_run(tmp_path_factory.mktemp("run"), [0.0, 1e-3], session=False)


@pytest.fixture
def strain(folder: Path) -> Iterator[Strain]:
    with open_run(folder) as run:
        yield run.strain


def through(rgb: Any) -> np.ndarray:
    """A colour of a map over plain grey, as blue, green and red."""
    share = OPACITY / 255
    return np.array(rgb, float)[::-1] * share + PLAIN * (1 - share)


def test_the_table_is_that_of_the_paper() -> None:
    """K. Moreland's cool to warm, at every eighth of it."""
    published = [(59, 76, 192), (98, 130, 234), (141, 176, 254), (184, 208, 249), (221, 221, 221), (245, 196, 173),
                 (244, 154, 123), (222, 96, 77), (180, 4, 38)]  # fmt: skip
    table = diverging_table().astype(int)
    places = [0, 32, 64, 96, 128, 160, 192, 224, 255]
    assert np.abs(table[places] - published).max() <= 3
    assert table[0].tolist() == [59, 76, 192] and table[255].tolist() == [180, 4, 38]
    assert np.abs(np.diff(table, axis=0)).max() <= 8


# R. A. Machado and others, doi:10.1109/TVCG.2009.113: linear sRGB as it is seen, at full severity.
VISIONS = {
    "normal": np.eye(3),
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}  # fmt: skip


@pytest.mark.parametrize("vision", VISIONS)
def test_a_higher_value_is_lighter_for_everyone(vision: str) -> None:
    """CIE L* of the sequential table: from 21 to 92, by 4.8 or more a tenth, and never back."""
    srgb = sequential_table() / 255
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    seen = np.clip(linear @ np.transpose(VISIONS[vision]), 0, 1)
    lightness = 116 * np.cbrt(seen @ [0.2126729, 0.7151522, 0.0721750]) - 16
    assert np.diff(lightness).min() > -0.06  # 8 bit
    assert (lightness[3:] > lightness[:-3]).all()
    assert np.diff(np.interp(np.linspace(0, 255, 11), np.arange(256), lightness)).min() >= 4.7
    assert 20 < lightness[0] < 24 and 90 < lightness[-1] < 93
    if vision == "normal":
        assert [bytes(row).hex() for row in sequential_table()[[0, 51, 102, 153, 204, 255]]] == [
            "431480", "1a51b0", "0187a1", "06b696", "93d866", "faed5a",
        ]  # fmt: skip


def test_frame_ticks_and_bar_lie_at_their_values(strain: Strain) -> None:
    painter = Painter(strain, "eyy", ColourScale(-2.0, 2.0, "%", 100.0, True), (128, 96))
    image = np.full((420, 560, 3), 77, np.uint8)
    full = painter.framed(image, ["a title"], 0, axes=True)
    assert painter.size == (560, 420) and full.shape == (510, 764, 3)
    left, top, right, bottom = 66, 42, 626, 462
    assert (full[top:bottom, left + 1 : right] == 77).all()
    for row, column in ((top - 1, 300), (bottom, 300), (200, left - 1), (200, right)):
        assert full[row, column].tolist() == LINE
    across = np.flatnonzero((full[bottom + 4, left:right] == LINE).all(axis=1))
    # 0, 50 and 100 px: the first pixel is centred half a zoomed pixel from the edge.
    assert across.tolist() == [2, 221, 440]
    down = np.flatnonzero((full[top:bottom, left - 3] == LINE).all(axis=1))
    assert down.tolist() == [round((v + 0.5) * 4.375) for v in (0, 20, 40, 60, 80)]
    bar = full[68:454, 640:658]
    for k, rgb in ((2, diverging_table()[255]), (-3, diverging_table()[0]), (185, diverging_table()[133])):
        assert np.abs(bar[k, 9] - through(rgb)).max() <= 6, k
    marks = np.flatnonzero((full[60:460, 661] == LINE).all(axis=1)) + 60
    assert marks.tolist() == [68, 164, 261, 358, 454]
    ink = full.min(axis=2) < 90
    for row, column in ((475, 287), (131, 52), (164, 672), (262, 668)):  # 50, 20, 1 and 0
        assert ink[row - 7 : row + 8, column - 8 : column + 9].any(), (row, column)
    bare = painter.framed(image, ["a", "b"], 0)
    assert (
        bare.shape == (14 + 2 * 28 + 420 + 14, 14 + 560 + 110 + 28, 3) and (bare[70:490, 14:574] == 77).all()
    )


def test_a_small_map_has_room_for_its_words(strain: Strain) -> None:
    painter = Painter(strain, "eyy", ColourScale(-2.0, 2.0, "%", 100.0), (128, 96))
    assert painter.framed(np.zeros((51, 51, 3), np.uint8), ["a"], 0).shape == (240, 480, 3)
    odd = painter.framed(np.zeros((301, 401, 3), np.uint8), ["a"], 0).shape
    assert odd == (358, 554, 3), "encoders of films need even sides"


def test_the_legend_has_a_box_for_each_status(strain: Strain) -> None:
    painter = Painter(strain, "status", None, (128, 96))
    full = painter.framed(np.zeros((420, 560, 3), np.uint8), ["a"], 0)
    assert full.shape[1] == 14 + 560 + 230 + 28
    for k, status in enumerate((Status.OK, Status(7))):
        rgb = status_colours(np.array([[status]]))[0, 0, :3]
        assert np.abs(full[42 + 24 * k + 8, 588 + 8] - through(rgb)).max() <= 1
        assert full[42 + 24 * k, 588 + 4].tolist() == LINE
        words = full[42 + 24 * k + 2 : 42 + 24 * k + 16, 588 + 25 : 588 + 60].min(axis=2)
        assert (words < 90).any()
    assert (full[42 + 48 + 4 :, 588 + 20 :] == 255).all(), "two statuses"


def test_good_is_green_lost_is_red_and_background_is_grey() -> None:
    shown = {
        Status.OK: (42, 157, 75), Status.NO_PATTERN: (127, 127, 127), Status.CLIPPED: (242, 200, 15),
        Status.OUTSIDE: (148, 103, 189), Status.LOST: (214, 39, 40), Status.NOT_CONVERGED: (255, 127, 14),
        Status.POOR_MATCH: (31, 119, 180), Status.UNEVEN: (140, 86, 75), Status.AMBIGUOUS: (227, 119, 194),
    }  # fmt: skip
    assert {
        status: tuple(status_colours(np.array([[status]]), 255)[0, 0, :3].tolist()) for status in shown
    } == shown
    assert status_colours(np.array([[250]]))[0, 0].tolist() == [60, 60, 60, 184]


def test_cells_have_the_shape_of_their_zois(tmp_path: Path) -> None:
    with open_run(make_run(tmp_path, [0.0], session=False, field_of=deformed)) as run:
        painter, grid = Painter(run.strain, "eyy", None, (128, 96)), run.strain.grid
        moved, fixed = painter._corners(0), painter._corners(None)
    row, column, zoom = 2, 3, 4.375
    gradient = np.array([[0.1, 0.2], [0.3, 0.4]])
    for k, (x, y) in enumerate(((-8, -8), (8, -8), (8, 8), (-8, 8))):
        place = np.array([grid.x[column], grid.y[row]])
        at = place + [2.0, -1.0] + (np.eye(2) + gradient) @ [x, y]
        assert moved[row, column, k] == pytest.approx((at + 0.5) * zoom - 0.5, rel=1e-5)
        assert fixed[row, column, k] == pytest.approx((place + [x, y] + 0.5) * zoom - 0.5)


def test_cells_are_mixed_with_the_picture_by_their_opacity() -> None:
    cells = np.array([[[200, 100, 0, 51]], [[0, 0, 0, 0]]], np.uint8)
    corners = np.array([[[[2, 2], [8, 2], [8, 8], [2, 8]]], [[[0, 0], [9, 0], [9, 9], [0, 9]]]], np.float64)
    picture = np.full((12, 12, 3), 100, np.uint8)
    painted = overlay_quads(picture, cells, corners)
    assert painted[5, 5].tolist() == [80, 100, 120] and painted[0, 0].tolist() == [100] * 3
    assert (picture == 100).all(), "the picture stays"
    assert (
        _mixed(*(np.full((1, 1, 3), v, np.uint8) for v in (0, 200)), np.array([[[255]]], np.uint8))[0, 0, 0]
        == 200
    )


@pytest.mark.parametrize(
    "moved",
    [
        (0.0, 0.0),
        (-40.0, 0.0),
        (0.0, 60.0),
        (0.0, -70.0),
        (-90.0, 0.0),
        (80.0, 0.0),
        (float("nan"), 0.0),
        (500.0, 500.0),
    ],
)
def test_cells_that_leave_the_picture_are_cut(moved: tuple[float, float]) -> None:
    grid = ZoiGrid.cover(Roi(10, 20, 72, 48), size=24, step=12)  # 15.5 to 75.5 px across, 25.5 to 61.5 down
    picture, cells = np.zeros((80, 90, 3), np.uint8), np.full((*grid.shape, 4), 255, np.uint8)
    overlay_cells(picture, 1.0, grid, cells, moved)
    x, y = (0.0 if np.isnan(m) else m for m in moved)
    rows, columns = np.mgrid[:80, :90]
    inside = (columns >= 16 + x) & (columns < 76 + x) & (rows >= 26 + y) & (rows < 62 + y)
    np.testing.assert_array_equal(picture[..., 0] > 0, inside)


def test_grey_levels_fill_the_screen() -> None:
    picture = np.tile(np.arange(1001, dtype=np.uint16), (4, 1))
    levels = Levels.of(picture[:, ::1])
    assert (levels.black, levels.white) == (pytest.approx(5, abs=3), pytest.approx(995, abs=6))
    shown = Levels(100, 355).shown(np.array([[0, 100, 150, 355, 900]], np.uint16))
    assert shown.tolist() == [[0, 0, 50, 255, 255]]
    flat = Levels.of(np.full((4, 4), 7))
    assert (flat.black, flat.white) == (7, 8)


@pytest.mark.parametrize(
    ("size", "longest", "painted"),
    [((128, 96), 1280, (560, 420)), ((1280, 960), 1280, (1280, 960)), ((2560, 1000), 1280, (1280, 500)),
     ((700, 300), 1280, (700, 300)), ((128, 96), 320, (320, 240)), ((301, 99), 1280, (560, 184))],
)  # fmt: skip
def test_the_size_of_a_painted_picture(
    strain: Strain, size: tuple[int, int], longest: int, painted: tuple[int, int]
) -> None:
    assert Painter(strain, "eyy", None, size, longest).size == painted


def test_the_caption_has_time_and_force(strain: Strain) -> None:
    assert caption(strain, 1) == "t = 0.100 s   F = 1\u202f400.0 N"
    strain.values["force_N"][1] = np.nan
    assert caption(strain, 1) == "t = 0.100 s"


# -- the map over the reference -------------------------------------------------------------------


def test_a_low_pass_is_that_of_its_width_and_leaves_gaps() -> None:
    impulse = np.zeros((31, 31))
    impulse[15, 15] = 1.0
    np.testing.assert_allclose(
        for_display(impulse, 8, 16.0, 1), gaussian_filter(impulse, 2.0, mode="nearest"), atol=1e-12
    )
    holed = np.full((15, 15), 3.0)
    holed[4:7, 4:7] = np.nan
    before = holed.copy()
    treated = for_display(holed, 8, 16.0, 3)
    np.testing.assert_array_equal(holed, before)
    assert np.array_equal(np.isnan(treated), np.isnan(holed))
    np.testing.assert_allclose(treated[~np.isnan(holed)], 3.0, rtol=1e-9)
    spike = np.ones((9, 9))
    spike[4, 4] = 50.0
    assert (for_display(spike, 8, 0.0, 3) == 1.0).all() and for_display(spike, 8, 0.0, 1)[4, 4] == 50.0


def test_a_map_lies_where_its_zois_were(tmp_path: Path) -> None:
    """On the reference: the motion of the instant does not show."""
    with open_run(make_run(tmp_path, [0.0], session=False, field_of=deformed)) as run:
        image = draw(run.strain, MapRequest("dv_dy", limit=0.4), None)
        background = draw(run.strain, MapRequest("dv_dy", limit=0.4), np.zeros((192, 256), np.uint8))
    assert image.shape == (510, 764, 3)
    inside = image[42:462, 66:626].astype(int)
    rows, columns = np.nonzero(inside[..., 2] - inside[..., 0] > 60)
    # From half a step before the first centre: 7.5 to 119.5 px across; the first ZOI is not there.
    assert (columns.min(), columns.max()) == (
        pytest.approx(8 * 4.375, abs=2),
        pytest.approx(120 * 4.375, abs=2),
    )
    assert (rows.min(), rows.max()) == (pytest.approx(8 * 4.375, abs=2), pytest.approx(88 * 4.375, abs=2))
    assert background.shape == (42 + 420 + 48, 764, 3)
    dark = background[42:462, 66:626].astype(int)
    rows, columns = np.nonzero(dark[..., 2] - dark[..., 0] > 60)
    assert columns.max() == pytest.approx(120 * 4.375 / 2, abs=2), "of a picture twice as wide"


def test_a_map_is_saved_as_a_new_file(tmp_path: Path) -> None:
    image = np.full((20, 30, 3), 200, np.uint8)
    save(image, tmp_path / "a.PNG")
    assert (tmp_path / "a.PNG").read_bytes().startswith(b"\x89PNG")
    save(image, tmp_path / "a.jpg")
    assert (tmp_path / "a.jpg").read_bytes().startswith(b"\xff\xd8")
    with pytest.raises(DataError, match="cannot be written"):
        save(image, tmp_path / "a.jpg" / "a.png")


# -- ranges ---------------------------------------------------------------------------------------


def test_a_range_shrinks_to_data_below_a_half_of_it() -> None:
    """Below 0.55 of the range, for twenty maps without a break."""
    auto = AutoRange()
    assert auto.update(np.full((2, 2), 1e-3))[1] == pytest.approx(1.2e-3)
    large = np.full((2, 2), 0.56 * 1.2e-3 / 1.05)
    small = np.full((2, 2), 0.54 * 1.2e-3 / 1.05)
    assert {auto.update(large)[1] for _ in range(50)} == {1.2e-3}
    assert {auto.update(small)[1] for _ in range(19)} == {1.2e-3}
    auto.update(large)
    assert {auto.update(small)[1] for _ in range(19)} == {1.2e-3}
    assert auto.update(small)[1] == pytest.approx(8e-4)
    assert auto.update(-2 * large)[:2] == pytest.approx((-1.5e-3, 1.5e-3)), "and grows at once"


def test_a_free_range_is_never_empty() -> None:
    low, high, _ = AutoRange("free").update(np.full((3, 3), 100.0))
    assert (low, high) == (pytest.approx(99.94), pytest.approx(100.06, abs=0.01)) and low < 100 < high
    low, high, _ = AutoRange("free").update(np.zeros((3, 3)))
    assert low <= -4e-7 and 4e-7 <= high <= 2e-6
    low, high, _ = AutoRange("free").update(np.array([[1.0, 2.0]]), np.array([[1.0]]))
    assert high - low >= 8.0 and (low + high) / 2 == pytest.approx(1.5, abs=1.0)


def test_one_scale_holds_for_all_instants(strain: Strain) -> None:
    scale = ColourScale.of_run(strain, "v", [0, 1])
    v = strain.maps("v", 1)
    assert scale.unit == "px" and scale.low <= np.nanmin(v[v > -1]) and scale.high >= 0.95 * np.nanmax(v)
    sigma = ColourScale.of_run(strain, "sigma_eyy", [0, 1])
    assert (sigma.low, sigma.high, sigma.unit) == (0.0, 12.0, "µm/m")
    shown = ColourScale.of_run(strain, "v", [0, 1], None, "mm", -0.5)
    assert (shown.unit, shown.low, shown.high) == ("mm", -0.5 * scale.high, -0.5 * scale.low)
    assert ColourScale.of_run(strain, "eyy", [1], 0.005).high == 5000.0
    assert ColourScale.of_run(strain, "eyy", [0]).high >= 40.0, "noise reaches a quarter"
    assert range_kind("iterations") == range_kind("v") == "free" and range_kind("blur") == "from zero"


@pytest.mark.parametrize(
    ("t", "number"), [(-5.0, 0), (0.4, 0), (0.6, 1), (1.0, 1), (1.4, 1), (1.7, 2), (9.0, 2)]
)
def test_the_picture_nearest_in_time(t: float, number: int) -> None:
    assert _nearest([0.0, 1.0, 2.0], 3, t) == number
