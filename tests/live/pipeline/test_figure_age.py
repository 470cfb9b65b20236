"""The one rule for the age of figures: every state, and what each consumer makes of it, at a clock that is set."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.events import Event, EventKind
from acquire.load_sample import LoadFlag, LoadSample
from acquire.text.message import from_json
from live.config.loading import load_config
from live.config.sections import AlarmConfig, SpecimenConfig
from live.pipeline.consumer import Screen
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import RunState
from live.pipeline.snapshot import ChannelValues
from live.pipeline.timed.figure import ARRIVALS, OLD_INTERVALS, OLD_S, Arrivals, FigureState, TimedFigure
from live.pipeline.timed.force_watch import ForceWatch
from live.run.alarms import ActionMeans, Alarm, AlarmWatch, actions_of
from live.run.pre_trigger import PreTrigger, PreTriggerBuffer
from live.run.strain_output import LineFormat
from live.ui.rerun.messages import LargeFigures
from live.ui.terminal.screen import status_line
from live.ui.web.broadcaster import Broadcaster, plain
from live.ui.web.page_consumer import PageConsumer
from tests.live.made_up import in_ascii, make_frame, make_measurement

NOW = 34.0
SPECIMEN = SpecimenConfig(axis="y", area_mm2=40.0)


def burst_at(t: float, strain: float = 1e-3, **more: Any) -> Measurement:
    m = make_measurement(0, strain)
    return replace(m, burst=replace(m.burst, t=t), time_step=replace(m.time_step, t=t, **more))


def run_state(force: str = "live", strain: str = "live") -> RunState:
    """A live test at ``NOW`` with force and strain in these states."""
    state = RunState.new(0.5, specimen=SPECIMEN, with_load=force != "none")
    health = state.health
    health.state, health.began_t = "REC", NOW - 1.0 if force == "not yet" else 1.0
    health.framed(NOW - 0.1, 10.0)
    good, gone = LoadSample(NOW - 24.0, 1200.0), "ended" in (force, strain)
    last = {
        "live": [LoadSample(NOW - 0.5, 1200.0)],
        "unknown": [LoadSample(NOW - 0.1, math.nan, flags=LoadFlag.ERROR)],
        "stale": [LoadSample(NOW - 0.1, 1250.0, flags=LoadFlag.STALE)],
        "overload": [LoadSample(NOW - 0.1, math.nan, flags=LoadFlag.OVERLOAD)],
        "underload": [LoadSample(NOW - 0.1, math.nan, flags=LoadFlag.UNDERLOAD)],
    }
    for sample in [] if force in ("none", "not yet") else [good, *last.get(force, [])]:
        state.loads.append(sample)
        health.loaded(sample.t, sample.force, tells=state.loads.telling is sample)
    if strain != "not yet":
        t = NOW - 24.0 if strain == "old" else NOW - 0.1
        lost = {"eyy": math.nan, "sigma_eyy": math.nan, "n_valid": 0, "refused": "34 LOST"}
        state.history.add(burst_at(t, **(lost if strain == "unknown" else {})).time_step)
    health.paused, health.ended = strain == "paused", gone
    return state


def page_of(state: RunState, *, paused: bool = False) -> dict[str, Any]:
    page = PageConsumer(Broadcaster(), load_config(None, {"specimen.area_mm2": 40.0}), lambda: NOW)
    running: Any = SimpleNamespace(
        paused=paused, recording=True, live=True, folder=Path("run"), run_state=state
    )
    page.attach(running)
    found: dict[str, Any] = json.loads(json.dumps(plain(page.state())), object_hook=from_json)
    return found


def line_of(state: RunState, *channels: str) -> dict[str, Any]:
    values = ChannelValues(0.0, state, clock=lambda: NOW)
    found: dict[str, Any] = json.loads(LineFormat(values, channels, "json").of(None))
    return found


class Watched:
    """One alarm at ``NOW``, and what it did."""

    def __init__(self, state: RunState, **config: Any) -> None:
        self.ended, self.events, self.state = list[str](), list[Event](), state
        self.config = AlarmConfig(**{"channel": "force_N", "above": 3000.0, "end": True} | config)
        means = ActionMeans(Screen(), self.ended.append)
        self.alarm = Alarm(self.config, actions_of(self.config, means))
        values = ChannelValues(0.0, state, clock=lambda: NOW)
        state.event_log.add_listener(self.events.append)
        self.events.clear()  # those of before
        self.watch = AlarmWatch([self.alarm], values, state, lambda: NOW)
        self.watch.idle()

    @property
    def text(self) -> str:
        return next((event.text for event in self.events if event.data.get("on")), "")


# -- the rule -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("times", "usual_s", "lasts_s"),
    [
        ([], 0.0, 2.0),
        ([7.0], 0.0, 2.0),
        ([k / 80 for k in range(800)], 0.1, 2.0),  # 80 a second: the shortest that matters is a tenth
        ([3.0 * k for k in range(9)], 3.0, 15.0),
        ([*(0.5 * k for k in range(30)), 74.5], 0.5, 2.5),  # a gap is no slower source
        ([k // 20 + 1e-3 * (k % 20) for k in range(200)], 1.0, 5.0),  # 20 lines in one go, once a second
        ([*range(50), *(50 + 10.0 * k for k in range(ARRIVALS))], 10.0, 50.0),  # the last ones count
    ],
)
def test_old_after_two_seconds_or_five_usual_intervals(
    times: list[float], usual_s: float, lasts_s: float
) -> None:
    arrivals = Arrivals()
    for t in times:
        arrivals.add(t)
    assert arrivals.usual_s == pytest.approx(usual_s, abs=0.02)
    assert arrivals.lasts_s == pytest.approx(lasts_s, rel=0.02)
    assert (OLD_S, OLD_INTERVALS, ARRIVALS) == (2.0, 5, 20)
    at = [
        TimedFigure.at(100.0 + arrivals.lasts_s + more, 100.0, 7.0, lasts_s=arrivals.lasts_s)
        for more in (-1e-6, 1e-6)
    ]
    assert [(one.state, one.last) for one in at] == [(FigureState.LIVE, 7.0), (FigureState.OLD, 7.0)]
    assert at[0].value == 7.0 and math.isnan(at[1].value) and at[1].age == pytest.approx(arrivals.lasts_s)


def test_a_slow_cell_and_a_slow_camera_are_not_old_between_two_readings() -> None:
    state = run_state()
    for k in range(12):  # every 4 s
        state.health.loaded(4.0 * k, 1.0)
        state.history.add(burst_at(4.0 * k).time_step)
    state.loads.append(LoadSample(44.0, 1300.0))
    for now, there in ((44.1, True), (63.9, True), (64.1, False)):
        found = state.snapshot(now)
        assert [found.figure(name).known for name in ("force", "axial")] == [there, there], now


# -- the table, cell by cell: the force -----------------------------------------------------------

FORCE = {
    # state: terminal, word on the page, value and last there, display, state of the line, alarm "above" and its text
    "live": ("1200.0 N  30.0 MPa", "live", 1200.0, 1200.0, "1200.0", 1200.0, False, ""),
    "old": ("force - (1200.0 N, 24 s ago)", "old", None, 1200.0, "1200.0", None, True, "no value of force for 24 s"),
    "unknown": ("force - (1200.0 N, 24 s ago)", "unknown", None, 1200.0, "1200.0", None, True,
                "no value of force: the lines of the load cell are no readings, for 24 s"),
    "stale": ("force - (1200.0 N, 24 s ago)", "unknown", None, 1200.0, "1200.0", None, True,
              "no value of force: the time of its readings is not known, for 24 s"),
    "overload": ("force OVERLOAD", "overload", None, None, "OVERLOAD", None, True, "force: OVERLOAD"),
    "underload": ("force UNDERLOAD", "underload", None, None, "UNDERLOAD", None, True, "force: UNDERLOAD"),
    "not yet": ("force - (not yet)", "not yet", None, None, "-", None, False, ""),
    "ended": ("force - (ended)", "ended", None, 1200.0, "-", None, False, ""),
    "none": ("", "none", None, None, "-", None, False, ""),
}  # fmt: skip


@pytest.mark.parametrize("kind", FORCE)
def test_the_force_on_every_screen_and_line(kind: str) -> None:
    terminal, word, value, last, display, sent, on, why = FORCE[kind]
    state = run_state(kind)
    now = state.snapshot(NOW)
    shown = in_ascii(status_line(now, 300))
    assert terminal in shown and ("force" in shown) is terminal.startswith("force"), shown
    assert ("MPa" in shown) is (kind == "live")
    page = page_of(state)
    figure = page["figures"]["force"]
    assert (figure["state"], figure["value"], figure["last"]) == (word, value, last)
    assert page["figures"]["stress"]["state"] == word
    assert page["troubles"] == ([why] if on else []), "the state is green only where there is none"
    cells = LargeFigures.of(now).cells
    assert in_ascii(cells[2][1]) == display and ("24 s old" in cells[2][0]) is (
        kind in ("old", "unknown", "stale")
    )
    line = line_of(state, "force_N", "stress_MPa", "force_age_s", "force_state", "axial")
    assert (line["force_N"], line["force_state"]) == (sent, word)
    assert (line["stress_MPa"] is None) is (sent is None)
    if kind in ("live", "old"):
        assert line["force_age_s"] == pytest.approx(0.5 if kind == "live" else 24.0)


@pytest.mark.parametrize("kind", FORCE)
@pytest.mark.parametrize("ends", [False, True])
def test_an_alarm_on_the_force(kind: str, ends: bool) -> None:
    *_, on, why = FORCE[kind]
    watched = Watched(run_state(kind), end_on_unknown=ends)
    assert watched.alarm.on is on and watched.text == (f"ALARM {why}" if on else "")
    assert bool(watched.ended) is (kind == "overload" or (on and ends)), "an overload is above any limit"
    below = Watched(run_state(kind), above=None, below=-3000.0, end_on_unknown=ends)
    assert below.alarm.on is (on and kind != "overload")
    assert bool(below.ended) is (kind == "underload" or (below.alarm.on and ends))


def test_a_force_that_comes_back_beyond_the_limit_ends_the_run_then() -> None:
    watched = Watched(run_state("old"))
    assert watched.alarm.on and watched.ended == []
    assert watched.state.alarms.texts == ("no value of force for 24 s",)
    watched.state.loads.append(LoadSample(NOW, 5000.0))
    watched.watch.idle()
    assert (
        list(map(in_ascii, watched.ended)) == ["ALARM force 5000.0 N, limit 3000.0 N"]
        and watched.watch.end() == "2 came"
    )


def test_a_force_that_comes_back_within_the_limit_ends_the_alarm() -> None:
    watched = Watched(run_state("old"), hysteresis=2900.0)
    watched.state.loads.append(LoadSample(NOW, 200.0))
    watched.watch.idle()
    assert not watched.alarm.on and watched.state.alarms.texts == () and watched.ended == []


def test_an_alarm_on_a_value_that_is_not_there_has_its_age_and_stays_silenced() -> None:
    watched = Watched(run_state("old"))
    later: Any = watched.watch
    later._values._clock = lambda: NOW + 6.0
    later.idle()
    assert watched.state.alarms.texts == ("no value of force for 30 s",)
    assert watched.state.alarms.silence() and later.idle() == 0.2 and watched.state.alarms.texts == ()


@pytest.mark.parametrize("kind", ["old", "unknown", "stale"])
def test_a_cell_without_values_is_silent_whatever_lines_it_sends(kind: str) -> None:
    watched = Watched(run_state(kind), channel="load_silent_s", above=2.0)
    assert watched.alarm.on and watched.text == "ALARM no force for 24 s, limit 2" and watched.ended


def test_nothing_is_judged_once_the_test_has_ended() -> None:
    for channel in ("load_silent_s", "silent_s", "force_N", "axial"):
        state = run_state("old", "old")
        state.health.ended = True
        assert not Watched(state, channel=channel, above=2.0).alarm.on, channel


# -- the table: strains ---------------------------------------------------------------------------

STRAIN = {
    "live": ("eyy 1000.0 +- ", 1e-3, False, ""),
    "old": ("strain - (eyy 1000 um/m, 24 s ago)", None, True, "no value of {} for 24 s"),
    "unknown": ("eyy ", None, True, "no value of {}: 34 LOST"),
    "not yet": ("", None, False, ""),
    "paused": ("strain - (paused)", None, False, ""),
    "ended": ("strain - (ended)", None, False, ""),
}


@pytest.mark.parametrize("kind", STRAIN)
def test_the_strain_on_every_screen_line_and_alarm(kind: str) -> None:
    terminal, value, on, why = STRAIN[kind]
    state = run_state(strain=kind)
    assert terminal in in_ascii(status_line(state.snapshot(NOW), 400))
    page = page_of(state, paused=kind == "paused")
    assert page["figures"]["axial"]["state"] == kind and page["figures"]["axial"]["value"] == pytest.approx(
        value
    )
    assert page["troubles"] == ([why.format("eyy")] if on else [])
    assert (page["figures"]["axial"]["last"] or 0.0) == pytest.approx(
        0.0 if kind in ("unknown", "not yet") else 1e-3
    )
    line = line_of(state, "axial", "sigma_axial", "age_s", "state")
    assert (
        line["state"] == kind
        and line["axial"] == pytest.approx(value)
        and (line["sigma_axial"] is None) is (not value)
    )
    assert line["age_s"] == (None if kind == "not yet" else pytest.approx(24.0 if kind == "old" else 0.1))
    for channel in ("axial", "eyy"):
        watched = Watched(state, channel=channel, above=0.5)
        assert (watched.alarm.on, watched.ended) == (on, [])
        assert watched.text == (f"ALARM {why.format(channel)}" if on else "")


def facts_of(page: Any) -> dict[str, float]:
    return {one["label"]: one["amount"].value for one in page["facts"]}


def test_gauges_latency_and_rate_go_with_their_burst() -> None:
    state = run_state(strain="old")
    page = page_of(state)
    assert page["zois"] is None and page["strain_rate"] is None and "delay" not in facts_of(page)
    assert Watched(state, channel="lost_share", above=0.5).text == "ALARM no value of lost share for 24 s"
    assert Watched(run_state(), channel="lost_share", above=0.5).alarm.on is False


def test_after_a_pause_and_during_a_reference_the_strain_is_not_yet_there_and_then_old() -> None:
    state = run_state(strain="old")
    state.health.since_t = NOW - 1.0
    found = [state.snapshot(now).figure("axial").state for now in (NOW, NOW + 0.9, NOW + 1.1)]
    assert found == ["not yet", "not yet", "old"]


@pytest.mark.parametrize(("failed", "why"), [(False, "no frame for 24 s"), (True, "the camera has failed")])
def test_a_camera_that_stalls_is_no_well_state(failed: bool, why: str) -> None:
    state = run_state(strain="not yet")
    state.health.frame_t, state.health.camera_failed = NOW - 24.0, failed
    assert state.snapshot(NOW).figure("axial").why == why
    assert "frames/s –" not in status_line(run_state().snapshot(NOW), 300)
    words = "frames/s – (the camera has failed)" if failed else "frames/s – (10, 24 s ago)"
    assert words in status_line(state.snapshot(NOW), 300)
    assert any("frame rate" in text for text in page_of(state)["troubles"])


def test_the_disk_is_old_when_nobody_looks_any_more() -> None:
    state = run_state()
    for k in range(4):
        state.health.room(NOW - 30.0 + 5.0 * k, 600.0)
    assert state.snapshot(NOW).figure("disk").known and facts_of(page_of(state))["disk"] == 600.0
    assert state.snapshot(NOW + 11.0).figure("disk").state == "old"


# -- errors, replay, rows, armed recording ----------------------------------------------------------


def test_an_error_stays_until_its_source_says_that_it_is_over() -> None:
    state = run_state()
    log = state.event_log
    log.emit(EventKind.DEVICE, "cell", "lost; trying to reach it again", "error")
    log.emit(EventKind.DEVICE, "cell", "no reading for 2 s", "warning")
    log.emit(EventKind.DEVICE, "camera", "it is back")
    assert page_of(state)["troubles"] == ["cell: lost; trying to reach it again"]
    log.emit(EventKind.DEVICE, "cell", "connected again")
    assert page_of(state)["troubles"] == []
    log.emit(EventKind.MEASUREMENT, "reference", "cannot be measured", "error")
    log.emit(EventKind.REFERENCE, "measurement", "reference: 32 frames")
    log.emit(EventKind.RECORDER, "recorder", "the disk is too slow", "error")
    log.emit(EventKind.RECORDER, "recorder", "recording again", "warning")
    assert page_of(state)["troubles"] == []


def test_of_a_recording_now_is_the_newest_instant() -> None:
    state = run_state(strain="old")
    state.health.recorded = True
    state.history.add(burst_at(NOW - 20.0, force=700.0).time_step)
    now = state.snapshot(NOW + 1e6)
    assert (now.figure("force").value, now.figure("axial").state, now.t) == (700.0, "live", NOW - 20.0)
    assert now.troubles == ()
    state.health.ended = True
    ended = state.snapshot(NOW + 1e6)
    assert {figure.state for figure in ended.figures.values()} == {"ended"} and ended.troubles == ()


def rows(*forces: float, period_s: float = 0.1, late: int = 0) -> RunState:
    """A test whose rows have these forces; each becomes final ``late`` measurements later."""
    state = RunState.new(0.5)
    watch = ForceWatch(state)
    for k in range(len(forces) + late):
        if k < len(forces):
            watch.measurement(burst_at(k * period_s))
        if k >= late:
            watch.matched(burst_at((k - late) * period_s, force=forces[k - late]))
    return state


@pytest.mark.parametrize(
    ("without", "late", "said_at", "lossy"),
    [(5, 0, None, False), (19, 0, None, False), (25, 0, 2.0, True), (25, 20, 0.0, True)],
)
def test_rows_without_a_force_are_counted_and_said_after_two_seconds(
    without: int, late: int, said_at: float | None, lossy: bool
) -> None:
    state = rows(*[1.0] * 5, *[math.nan] * without, *[1.0] * 5, late=late)
    assert state.frame_counts.without_force == without
    assert f"bursts without a force {without}" in state.frame_counts.line()
    assert (state.health.without_force_s > OLD_S) is lossy
    said = state.event_log.events("warning")
    assert [event.t for event in said] == ([] if said_at is None else [pytest.approx(0.5 + said_at)])
    assert all("no force for the bursts of the last 2" in event.text for event in said)
    over = [event.text for event in state.event_log.events("info")]
    assert over == ([] if said_at is None else [f"bursts have a force again, after {without} without"])


def test_a_pause_is_no_time_without_a_force() -> None:
    state = RunState.new(0.5)
    watch = ForceWatch(state)
    for t, force in ((0.0, 1.0), (60.0, math.nan), (60.1, 1.0)):
        watch.matched(burst_at(t, force=force))
    assert state.frame_counts.without_force == 1 and state.health.without_force_s <= OLD_S


@pytest.mark.parametrize(
    ("kind", "begins"),
    [("live", ""), ("old", "no value of force for 24 s"), ("overload", "force: OVERLOAD"),
     ("underload", "force: UNDERLOAD"), ("not yet", ""), ("none", "")],
)  # fmt: skip
@pytest.mark.parametrize("above_N", [3000.0, math.inf])
def test_an_armed_recording_begins_where_the_force_may_be_above_the_trigger(
    kind: str, begins: str, above_N: float
) -> None:
    state = run_state(kind)
    recorder: Any = SimpleNamespace(frame=lambda frame: None, failed=None, event=lambda event: None)
    settings = PreTrigger(2.0, 10_000_000, above_N)
    buffer = PreTriggerBuffer(
        recorder, state.frame_counts, state.event_log, settings, on=False, force=lambda: state.force(NOW)
    )
    buffer.frame(make_frame(0, NOW), is_reference=False)
    assert buffer.on is bool(begins and above_N < math.inf)
    assert any(begins in event.text for event in state.event_log.events()) or not buffer.on
