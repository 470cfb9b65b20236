"""The panels of the page: how near figures are to their limits, layers and kept curves, and front and back."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from acquire.events import EventKind
from acquire.load_sample import LoadSample
from analysis.evaluate import Figure
from analysis.field import Roi, ZoiGrid
from live.config.loading import load_config
from live.config.sections import AlarmConfig, SpecimenConfig
from live.pipeline.run_state import RunState
from live.results.figures import TensileRow
from live.results.finished.figures_file import belief
from live.ui.web.broadcaster import Broadcaster
from live.ui.web.map_view import cells_box, cells_png
from live.ui.web.page_consumer import PageConsumer
from live.ui.web.run_panels import FIGURES_S, CamerasPanel, CurveHistory, FigureLimits
from live.ui.web.run_result import MAX_TROUBLES, cameras_result, run_result
from tests.live.made_run import E_PA, PULLED, THICKNESS_MM, WIDTH_MM, finished, force_of
from tests.live.made_up import START, make_measurement
from tests.live.screens import StatedRun


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
    beyond = [(limits.of("axial", v) or {})["beyond"] for v in (0.21, 0.16, 0.14, 0.16)]
    assert beyond == [True, True, False, False]


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
    return TensileRow(name, "MPa", Figure(value, value, value, why))


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


SPECIMEN = SpecimenConfig(width_mm=WIDTH_MM, thickness_mm=THICKNESS_MM, axis="y")
WRONG = 0.1  # of the strain: what the front has too much of, and the back too little


def side(wrong: float, strains: tuple[float, ...] = PULLED) -> RunState:
    state = RunState.new(1.0, specimen=SPECIMEN)
    for k, strain in enumerate(PULLED):
        state.loads.append(LoadSample(START + 0.1 * k, force_of(strain)))
    for number, strain in enumerate(strains):
        state.history.add(make_measurement(number, strain * (1 + wrong)).time_step)
    return state


def test_mean_bending_figures_and_cameras() -> None:
    states, now = {"front": side(WRONG), "back": side(-WRONG)}, [START + 10.0]
    states["back"].frame_counts.add(grabbed=9, lost=2, skipped=4)
    shown = CamerasPanel(states, SPECIMEN, lambda: now[0]).state()
    axial = shown["strains"][0]
    assert axial["name"] == "axial"
    assert axial["mean"] == pytest.approx(PULLED[-1], rel=1e-9)
    assert axial["bending"] == pytest.approx(WRONG * PULLED[-1], rel=1e-9)
    assert 0 < axial["sigma"] < 1e-5
    found = {one["side"]: float(one["text"].split()[0]) for one in shown["figures"] if one["name"] == "E"}
    assert found["both"] == pytest.approx(E_PA / 1e9, rel=2e-3)
    assert found["front"] == pytest.approx(E_PA / 1e9 / (1 + WRONG), rel=2e-3)
    assert found["back"] == pytest.approx(E_PA / 1e9 / (1 - WRONG), rel=2e-3)
    front, back = shown["cameras"]
    assert (front["side"], front["lost"], front["valid"]) == ("front", 0, front["zois"] - 1)
    assert (back["side"], back["lost"], back["skipped"]) == ("back", 2, 4)


def test_there_is_no_mean_once_a_camera_has_failed() -> None:
    states = {"front": side(WRONG), "back": side(-WRONG)}
    states["back"].health.camera_failed = True
    shown = CamerasPanel(states, SPECIMEN, lambda: START + 10).state()
    assert shown["strains"] == []
    assert [one["failed"] for one in shown["cameras"]] == [False, True]


def test_figures_are_evaluated_now_and_then() -> None:
    states, now = {"front": side(WRONG, PULLED[:9]), "back": side(-WRONG)}, [100.0]
    panel = CamerasPanel(states, SPECIMEN, lambda: now[0])
    before = panel.state()["figures"]
    assert not any(one["name"] == "E" for one in before)
    for number, strain in enumerate(PULLED[9:], 9):
        states["front"].history.add(make_measurement(number, strain).time_step)
    now[0] += 0.9 * FIGURES_S
    assert panel.state()["figures"] == before
    now[0] += 0.2 * FIGURES_S
    assert any(one["name"] == "E" and one["side"] == "both" for one in panel.state()["figures"])


def test_nothing_before_both_have_measured() -> None:
    states = {"front": side(WRONG), "back": RunState.new(1.0, specimen=SPECIMEN)}
    shown = CamerasPanel(states, SPECIMEN, lambda: START).state()
    assert (shown["strains"], shown["figures"]) == ([], [])
    assert math.isfinite(shown["cameras"][0]["valid"])


def test_two_fields_have_figures_of_their_own_and_no_mean() -> None:
    states = {"first": side(WRONG), "second": side(-WRONG)}
    shown = CamerasPanel(states, SPECIMEN, lambda: START + 10).state()
    assert shown["strains"] == [] and [one["side"] for one in shown["cameras"]] == ["first", "second"]
    found = [(one["side"], float(one["text"].split()[0])) for one in shown["figures"] if one["name"] == "E"]
    moduli = [E_PA / 1e9 / (1 + wrong) for wrong in (WRONG, -WRONG)]
    assert found == [(name, pytest.approx(one, rel=2e-3)) for name, one in zip(states, moduli, strict=True)]


def test_the_result_has_the_figures_of_both_and_the_warnings_of_each() -> None:
    states = {"front": side(WRONG), "back": side(-WRONG)}
    states["back"].event_log.emit(EventKind.DEVICE, "camera", "a fault", "error")
    result = cameras_result(
        states, {side: finished(state, SPECIMEN) for side, state in states.items()}, Path("test"), ""
    )
    assert [one["side"] for one in result["figures"] if one["name"] == "E"] == ["both", "front", "back"]
    held = [one["text"] for one in result["figures"] if one["name"] == "interval of E"]
    assert held == ["scatter; no limits of error are stated"]
    assert result["folder"] == "test"
    assert any(text.startswith("back: ") and "a fault" in text for text in result["troubles"])


def test_the_result_has_the_newest_warnings() -> None:
    state = RunState.new(1.0, specimen=SPECIMEN)
    state.history.add(make_measurement(0).time_step)
    for k in range(25):
        state.event_log.emit(EventKind.DEVICE, "a camera", f"warning{k}", "warning")
        state.event_log.emit(EventKind.NOTE, "operator", f"note {k}", "info")
    found = run_result(state, finished(state, SPECIMEN), Path("run"), "")["troubles"]
    assert len(found) == MAX_TROUBLES == 20
    assert found[0].endswith("warning5") and found[-1].endswith("warning24")


def test_a_camera_that_has_ended_says_so_while_others_go_on() -> None:
    states = {"front": side(WRONG), "back": side(-WRONG)}
    alone, front = (PageConsumer(Broadcaster(), load_config(None, {}), lambda: START + 10, side=name)
                    for name in ("", "front"))  # fmt: skip
    alone.attach(StatedRun(states["front"]))
    front.attach(StatedRun(states["front"]), states)
    assert (alone.state()["state"], front.state()["state"]) == ("measuring", "measuring")
    states["front"].health.camera_ended = True
    assert (alone.state()["state"], front.state()["state"]) == ("measuring", "ended")
