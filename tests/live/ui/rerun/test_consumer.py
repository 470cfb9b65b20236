"""View, status card and large figures as consumers: passing data on takes next to no time of the test."""

from __future__ import annotations

from typing import Any

import pytest

from acquire.events import Event, EventKind
from acquire.load_sample import LoadSample
from live.config.sections import SpecimenConfig
from live.pipeline.event_log import EventLog
from live.pipeline.run_state import RunState
from live.results.summary import StatusCard
from live.ui.rerun.consumer import CARD_TIME_STEPS, CardWriter, FiguresWriter, RerunConsumer
from tests.live.made_up import START, make_frame, make_loads, make_measurement
from tests.live.streaming import Published


class RecordingView:
    """Records the calls that ``View`` gets."""

    failed = ""

    def __init__(self) -> None:
        self.calls: list[tuple[str, Any]] = []
        self.closed = False

    def __getattr__(self, name: str) -> Any:
        return lambda *what: self.calls.append((name, what))

    def close(self, seconds: float) -> None:
        self.closed = True

    report = "all drawn"


def watched(*views: RecordingView) -> tuple[Published, EventLog]:
    run_state = RunState.new(1.0)
    watching = [RerunConsumer(view, run_state) for view in views]  # type: ignore[arg-type]
    return Published(watching, run_state, make_loads(10.0, lambda t: t)), run_state.event_log


def test_everything_is_offered() -> None:
    view = RecordingView()
    out, event_log = watched(view)
    out.add(make_measurement(0))
    out.frame(make_frame(0, START))
    out.load(LoadSample(START, 5.0))
    event_log.emit(EventKind.NOTE, "operator", "hello")
    out.end()
    assert {name for name, _ in view.calls} == {"show", "point", "picture", "load", "event"}
    (point,) = (what for name, what in view.calls if name == "point")
    assert point == pytest.approx((0.001, 0.0))
    assert view.closed
    assert out.reports[0].summary == "all drawn"


def test_a_view_that_has_failed_is_reported_once_and_all_else_goes_on() -> None:
    broken, sound = RecordingView(), RecordingView()
    out, event_log = watched(broken, sound)
    broken.failed = "its process does not start (ended with 1)"
    for number in range(5):
        out.add(make_measurement(number))
    out.end()
    events: list[Event] = event_log.events("warning")
    assert [broken.failed in event.text for event in events] == [True]
    assert len([name for name, _ in sound.calls if name == "show"]) == 5
    assert not out.failed


def test_the_card_is_written_once_a_second_from_a_bounded_history(monkeypatch: pytest.MonkeyPatch) -> None:
    view, seen = RecordingView(), []
    card = StatusCard(SpecimenConfig(), make_loads(1.0, lambda t: t))
    monkeypatch.setattr(card, "written", lambda now, history: seen.append(history.time_steps) or "card")
    writer = CardWriter(view, card, RunState.new(1.0))  # type: ignore[arg-type]
    last = make_measurement(0)
    for number in range(3 * CARD_TIME_STEPS):
        last = make_measurement(number) if number % 1000 == 0 else last
        writer.measurement(last)
    writer.measurement(newest := make_measurement(100_000))
    assert [name for name, _ in view.calls if name != "whole"] == ["status"] * 7
    assert max(len(time_steps) for time_steps in seen) <= CARD_TIME_STEPS + 2
    assert seen[-1][-1].t == newest.time_step.t


@pytest.mark.parametrize("state", ["ARMED", ""])
def test_the_large_figures_before_and_after_the_first_measurement(state: str) -> None:
    """Live the load is shown from the first frame on; a replay (no state) shows the force of each measurement."""
    run_state, view = RunState.new(1.0, specimen=SpecimenConfig(area_mm2=40.0)), RecordingView()
    run_state.loads.append(LoadSample(START, 800.0))
    run_state.health.state, run_state.health.frame_t = state, START + 1
    writer = FiguresWriter(view, run_state, lambda: START + 1)  # type: ignore[arg-type]
    writer.idle()
    shown = [what for _, (what,) in view.calls]
    assert [(f.state, f.figure("force").value, f.zois) for f in shown] == (
        [("ARMED", 800.0, 0)] if state else []
    )
    run_state.alarms.set("limit", "limit: too much")
    writer.measurement(make_measurement(1, 1e-3, force=500.0))
    _, (last,) = view.calls[-1]
    assert (last.state, last.figure("force").value) == (("ARMED", 800.0) if state else ("REPLAY", 500.0))
    assert last.figure("axial").value == pytest.approx(1e-3) and last.alarms == ("limit: too much",)
    assert last.figure("stress").value == pytest.approx(last.figure("force").value / 40e-6)
    run_state.health.ended = True
    assert writer.end() == "" and view.calls[-1][1][0].figure("force").state == "ended"
