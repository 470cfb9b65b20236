"""How near figures are to the limits of their alarms, the map as a layer, the curve kept for the next specimen."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from analysis.evaluate import Figure
from analysis.field import Roi, ZoiGrid
from live.config.sections import AlarmConfig
from live.results.figures import TensileRow
from live.results.finished.belief import belief
from live.ui.web.curve_history import CurveHistory
from live.ui.web.limits import FigureLimits
from live.ui.web.painting import cells_box, cells_png


def of(
    value: float, name: str = "axial", axial_name: str = "eyy", **alarm: float | bool | str
) -> dict[str, object] | None:
    limits = FigureLimits([AlarmConfig(**{"channel": "axial", **alarm})])  # type: ignore[arg-type]
    return limits.of(name, value, axial_name)


@pytest.mark.parametrize(
    ("value", "share", "near", "beyond"),
    [
        (0.1, 0.5, False, False),
        (0.181, 0.905, True, False),
        (0.21, 1.05, False, True),
        (-0.1, 0.0, False, False),
    ],
)
def test_the_share_of_a_limit(value: float, share: float, near: bool, beyond: bool) -> None:
    found = of(value, above=0.2, end=True)
    assert found == {
        "value": 0.2,
        "share": pytest.approx(share),
        "near": near,
        "beyond": beyond,
        "ends": True,
    }


def test_units_of_channels_and_limits_below() -> None:
    force, stress = (
        of(-950.0, "force", channel="force_N", below=-1000.0),
        of(3e8, "stress", channel="stress_MPa", above=400.0),
    )
    assert force and stress and (force["near"], stress["near"]) == (True, False)
    assert stress["value"] == 400e6 and stress["share"] == pytest.approx(0.75)
    assert (
        of(0.1, channel="gauge_area", axial_name="area", above=0.2)
        and of(0.1, channel="exx", above=0.2) is None
    )
    assert of(math.nan, above=0.2) is None and of(0.1, "force", above=0.2) is None
    least = of(50.0, "force", channel="force_N", below=100.0)
    assert least and least["beyond"] and of(150.0, "force", channel="force_N", below=100.0) is None


def test_a_limit_that_comes_soon_is_near_and_one_that_was_passed_stays_by_its_hysteresis() -> None:
    limits = FigureLimits(
        [AlarmConfig(channel="axial", above=0.2, hysteresis=0.05), AlarmConfig(channel="axial", above=9.0)]
    )
    for k in range(11):
        limits.add(k * 0.1, {"force": math.nan, "stress": math.nan, "axial": 0.1 + 0.002 * k})
    assert limits.rate("axial") == pytest.approx(0.02) and math.isnan(limits.rate("force"))
    found = limits.of("axial", 0.12)
    assert found and found["near"] and found["value"] == 0.2, "the nearest of two; 4 s away"
    for k in range(11):
        limits.add(5 + k * 0.1, {"force": 1.0, "stress": 1.0, "axial": 0.12})
    found = limits.of("axial", 0.12)
    assert found and not found["near"], "it stands still"
    assert [(limits.of("axial", v) or {})["beyond"] for v in (0.21, 0.16, 0.14, 0.16)] == [
        True,
        True,
        False,
        False,
    ]


def test_a_map_as_a_layer_has_a_pixel_for_each_cell_and_the_place_of_all() -> None:
    grid = ZoiGrid.cover(Roi(0, 0, 80, 60), 12, 10)
    cells = np.zeros((*grid.shape, 4), np.uint8)
    cells[1, 2] = 10, 20, 30, 180  # a value; the others have none
    layer = cv2.imdecode(np.frombuffer(cells_png(cells), np.uint8), cv2.IMREAD_UNCHANGED)
    assert layer.shape == (*grid.shape, 4)
    assert [one.tolist() for one in np.nonzero(layer[..., 3])] == [[1], [2]]
    assert layer[1, 2].tolist() == [30, 20, 10, 255], "the page has the opacity"
    left, top, across, down = cells_box(grid, (6.0, -4.0))
    # The middle of a cell, from the corner of the first pixel, whose own middle is 0, 0.
    middle = left + 2.5 / grid.shape[1] * across, top + 1.5 / grid.shape[0] * down
    assert middle == (grid.x[2] + 6.0 + 0.5, grid.y[1] - 4.0 + 0.5)
    assert cells_box(grid, (math.nan, 0.0))[0] == grid.x[0] - 5 + 0.5, "not moved where that is not known"


def test_the_curve_kept_for_the_next_specimen() -> None:
    history = CurveHistory(["t", "stress", "axial"])
    for k in range(1000):
        history.add([k, 1e6 * k, 1e-6 * k if k % 2 else math.nan])
    kept = history.outline(100)
    assert kept["stress"] and 80 <= len(kept["load"]) == len(kept["strain"]) <= 100
    assert all(
        load == pytest.approx(1e12 * strain)
        for load, strain in zip(kept["load"], kept["strain"], strict=True)
    )


def row(name: str, value: float = 1.0, why: str = "") -> TensileRow:
    return TensileRow(name, "MPa", Figure(value, value, value, why), remarked=bool(why))


@pytest.mark.parametrize(
    ("rows", "troubles", "kind", "words"),
    [
        ([row("E"), row("Rm")], [], "good", "E, Rm can be believed."),
        ([row("E", why="uneven"), row("Rm")], [], "look", "Rm can be believed; look at E."),
        ([row("E", why="uneven")], [], "look", "Look at E: each has a remark."),
        ([row("E"), row("Rm")], ["no step"], "look", "Look at the remarks before you believe E, Rm."),
        ([row("E", math.nan, "no force")], [], "bad", "No figure is known; the list says why."),
    ],
)
def test_whether_the_figures_can_be_believed(
    rows: list[TensileRow], troubles: list[str], kind: str, words: str
) -> None:
    found = belief(rows, troubles)
    assert (found.kind, found.words) == (kind, words)
    held = "The intervals (95 %) hold the scatter"
    clear = "The data say nothing against them. " * (kind == "good")
    assert found.more == ("" if kind == "bad" else f"{clear}{held}.")
    stated = belief(rows, troubles, "limits of load cell, section").more
    assert stated == (
        "" if kind == "bad" else f"{clear}{held}, that of E also the limits of load cell, section."
    )


def test_the_range_of_a_load_cell_is_a_limit_that_ends_nothing() -> None:
    low, high = (FigureLimits.of_range(force, 10e3) for force in (-8e3, 9.5e3))
    assert low is not None and low["share"] == 0.8 and not low["near"] and not low["ends"]
    assert high is not None and high["near"] and not high["beyond"] and high["value"] == 10e3
    assert FigureLimits.of_range(math.nan, 10e3) is None and FigureLimits.of_range(1.0, math.nan) is None
