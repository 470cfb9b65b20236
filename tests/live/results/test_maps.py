"""Maps as pictures: colours, units and ticks, the file with its filters, and refusals."""

from __future__ import annotations

import contextlib
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.cv2_loader import drawn_letters
from acquire.errors import ConfigError
from analysis import Roi, ZoiGrid
from analysis.field import Status
from live.cli import main
from live.commands.map import MapRequest, draw
from live.results.maps import painting
from live.results.maps.colours import (
    colour,
    diverging_table,
    nice_above,
    number,
    sequential_table,
    ticks,
    unit_for,
)
from live.results.maps.painting import FIELD_MAPS, FieldMaps
from live.results.maps.scale import (
    AutoRange,
    ColourRange,
    ColourScale,
    range_kind,
    status_colours,
    status_legend,
)
from live.results.reader import Strain
from tests.live.ended import code_of
from tests.live.made_up import make_field, make_grid
from tests.live.shots import write_shots


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


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_shots(tmp_path_factory.mktemp("maps"), (160, 192), (0.0, 1e-3))
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
        (["--limit", "nan"], 2, "give a number"),
        (["--low-pass", "inf"], 2, "give a number"),
        (["--median", "4"], 2, "an odd number from 1 to 51"),
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
    ("more", "refused"),
    [
        ({"median": 51}, ""),
        ({"median": 53}, "an odd number from 1 to 51"),
        ({"median": 1}, ""),
        ({"median": 2}, "an odd number"),
        ({"median": -3}, "an odd number"),
        ({"low_pass_px": 112.0}, ""),  # 7 ZOIs, 16 px apart
        ({"low_pass_px": 112.1}, "the extent of the grid"),
        ({"low_pass_px": -1.0}, "a low-pass of -1"),
        ({"deconvolution": 100}, ""),
        ({"deconvolution": 101}, "allowed: 0 to 100 steps"),
        ({"deconvolution": -1}, "allowed: 0 to 100 steps"),
        ({"deconvolution": 1, "sharpened": 4}, ""),
        ({"deconvolution": 1, "sharpened": 5}, "allowed: 0 to 4 times"),
        ({"sharpened": 1}, "only a deconvolved map can be sharpened; add --deconvolve STEPS"),
        ({"limit": 1e-9}, ""),
        ({"limit": 0.0}, "a limit of 0.0"),
        ({"limit": -1.0}, "a limit of -1.0"),
    ],
)
def test_the_limits_of_a_request(more: dict[str, Any], refused: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(refused)) if refused else contextlib.nullcontext():
        MapRequest("eyy", **more).check(make_grid())


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


def full(value: float) -> np.ndarray:
    return np.full((4, 4), value)


def test_a_fixed_range_and_an_empty_map() -> None:
    assert AutoRange(fixed=5e-3).update(full(1.0), full(0.0)) == (-5e-3, 5e-3, True)
    assert AutoRange("from zero", 5e-3).update(full(1.0)) == (0, 5e-3, False)
    for kind in ("about zero", "from zero", "free"):
        low, high, _ = AutoRange(kind).update(full(np.nan), full(np.nan))
        assert low < high
        auto = AutoRange(kind)
        known = auto.update(full(0.0))
        assert known.low < known.high and auto.update(full(np.nan)) == known


@pytest.mark.parametrize(
    ("name", "kind"),
    [("eyy", "free"), ("du_dx", "free"), ("u", "free"), ("blur", "from zero"), ("sigma_v", "from zero"),
     ("sigma", "from zero"), ("residual", "from zero")],
)  # fmt: skip
def test_where_the_colours_lie(name: str, kind: str) -> None:
    assert range_kind(name) == kind


def test_the_colours_run_from_one_end_of_the_scale_to_the_other() -> None:
    for name, span in (
        ("eyy", ColourRange(-1e-3, 1e-3, True)), ("sigma_eyy", ColourRange(0.0, 2e-5)), ("u", ColourRange(3.0, 5.0)),
    ):  # fmt: skip
        scale, table = (
            ColourScale.of(name, span),
            diverging_table() if span.is_diverging else sequential_table(),
        )
        ends = scale.colours(np.array([[span.low, span.high, np.nan]]))[0]
        assert (ends[0, :3] == table[0]).all() and (ends[1, :3] == table[-1]).all(), name
        assert (scale.ramp(64)[[0, -1]] == table[[0, -1]]).all() and len(scale.ramp(64)) == 64
        assert ends[2, 3] == 0


