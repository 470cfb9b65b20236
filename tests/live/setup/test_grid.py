"""Where ZOIs may lie, the drawing of a set-up, and the radius of a check."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.errors import ConfigError
from analysis import COMPILE_PARTS, Roi, ZoiGrid
from analysis.optics import Readout
from live.commands.readout import rounded_ms
from live.config.loading import Config, load_config
from live.setup import compiling
from live.setup.check import check_list
from live.setup.grid import auto_gauges, grid_for, plates_for, whole_picture
from live.setup.lens import lens_for
from live.setup.region import Region
from live.setup.specimen_drawing import (
    BACKGROUND,
    BOTTOM,
    EDGE,
    GAUGE,
    LEFT,
    TOP,
    Overlay,
    _Drawing,
    _legend,
    _ticks,
    snapshot,
)

SMALL: dict[str, Any] = {"measure.zoi": 16, "measure.step": 8}


def config(**more: Any) -> Config:
    return load_config(None, SMALL | {key.replace("__", "."): value for key, value in more.items()})


@pytest.mark.parametrize(
    ("size", "zoi", "region"),
    [
        ((200, 120), 32, (4, 4, 192, 112)),
        ((200, 40), 32, (4, 4, 192, 32)),
        ((200, 39), 32, (0, 0, 200, 39)),
        ((100, 90), 20, (2, 2, 96, 86)),
    ],
)
def test_the_whole_picture_has_a_rim_of_an_eighth_of_a_zoi_where_it_fits(
    size: tuple[int, int], zoi: int, region: tuple[int, ...]
) -> None:
    assert whole_picture(*size, zoi) == region


@pytest.mark.parametrize("roi", [[1, 0, 200, 120], [0, 1, 200, 120]])
def test_a_region_may_reach_the_edge_and_not_beyond(roi: list[int]) -> None:
    grid = grid_for(config(measure__roi=[0, 0, 200, 120]), 200, 120, None)
    assert (grid.roi.width, grid.roi.height, grid.size, grid.step) == (200, 120, 16, 8)
    with pytest.raises(ConfigError, match="leaves the picture of 200 x 120 px"):
        grid_for(config(measure__roi=roi), 200, 120, None)


@pytest.mark.parametrize(("box", "fits"), [([140, 40, 60, 80], True), ([141, 40, 60, 80], False),
                                           ([140, 41, 60, 80], False)])  # fmt: skip
def test_a_plate_may_reach_the_edge_and_not_beyond(box: list[int], fits: bool) -> None:
    given = config(measure__roi=[0, 0, 120, 120], plate__right={"box": box})
    grid, words = grid_for(given, 200, 120, None), r"plate\.right: the box leaves the picture of 200 x 120 px"
    with nullcontext() if fits else pytest.raises(ConfigError, match=words):
        found = plates_for(given, grid, 200, 120)
        assert found is not None and list(found.plates) == ["right"]


def test_zois_with_a_pixel_on_a_plate_are_not_of_the_specimen() -> None:
    given = config(measure__roi=[0, 0, 120, 48], plate__right={"box": [71, 0, 60, 48]})
    grid = grid_for(given, 200, 48, None)
    left = grid.first_x[grid.active.any(axis=0)]
    assert left.max() == 48, "the next one, from 56 on, reaches to 71"
    assert grid.active[:, left.size - 1].all()


LENS: dict[str, Any] = {
    "lens.focal_px": 500.0, "lens.centre": [99.5, 59.5], "lens.k1": -0.02, "lens.picture": [200, 120],
}  # fmt: skip


@pytest.mark.parametrize(
    ("box", "holds"),
    [
        ([7.5, 7.5, 184, 104], True),
        ([7.6, 7.5, 184, 104], False),
        ([7.5, 7.6, 184, 104], False),
        ([7.5, 7.5, 183.9, 104], False),
        ([7.5, 7.5, 184, 103.9], False),
    ],
)
def test_a_lens_holds_where_it_was_calibrated(box: list[float], holds: bool) -> None:
    """The centres of the ZOIs lie from 7.5 to 191.5 and from 7.5 to 111.5 px."""
    given, grid = (
        load_config(None, SMALL | LENS | {"lens.box": box}),
        ZoiGrid.cover(Roi(0, 0, 200, 120), 16, 8),
    )
    assert (grid.x[-1], grid.y[-1]) == (191.5, 111.5)
    with nullcontext() if holds else pytest.raises(ConfigError, match="leave the calibrated part"):
        lens = lens_for(given, 200, 120, grid)
        assert lens.parameters.tolist() == [500.0, 99.5, 59.5, -0.02, 0.0, 0.0, 0.0, 0.0]
    with pytest.raises(ConfigError, match="calibrated with pictures of 200 x 120 px, these have 120 x 200"):
        lens_for(given, 120, 200, grid)


def test_a_readout_time_is_written_in_milliseconds_and_is_that_of_a_shutter() -> None:
    assert rounded_ms(Readout(0.0123456, 0.000123)) == {
        "camera.readout_ms": 12.346, "camera.sigma_readout_ms": 0.12,
    }  # fmt: skip
    for seconds in (0.0, -0.01, 10.0):
        with pytest.raises(ConfigError, match="is no readout time"):
            rounded_ms(Readout(seconds, 0.001))


@pytest.mark.parametrize("axis", ["x", "y"])
def test_automatic_gauges_lie_along_and_across_the_load(axis: str) -> None:
    """The gauge across is a tenth of the specimen long, that is a row of ZOIs and its two neighbours."""
    grid = ZoiGrid.cover(Roi(20, 40, 176, 96) if axis == "x" else Roi(40, 20, 96, 176), 16, 8)
    turned = {name: table["box"] for name, table in auto_gauges(grid, axis).items()}
    assert turned["extension"] == turned["area"]
    whole, width = (turned[name] if axis == "y" else _transposed(turned[name]) for name in ("area", "width"))
    assert whole == (43.0, 23.0, 89.0, 169.0)
    assert width == (43.0, 95.0, 89.0, 25.0)


def test_the_gauge_across_avoids_a_hole() -> None:
    mask = np.ones((176, 96), bool)
    mask[70:100, 30:66] = False
    grid = ZoiGrid.cover(Roi(0, 0, 96, 176), 16, 8, mask)
    _, top, _, height = auto_gauges(grid, "y")["width"]["box"]
    assert top + height <= 70 + 8 or top >= 100 - 8


def _transposed(box: tuple[float, ...]) -> tuple[float, ...]:
    x, y, width, height = box
    return y, x, height, width


GRID = ZoiGrid.cover(Roi(100, 50, 300, 200), 32, 16)
PICTURE = np.tile(np.arange(500, dtype=np.uint16), (300, 1))


def test_outside_the_region_the_picture_is_dark_and_the_edge_is_drawn() -> None:
    drawing = _Drawing.of(PICTURE)
    before = drawing.canvas.copy()
    drawing.region(Overlay(Region((100, 50, 300, 200), None, ""), GRID))
    assert drawing.zoom == 1.0 and drawing.canvas.shape == (300, 500, 3)
    assert (drawing.canvas[60:240, 110:390] == before[60:240, 110:390]).all()
    assert (drawing.canvas[:40] == (before[:40] * 0.45).astype(np.uint8)).all()
    assert (drawing.canvas[150, 99:102] == EDGE).all(axis=1).any()


@pytest.mark.parametrize(
    ("size", "zoom", "drawn"),
    [((250, 100), 2.0, (500, 200)), ((1800, 100), 1.0, (1800, 100)), ((3600, 400), 0.5, (1800, 200))],
)
def test_a_drawing_has_a_size_that_can_be_looked_at(
    size: tuple[int, int], zoom: float, drawn: tuple[int, int]
) -> None:
    drawing = _Drawing.of(np.tile(np.arange(size[0], dtype=np.uint8), (size[1], 1)))
    assert drawing.zoom == zoom and drawing.canvas.shape[1::-1] == drawn
    assert drawing.at(10.2, 20.0) == (round(10.2 * zoom), round(20 * zoom))


def test_grey_levels_are_spread_from_dark_to_bright() -> None:
    values = _Drawing.of(np.linspace(1000, 1100, 250_000).reshape(500, 500)).canvas[..., 0]
    assert values[0, 0] == 0 and values[-1, -1] == 255 and values[250, 0] == pytest.approx(127, abs=1)


def test_gauges_are_drawn_where_they_are_on_a_page_with_a_ruler() -> None:
    gauges = {"axial": {"kind": "line", "start": [200, 80], "end": [200, 220]}, "half": {"kind": "line"}}
    page = snapshot(PICTURE, Overlay(Region(None, None, ""), GRID, gauges=gauges))
    assert page.shape == (300 + TOP + BOTTOM, 500 + LEFT, 3)
    assert (page[TOP + 150, LEFT + 198 : LEFT + 203] == GAUGE).all(axis=1).any()
    assert (page[TOP + 250, LEFT + 198 : LEFT + 203] != GAUGE).all()
    assert (page[-2, -2] == BACKGROUND).all()


@pytest.mark.parametrize(
    ("length", "zoom", "ticks"),
    [
        (500, 1.0, [("0", 0), ("100", 100), ("200", 200), ("300", 300), ("400", 400), ("500", 500)]),
        (450, 0.5, [("0", 0), ("200", 100), ("400", 200), ("600", 300), ("800", 400)]),
        (300, 30.0, [("0", 0), ("5", 150), ("10", 300)]),
        (299, 20.0, [("0", 0), ("5", 100), ("10", 200)]),
        (250, 90.0, [("0", 0), ("2", 180)]),
    ],
)
def test_the_ruler_has_round_values_about_every_hundred_px(
    length: int, zoom: float, ticks: list[tuple[str, int]]
) -> None:
    assert list(_ticks(length, zoom)) == ticks


def test_the_legend_counts_what_is_within_the_target() -> None:
    sigma = np.full(GRID.shape, 2e-4)
    sigma[0, :3] = 1e-4, np.nan, 0.5e-4
    count = GRID.n_active
    overlay = Overlay(Region(None, None, ""), GRID, sigma=sigma, target=1e-4)
    assert _legend(overlay).startswith(f"2 of {count} ZOIs of 32 px within 100 µm/m (green);")
    assert _legend(replace(overlay, sigma=None)) == f"{count} ZOIs of 32 px"


def test_the_radius_is_that_of_all_pixels_at_the_zois(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[Any] = []
    monkeypatch.setattr(check_list, "speckle_radius", lambda *values: given.extend(values) or 2.0)
    at_zois = np.zeros((100, 120), bool)
    at_zois[30:41, 50:71] = True
    mean = np.arange(80 * 100, dtype=np.float32).reshape(80, 100)
    region = SimpleNamespace(at_zois=at_zois, cut=(slice(10, 90), slice(20, 120)))
    sample: Any = SimpleNamespace(check_region=region, noise=4.0, picture=SimpleNamespace(n=16, mean=mean))
    assert check_list._radius(sample) == 2.0
    picture, noise, where = given
    assert np.array_equal(picture, mean[20:31, 30:51]) and where.all() and where.shape == (11, 21)
    assert noise == 1.0
    region.at_zois = np.zeros((100, 120), bool)
    assert np.isnan(check_list._radius(sample))


def test_each_part_of_the_compilation_does_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[Any] = []
    monkeypatch.setattr("analysis.warm_up", lambda *given: done.append(("warm up", *given)))
    monkeypatch.setattr("acquire.hdf5.compile_loops", lambda: done.append("files"))
    monkeypatch.setattr("acquire.burst.compile_loops", lambda kinds: done.append(("bursts", kinds)))
    monkeypatch.setattr(compiling.signal, "signal", lambda *given: None)
    monkeypatch.setattr(compiling, "unblock_signals", lambda number: None)
    first, second = COMPILE_PARTS[0], COMPILE_PARTS[1]
    assert compiling.main(first, "uint8,float32", "phase") == 0
    assert done == [("warm up", first, ["uint8", "float32"]), "files"]
    done.clear()
    assert compiling.main(second, "uint8,float32", "-") == 0
    assert done == [("warm up", second, ["uint8", "float32"]), ("bursts", ("uint8",))]
    done.clear()
    assert compiling.main(second, "float32", "phase") == 0
    assert done[1:] == [("bursts", ()), ("warm up", "phase")]
    with pytest.raises(ConfigError, match="no part of the compilation"):
        compiling.main("none", "uint8", "-")
