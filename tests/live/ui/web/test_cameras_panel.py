"""Front and back on the page: mean and bending by value, the figures of both, and a camera that lost frames."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from acquire.events import EventKind
from acquire.load_sample import LoadSample
from live.config.loading import load_config
from live.config.sections import SpecimenConfig
from live.pipeline.run_state import RunState
from live.ui.web.broadcaster import Broadcaster
from live.ui.web.cameras_panel import FIGURES_S, CamerasPanel
from live.ui.web.page_consumer import PageConsumer
from live.ui.web.run_result import MAX_TROUBLES, cameras_result, run_result
from tests.live.made_run import E_PA, PULLED, THICKNESS_MM, WIDTH_MM, finished, force_of
from tests.live.made_up import START, make_measurement
from tests.live.screens import StatedRun

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
    assert (front["side"], front["lost"], back["side"], back["lost"], back["skipped"]) == (
        "front",
        0,
        "back",
        2,
        4,
    )
    assert front["valid"] == front["zois"] - 1


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
    assert shown["strains"] == []
    found = {one["side"]: float(one["text"].split()[0]) for one in shown["figures"] if one["name"] == "E"}
    assert found["first"] == pytest.approx(E_PA / 1e9 / (1 + WRONG), rel=2e-3)
    assert found["second"] == pytest.approx(E_PA / 1e9 / (1 - WRONG), rel=2e-3)
    assert [one["side"] for one in shown["cameras"]] == ["first", "second"]


def test_the_page_gets_both_sides() -> None:
    states = {"front": side(WRONG), "back": side(-WRONG)}
    consumer = PageConsumer(Broadcaster(), load_config(None, {}), lambda: START + 10)
    assert consumer.state()["sides"] is None
    consumer.attach(StatedRun(states["front"]), states)
    assert consumer.state()["sides"]["strains"][0]["mean"] == pytest.approx(PULLED[-1])


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