def test_units() -> None:
    assert ColourScale.of("eyy", ColourRange(-0.03, 0.03, True)) == ColourScale(-3.0, 3.0, "%", 100.0, True)
    assert ColourScale.of("sigma_eyy", ColourRange(0.0, 2e-5)) == ColourScale(0.0, 20.0, "µm/m", 1e6)
    assert ColourScale.of("v", ColourRange(1.0, 2.0)) == ColourScale(1.0, 2.0, "px", 1.0)
    assert ColourScale.of("v", ColourRange(1.0, 2.0), "mm", -0.5) == ColourScale(-1.0, -0.5, "mm", -0.5)
    assert ColourScale.of("exy", ColourRange(-1e-3, 1e-3), factor=-1.0) == ColourScale(
        -1000.0, 1000.0, "µm/m", -1e6
    )
    assert ColourScale.of("residual", ColourRange(0.0, 3.0)).unit == "chi²"


def test_every_map_has_colours_and_a_scale_or_a_legend() -> None:
    grid = make_grid()
    field = make_field(grid, 1e-3)
    painted = FieldMaps("y", is_symmetric=True).paint(field, FIELD_MAPS)
    assert set(painted) == set(FIELD_MAPS)
    valid = field.ok
    for name, one in painted.items():
        assert one.rgba.shape == (*grid.shape, 4)
        assert (one.rgba[valid][:, 3] > 0).all(), name
        assert (one.scale is None) == (name == "status")
    scale = painted["eyy"].scale
    assert scale is not None and scale.low == -scale.high and scale.high >= 1000 and scale.unit == "µm/m"
    assert painted["e1"].scale == scale  # tension along y: the largest principal strain
    assert painted["sigma"].scale is not None and painted["sigma"].scale.low == 0


def test_the_principal_strains_are_of_the_measure_that_is_shown() -> None:
    field = replace(make_field(make_grid(), 0.1), measure="green")
    maps = FieldMaps("y").paint(field, ("eyy", "e1"))
    np.testing.assert_array_equal(maps["e1"].rgba, maps["eyy"].rgba)


def test_colours_over_the_values_there_are() -> None:
    grid = make_grid()
    maps = FieldMaps("y")
    scale = maps.paint(make_field(grid, 1e-3), ("eyy",))["eyy"].scale
    assert scale is not None and 0 < scale.low <= 1000 <= scale.high < 1100
    fixed = FieldMaps("y", 0.01).paint(make_field(grid, 1e-3), ("eyy",))["eyy"].scale
    assert fixed is not None and (fixed.low, fixed.high) == (-1.0, 1.0) and fixed.unit == "%"


def test_statuses_have_one_colour_each_and_a_legend() -> None:
    statuses = np.array([[*Status, 99, Status.OK]], np.uint8)
    cells, legend = status_colours(statuses)[0], status_legend(statuses)
    assert cells[Status.NOT_MEASURED, 3] == 0
    shown = {one.name: one for one in legend}
    assert "NOT_MEASURED" not in shown and shown["OK"].count == 2 and shown["status 99"].count == 1
    for status in Status:
        if status != Status.NOT_MEASURED:
            assert tuple(cells[status, :3]) == shown[status.name].rgb
            assert shown[status.name].text == status.text
    assert len({one.rgb for one in legend}) == len(legend), "a colour stands for one status"


RAMP = np.linspace(0.0, 1e-3, 101)


