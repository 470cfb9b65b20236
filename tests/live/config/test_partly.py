"""A gauge that is partly off the region or over a hole is named, with the share of its area."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from analysis import Roi, StrainField, ZoiGrid
from analysis.evaluate import GaugeSet
from live.config.gauges import make_gauge, partly

REGION = Roi(100, 100, 400, 300)


def words(table: dict[str, Any], name: str = "mine", mask: np.ndarray | None = None) -> str:
    grid = ZoiGrid.cover(REGION, 32, 8, mask)
    return str(partly(make_gauge(name, table, "y"), grid))


def left_out(words: str) -> int:
    """Per cent of the area of a gauge that has no ZOIs."""
    found = re.search(r"(\d+)% of its area", words)
    assert found, words
    return int(found[1])


@pytest.mark.parametrize("name", ["mine", "area"])  # the names of automatic gauges are those of a page too
@pytest.mark.parametrize(
    ("table", "share"),
    [
        ({"kind": "area", "box": [0, 100, 200, 300]}, 50),
        ({"kind": "area", "box": [400, 300, 400, 300]}, 92),
        ({"kind": "area", "corners": [[400, 100], [600, 100], [600, 300], [400, 300]]}, 50),
        ({"kind": "transverse", "box": [-100, 200, 400, 50]}, 50),
        ({"kind": "circle", "centre": [100, 250], "radius_px": 60}, 50),
        ({"kind": "strip", "start": [300, 0], "end": [300, 200]}, 50),
    ],
)
def test_the_share_off_the_region_is_told(table: dict[str, Any], share: int, name: str) -> None:
    assert left_out(words(table, name)) == pytest.approx(share, abs=2)


@pytest.mark.parametrize(
    "table",
    [
        {"kind": "area", "box": [100, 100, 400, 300]},
        {"kind": "extension", "box": [95, 95, 410, 310]},
        {"kind": "zoi", "at": [100, 110]},
        {"kind": "circle", "centre": [300, 250], "radius_px": 3},
        {"kind": "line", "start": [300, 110], "end": [300, 390]},
    ],
)
def test_up_to_the_rim_of_the_region_nothing_is_said(table: dict[str, Any]) -> None:
    assert words(table) == ""


def test_a_line_that_ends_off_the_region_has_another_length() -> None:
    assert "330 were asked for" in words({"start": [300, 110], "end": [300, 440], "radius_px": 80})


def test_a_hole_is_told_from_half_of_the_area_on() -> None:
    mask = np.ones((500, 600), bool)
    mask[200:300, 200:400] = False
    assert words({"kind": "area", "box": [150, 150, 300, 200]}, mask=mask) == ""
    over = {"kind": "area", "box": [180, 180, 240, 140]}
    assert left_out(words(over, mask=mask)) == pytest.approx(60, abs=4)
    assert words(over, "area", mask) == ""  # as the automatic one: it is of the whole specimen


@pytest.mark.parametrize(
    ("table", "share"),
    [
        ({"kind": "area", "box": [0, 100, 200, 300]}, 0.5),
        ({"kind": "transverse", "box": [-100, 200, 400, 50]}, 0.5),
        ({"start": [300, 110], "end": [300, 440], "radius_px": 80}, 0.72),
        ({"kind": "area", "box": [100, 100, 400, 300]}, 1),
        ({"kind": "zoi", "at": [100, 110]}, 1),
    ],
)
def test_the_share_of_a_value_is_of_the_area_asked_for(table: dict[str, Any], share: float) -> None:
    grid = ZoiGrid.cover(REGION, 32, 8)
    field = StrainField.from_values(grid, {}, 1e-3)
    value = GaugeSet([make_gauge("mine", table, "y")]).read(field)["mine"]
    assert value.share == pytest.approx(share, abs=0.03)
