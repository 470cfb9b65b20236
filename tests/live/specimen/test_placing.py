"""Gauges that place themselves: on the specimen, beside holes, right in any strain."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from acquire.errors import ConfigError
from analysis import Roi, ZoiGrid
from live.setup import gauges_for, load_config
from live.specimen import auto_gauges, with_auto_gauges
from tests.live.made_up import make_field

BOX = Roi(100, 40, 120, 500)


def strip(*holes: tuple[int, int, int], slope: float = 0.0) -> np.ndarray:
    """A strip 120 px wide and 500 px high, with round holes (x, y, radius) or leaning by ``slope``."""
    y, x = np.mgrid[:600, :400]
    mask = (x >= 100 + slope * y) & (x < 220 + slope * y) & (y >= 40) & (y < 540)
    for x0, y0, radius in holes:
        mask &= np.hypot(x - x0, y - y0) > radius
    return np.asarray(mask)


def grid_on(mask: np.ndarray, size: int = 32, step: int = 8) -> ZoiGrid:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    x, y = int(columns[0]), int(rows[0])
    return ZoiGrid.cover(Roi(x, y, int(columns[-1]) + 1 - x, int(rows[-1]) + 1 - y), size, step, mask)


def test_axial_spans_four_fifths_of_the_specimen_in_its_middle() -> None:
    gauges = auto_gauges(grid_on(strip()), "y")
    axial = gauges["axial"]
    assert axial["end"][1] - axial["start"][1] == pytest.approx(0.8 * 500, abs=8)
    assert axial["start"][0] == axial["end"][0] == pytest.approx(159.5, abs=4)
    assert list(gauges) == ["axial", "transverse", "area"]


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize(
    "mask",
    [strip(), strip((160, 290, 40)), strip((160, 90, 30)), strip(slope=0.3)],
    ids=["plain", "hole", "hole at an end", "leaning"],
)
def test_all_are_on_zois_and_read_the_strain(mask: np.ndarray, axis: str) -> None:
    mask = mask if axis == "y" else mask.T
    grid = grid_on(mask)
    config = load_config(None, {"measure.gauges": "auto", "specimen.axis": axis})
    config = with_auto_gauges(config, grid)
    assert config.measure.gauges == "given"
    field = make_field(grid, 1e-3)
    across = "exx" if axis == "y" else "eyy"
    along = "eyy" if axis == "y" else "exx"
    values = {g.name: g.measure(field) for g in gauges_for(config.gauges, config.specimen.first_axis, grid)}
    assert list(values) == ["axial", "transverse", "area"]
    assert values["area"].value == pytest.approx(field.mean(along)[0], abs=1e-9)
    # The ends of a line on a leaning strip stand aslant.
    assert values["transverse"].value == pytest.approx(field.mean(across)[0], rel=0.03)
    assert values["axial"].value == pytest.approx(field.mean(along)[0], rel=0.15)


def test_the_transverse_one_keeps_off_a_hole() -> None:
    grid = grid_on(strip((160, 290, 40)))
    box = auto_gauges(grid, "y")["transverse"]["box"]
    assert box is not None
    _, y, _, height = box
    assert y > 290 + 40 or y + height < 290 - 40


def test_what_is_given_stays(tmp_path: Any) -> None:
    own = {"kind": "area", "box": [120, 100, 60, 60]}
    config = load_config(None, {"measure.gauges": "auto", "gauges.axial": own, "gauges.mine": own})
    placed = with_auto_gauges(config, grid_on(strip()))
    assert placed.gauges["axial"]["kind"] == "area"
    assert list(placed.gauges) == ["axial", "transverse", "area", "mine"]
    assert with_auto_gauges(placed, grid_on(strip())) is placed


def test_a_narrow_specimen_has_no_transverse_one() -> None:
    grid = ZoiGrid.cover(Roi(10, 10, 36, 200), 32, 8)
    assert list(auto_gauges(grid, "y")) == ["axial", "area"]


def test_too_short_a_specimen_is_refused() -> None:
    with pytest.raises(ConfigError, match="1 rows of ZOIs lie along the load"):
        auto_gauges(ZoiGrid.cover(Roi(10, 10, 200, 36), 32, 8), "y")
