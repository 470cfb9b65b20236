"""Where ZOIs may lie: the picture and its rim, plates, and the part of it that a lens was calibrated for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from acquire.errors import ConfigError
from analysis import Roi, ZoiGrid
from analysis.optics import Readout
from live.config.loading import Config, load_config
from live.setup.grid import grid_for, plates_for, whole_picture
from live.setup.lens import lens_for
from live.setup.placement import auto_gauges
from live.setup.readout import rounded_ms

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
    grid = grid_for(given, 200, 120, None)
    if fits:
        found = plates_for(given, grid, 200, 120)
        assert found is not None and list(found.plates) == ["right"]
    else:
        with pytest.raises(ConfigError, match=r"plate\.right: the box leaves the picture of 200 x 120 px"):
            plates_for(given, grid, 200, 120)


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
    if holds:
        lens = lens_for(given, 200, 120, grid)
        assert lens is not None
        assert lens.parameters.tolist() == [500.0, 99.5, 59.5, -0.02, 0.0, 0.0, 0.0, 0.0]
        with pytest.raises(
            ConfigError, match="calibrated with pictures of 200 x 120 px, these have 120 x 200"
        ):
            lens_for(given, 120, 200, grid)
    else:
        with pytest.raises(ConfigError, match="leave the calibrated part"):
            lens_for(given, 200, 120, grid)


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