@pytest.mark.parametrize(
    ("kind", "values", "span"),
    [
        ("about zero", RAMP, (-1.2e-3, 1.2e-3, True)),  # 1.05 times the 98th percentile, rounded up
        ("about zero", -RAMP, (-1.2e-3, 1.2e-3, True)),
        ("from zero", 0.9 * RAMP, (0.0, 1e-3, False)),
        ("free", 3.0 + 100 * RAMP, (3.0, 3.1, False)),
        ("free", 1.9 * RAMP - 9e-4, (-1.2e-3, 1.2e-3, True)),
    ],
)
def test_the_range_of_one_map(kind: str, values: np.ndarray, span: tuple[float, float, bool]) -> None:
    *ends, is_diverging = AutoRange(kind).update(values)  # type: ignore[arg-type]
    assert ends == pytest.approx(list(span[:2])) and is_diverging == span[2]


@pytest.mark.parametrize(
    ("low", "sigma", "is_diverging"),
    [
        (-0.05, 0.0, False),
        (-0.098, 0.0, False),
        (-0.102, 0.0, True),
        (-0.5, 0.124, True),
        (-0.5, 0.126, False),
    ],
)
@pytest.mark.parametrize("sign", [1, -1])
def test_colours_are_about_zero_where_values_lie_on_both_sides(
    sign: int, low: float, sigma: float, is_diverging: bool
) -> None:
    """The smaller end above a tenth of the larger, and above four sigma."""
    values = sign * np.concatenate([np.full(500, low), np.full(500, 1.0)])
    found = AutoRange("free").update(values, np.full(1000, sigma))
    assert found.is_diverging is is_diverging
    assert (found.low == -found.high) is is_diverging or sigma
    assert found.low <= values.min() and values.max() <= found.high


def test_noise_beyond_zero_is_no_part_of_the_range() -> None:
    values, sigmas = np.concatenate([np.full(500, -0.02), np.full(500, 1.0)]), np.full(1000, 0.01)
    assert AutoRange("free").update(values, sigmas) == ColourRange(0.0, 1.0)
    assert AutoRange("free").update(-values, sigmas) == ColourRange(-1.0, 0.0)
    assert AutoRange("free").update(3 * values, sigmas).low < 0, "more than noise"


def test_a_map_that_grows_to_one_side_becomes_sequential_after_a_while() -> None:
    auto = AutoRange("free", shrink_after=3)
    assert auto.update(2 * RAMP - 1e-3) == ColourRange(-1.2e-3, 1.2e-3, True)
    assert [auto.update(RAMP).is_diverging for _ in range(3)] == [True, True, False]
    assert auto.update(2 * RAMP - 1e-3).is_diverging, "and back at once"


def test_two_percent_may_lie_beyond_the_colours() -> None:
    values = np.full(1000, 1e-3)
    values[:19] = 1.0
    assert AutoRange().update(values)[:2] == pytest.approx((-1.2e-3, 1.2e-3))
    values[:30] = 1.0
    assert AutoRange().update(values)[1] > 1


def test_noise_reaches_a_quarter_of_the_range() -> None:
    span = AutoRange().update(np.full(100, 1e-5), np.full(100, 1e-4))
    assert span[:2] == pytest.approx((-4e-4, 4e-4))


def test_the_colour_of_a_value_is_its_place_in_the_range() -> None:
    table = diverging_table()
    found = colour(np.array([[-2.0, -1.0, -0.5, 0.5, 1.0, 7.0, np.nan]]), -1.0, 1.0, table, alpha=200)[0]
    assert found[:-1, :3].tolist() == table[[0, 0, 64, 191, 255, 255]].tolist()
    assert found[:, 3].tolist() == [200] * 6 + [0]
    table = sequential_table()
    scale = ColourScale.of("eyy", ColourRange(-1e-3, 3e-3))
    middle = scale.colours(np.array([[1e-3, 3e-3, -1e-3]]), 255)[0]
    assert middle[:, :3].tolist() == table[[128, 255, 0]].tolist()


def test_round_numbers() -> None:
    assert [nice_above(v) for v in (1.0, 1.01, 1.3, 8.1, 0.021)] == [1.0, 1.2, 1.5, 10.0, 0.025]
    assert ticks(-1.0, 1.0) == [-1.0, -0.5, 0.0, 0.5, 1.0]
    assert [unit_for(v).name for v in (0.0099, 0.01)] == ["µm/m", "%"]
