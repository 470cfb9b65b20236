"""The drawing of a set-up and the radius of a check."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquire.errors import ConfigError
from analysis import COMPILE_PARTS, Roi, ZoiGrid
from live.setup import compiling
from live.setup.check import check_list
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
