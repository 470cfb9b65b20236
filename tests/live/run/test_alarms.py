"""Alarms: when they come on and go off, their actions and delay; and a run with all outputs in real time."""

from __future__ import annotations

import json
import math
import socket
from collections.abc import Iterable
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest

from acquire.errors import ConfigError
from acquire.events import Event, EventKind
from acquire.session import Session
from hw_mocks.indicator_server import PtyPort
from live.cli import main
from live.config.listen_address import SOCKET
from live.config.loading import from_dict, load_config
from live.config.sections import AlarmConfig
from live.pipeline.consumer import Screen
from live.pipeline.run_state import ActiveAlarms, Health
from live.pipeline.snapshot import Snapshot
from live.run.alarms import ACTIONS, ActionMeans, Alarm, AlarmWatch, actions_of, check_alarms, in_words
from live.run.control import SOCKET_NAME, ControlPort, answer
from live.run.live_run import run_live
from live.ui.terminal.screen import TerminalScreen
from tests.live.made_up import START, in_ascii, make_measurement
from tests.live.run.test_strain_output import Listener, free_port, read
from tests.live.run.test_tcp_lines import Caller
from tests.live.screens import RecordingScreen
from tests.live.test_end_to_end import live_run
from tests.live.ui.waiting import LONG_S


@pytest.mark.parametrize(
    ("channel", "settings", "needs"),
    [
        ("force_N", {}, "a load cell"),
        ("load_silent_s", {}, "a load cell"),
        ("stress_MPa", {"specimen.area_mm2": 40.0}, "a load cell"),
        ("stress_MPa", {"load.address": "sim:"}, "the section"),
        ("disk_min", {"record.enabled": False}, "a recording"),
        ("mean_axial", {}, "a camera on each side"),
        ("force_N", {"load.address": "sim:"}, ""),
        ("stress_MPa", {"load.address": "sim:", "specimen.area_mm2": 40.0}, ""),
        ("axial", {}, ""),
        ("disk_min", {}, ""),
    ],
)
def test_an_alarm_that_can_never_come_is_refused(channel: str, settings: dict[str, Any], needs: str) -> None:
    alarm = [{"channel": "silent_s", "above": 1.0}, {"channel": channel, "above": 1.0}]
    config = load_config(None, {"camera.address": "sim:?fsp=3", "alarm": alarm, **settings})
    if not needs:
        check_alarms(config)
        return
    with pytest.raises(ConfigError, match=rf"alarm 2 \({channel}\) can never come: it needs {needs}"):
        run_live(config, Screen())  # before the camera is opened, which has an unknown setting


def test_a_device_that_never_sends_is_silent_since_the_start() -> None:
    health = Health(began_t=10.0)
    assert health.channels(12.5)["load_silent_s"] == health.channels(12.5)["silent_s"] == 2.5
    health.loaded(12.0, 1.0)
    assert health.channels(12.5)["load_silent_s"] == 0.5


class Kept:
    """A strain output that keeps what it is left."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def post(self, line: str) -> None:
        self.lines.append(line)


class WatchSetup:
    """An alarm watch with given channel values."""

    def __init__(self, *alarms: AlarmConfig) -> None:
        self.events: list[Event] = []
        self.active, self.values, self.now = ActiveAlarms(), dict[str, float](), 100.0
        self.screen, self.ended, self.sent, self.lost = RecordingScreen(), list[str](), Kept(), ""
        means = ActionMeans(self.screen, self.ended.append, [self.sent])  # type: ignore[list-item]
        channels: Any = SimpleNamespace(read=dict, now=Snapshot(0.0), start=0.0)
        health = SimpleNamespace(channels=lambda now: self.values)
        run_state: Any = SimpleNamespace(health=health, alarms=self.active, event_log=self.events.append)
        made = [Alarm(config, actions_of(config, means)) for config in alarms]
        self.watch = AlarmWatch(made, channels, run_state, lambda: self.now, self)

    def read(self, start: float) -> dict[str, float]:
        """As channels of two cameras that have none."""
        return {}

    def check(self, **values: float) -> list[dict[str, Any]]:
        self.values = values
        before = len(self.events)
        self.watch.idle()
        return [dict(event.data) for event in self.events[before:]]


def test_what_comes_is_told_stands_on_the_board_and_goes() -> None:
    bench = WatchSetup(AlarmConfig(channel="silent_s", above=2.0, name="camera", line="HALT", end=True))
    assert bench.check(silent_s=1.0) == []
    assert bench.check(silent_s=2.5) == [
        {"alarm": "camera", "on": True, "value": 2.5, "line": "HALT", "end": True}
    ]
    assert bench.check(silent_s=3.0) == []
    assert bench.active.texts == ("camera: no frame for 2.5 s, limit 2",)
    assert bench.check(silent_s=0.1) == [{"alarm": "camera", "on": False, "value": 0.1}]
    assert bench.active.texts == ()
    assert [event.level for event in bench.events] == ["warning", "info"]
    assert bench.watch.end() == "1 came"
    assert (bench.screen.rung, bench.ended) == (1, ["ALARM camera: no frame for 2.5 s, limit 2"])
    assert bench.sent.lines == ["HALT"]


def test_an_alarm_does_only_what_it_is_asked_for() -> None:
    bench = WatchSetup(AlarmConfig(channel="silent_s", above=2.0))
    bench.check(silent_s=3.0)
    assert (bench.screen.rung, bench.ended, bench.sent.lines) == (1, [], [])


def test_every_key_of_an_alarm_is_what_it_looks_at_or_an_action() -> None:
    looked_at = {"channel", "above", "below", "hysteresis", "name", "end_on_unknown", "of_cycle"}
    assert {field.name for field in fields(AlarmConfig)} == looked_at | {kind.key for kind in ACTIONS} - {""}


def test_an_alarm_on_two_cameras_comes_when_there_is_no_value_any_more() -> None:
    bench = WatchSetup(
        AlarmConfig(channel="mean_axial", above=2e-3, line="HALT", end=True, end_on_unknown=True),
        AlarmConfig(channel="axial", above=1.0),
    )
    assert bench.check(mean_axial=1e-3) == [] and bench.check() == []
    bench.lost = "the camera of the back has failed"
    assert bench.check() == [
        {"alarm": "mean_axial above 0.002", "on": True, "value": None, "line": "HALT", "end": True}
    ]
    text = "mean axial is not known, the camera of the back has failed"
    assert bench.active.texts == (text,)
    assert (bench.sent.lines, bench.ended, bench.check()) == (["HALT"], [f"ALARM {text}"], [])
    bench.lost = ""
    assert [data["on"] for data in bench.check(mean_axial=1e-3)] == [False]
    bench.lost = "the camera of the front has failed"
    assert bench.watch.end() == "2 came"  # the front ends, and its alarms with it


def test_an_action_that_fails_keeps_nothing_else_from_being_done() -> None:
    bench = WatchSetup(AlarmConfig(channel="silent_s", above=2.0, line="HALT", end=True))
    bench.sent.post = lambda line: 1 / 0  # type: ignore[method-assign, assignment, return-value]
    bench.check(silent_s=3.0)
    failed, came = bench.events
    assert failed.level == "error" and "SendLine of an alarm failed: ZeroDivisionError" in failed.text
    assert came.data["on"] is True and bench.ended == [came.text]


def test_a_silenced_alarm_comes_again_only_after_it_has_gone() -> None:
    bench = WatchSetup(AlarmConfig(channel="silent_s", above=2.0))
    bench.check(silent_s=3.0)
    assert bench.active.silence() == ("silent_s above 2",)
    bench.check(silent_s=4.0)
    assert bench.active.texts == ()
    bench.check(silent_s=1.0)
    bench.check(silent_s=3.0)
    assert len(bench.active.texts) == 1


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[alarm]\nchannel = 'force_N'\n", r"\[\[alarm\]\]"),
        ("[[alarm]]\nchannel = 'forse_N'\nabove = 1\n", "did you mean force_N"),
        ("[[alarm]]\nchannel = 'force_N'\n", "one of above and below"),
        ("[[alarm]]\nchannel = 'force_N'\nabove = 1\nbelow = 0\n", "one of above and below"),
        ("[[alarm]]\nchannel = 'force_N'\nover = 1\n", "unknown key alarm 1.over"),
        ("[[alarm]]\nchannel = 'gauge_axial'\nabove = 1\n", "unknown channel 'gauge_axial'"),
        ("alarm = 3\n", r"\[\[alarm\]\]"),
    ],
)
def test_alarms_that_cannot_be(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=says):
        load_config(path, {})


def test_a_gauge_that_is_still_to_be_placed_may_be_watched() -> None:
    alarm = [{"channel": "gauge_area", "above": 0.01}]
    assert load_config(None, {"alarm": alarm, "measure.gauges": "auto"}).alarm[0].channel == "gauge_area"
    with pytest.raises(ConfigError, match="unknown channel"):
        load_config(None, {"alarm": alarm})


def test_alarms_come_back_from_a_file_as_they_were() -> None:
    alarms = [{"channel": "force_N", "above": 1.0}, {"channel": "axial", "below": 0.0, "end": True}]
    config = load_config(None, {"alarm": alarms})
    assert from_dict(json.loads(json.dumps(config.as_dict())), {}, "a file") == config


REAL = "sim:uniform?seconds=4&fps=20&buffers=64&width=224&height=192&bits=12"


@pytest.mark.timed
def test_from_the_stamp_of_the_frame_to_the_action_within_two_measurement_periods(tmp_path: Path) -> None:
    """In real time; the alarm ends the run, is in the session, and is silenced by a command."""
    alarms = ({"channel": "axial", "above": 0.0005}, {"channel": "force_N", "above": 3000.0, "end": True})
    said: list[str] = []

    def silence(live: Any, measurement: Any) -> None:
        if measurement.time_step.eyy > 0.001 and not said:
            said.extend(answer("alarm off", live) for _ in range(2))

    outcome = live_run(tmp_path / "run", REAL, each=silence, alarm=alarms, **{"measure.burst": 2})
    period_s = 2 / 20
    with Session.open(tmp_path / "run" / "session.h5") as session:
        told = [event for event in session.events() if event.kind is EventKind.ALARM]
    came = [event for event in told if event.data.get("on")]
    assert [event.data["alarm"] for event in came] == ["axial above 0.0005", "force_N above 3000"]
    assert all(0 < event.data["after_s"] < 2 * period_s for event in came)
    assert said == ["ok", "no: no alarm is on"]
    assert outcome.run_state.history.time_steps[-1].force < 5000  # it ended there


CAMERA = "sim:uniform?seconds=6&fps=30&buffers=64&width=224&height=192&bits=12&hold=1.5"
GAUGES = {
    "axial": {"kind": "line", "start": [112, 40], "end": [112, 150]},
    "across": {"kind": "transverse", "box": [40, 60, 140, 70]},
    "middle": {"kind": "zoi", "at": [112, 96]},
    "part": {"kind": "area", "box": [60, 60, 100, 70]},
}


def measured(lines: Iterable[str | bytes]) -> dict[str, Any]:
    """The first line of a measurement: those before it say that there is none yet."""
    return next(line for line in map(json.loads, lines) if line["frame"] is not None)


@pytest.mark.slow
@pytest.mark.timed
def test_a_test_with_all_that_there_is(tmp_path: Path) -> None:
    folder, again, port, serial = tmp_path / "run", tmp_path / "again", free_port(), PtyPort()
    controls, listeners, answers = (
        ControlPort(SOCKET, None, TerminalScreen(quiet=True)),
        list[Listener](),
        list[str](),
    )

    def order(live: Any, m: Any) -> None:
        if m.number == 3:
            listeners.append(Listener(port))
        if m.number == 20:
            controls.open(live, live.folder)
            caller = Caller(live.folder / SOCKET_NAME)
            answers.extend(caller.ask(line) for line in ("note half way", "start", "alarm off"))
            caller.close()

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.bind(("127.0.0.1", 0))
        more = {
            "gauges": GAUGES,
            "alarm": [{"channel": "gauge_axial", "above": 0.003, "name": "limit"}],
            "strain_out": {
                "tcp": str(port), "udp": f"127.0.0.1:{udp.getsockname()[1]}", "serial": serial.path
            },
            "specimen.area_mm2": 40.0,
            "specimen.standard": "iso6892",
            "record.armed": False,
            "measure.reference_burst": 16,
            "measure.burst": 2,
        }  # fmt: skip
        outcome = live_run(folder, CAMERA, each=order, **more)
        first = measured(udp.recv(1000) for _ in range(50))
    controls.close()
    listeners[0].join(LONG_S)
    got = [said for _, said in listeners[0].got]
    assert len(got) > 40 and first["gauge_axial"] is not None
    assert measured(read(serial, 8)[:8])["frame"] == first["frame"]
    serial.close()
    assert answers[0] == "ok" and answers[1] == "no: recording already"
    came = [e for e in outcome.run_state.event_log.events() if e.kind is EventKind.ALARM and e.data.get("on")]
    assert [event.data["alarm"] for event in came] == ["limit"]
    _against_the_truth(outcome)
    replay = [
        "replay",
        str(folder / "session.h5"),
        "--as-measured",
        "--out",
        str(again),
        "--no-view",
        "--no-rrd",
    ]
    assert main(replay) == 0
    with h5py.File(folder / "strain.h5") as one, h5py.File(again / "strain.h5") as other:
        for name in (
            *(f"gauge_{gauge}" for gauge in GAUGES),
            "eyy",
            "sigma_eyy",
            "force_N",
            "true_stress_Pa",
        ):
            np.testing.assert_array_equal(one["entry/mean"][name][()], other["entry/mean"][name][()], name)


def _against_the_truth(outcome: Any) -> None:
    """The gauges within 1 % and five sigma."""
    specimen, time_steps = outcome.rig.specimen, outcome.run_state.history.time_steps
    reference = next(e for e in outcome.run_state.event_log.events() if e.kind is EventKind.REFERENCE)
    assert specimen.axial_strain(specimen.elapsed(reference.t)) < 1e-5, "the reference was taken late"
    t = specimen.elapsed(np.array([i.t for i in time_steps]))
    for name, truth in (
        ("axial", specimen.axial_strain(t)),
        ("part", specimen.axial_strain(t)),
        ("across", specimen.transverse_strain(t)),
    ):
        values = np.array([i.gauges[name].value for i in time_steps])
        sigmas = np.array([i.gauges[name].sigma for i in time_steps])
        assert (np.abs(values - truth) < 0.01 * np.abs(truth) + 5 * sigmas).all(), name


ABOVE = AlarmConfig(channel="force_N", above=100.0, hysteresis=10.0)
BELOW = AlarmConfig(channel="force_N", below=-100.0, hysteresis=10.0)
COURSE = [
    (99.9, False),
    (100.0, False),  # at the limit it is not yet beyond
    (100.1, True),
    (95.0, True),  # back, not by the hysteresis
    (90.1, True),
    (90.0, False),
    (95.0, False),  # within the hysteresis nothing comes on
    (100.0, False),
    (109.0, True),
    (math.nan, True),  # not known: as before
    (89.0, False),
    (math.nan, False),
]


@pytest.mark.parametrize(("config", "sign"), [(ABOVE, 1), (BELOW, -1)])
def test_on_beyond_the_limit_off_within_it_by_the_hysteresis(config: AlarmConfig, sign: int) -> None:
    alarm, before = Alarm(config), False
    for value, on in COURSE:
        assert alarm.check(sign * value) == (on != before), value
        assert alarm.on == on, value
        before = on
    plain = Alarm(AlarmConfig(channel="x", above=1.0))
    assert [plain.on for value in (1.0, 1.1, 1.0, 0.9) if plain.check(value)] == [True, False]


def test_its_name_has_the_limit() -> None:
    assert Alarm(ABOVE).name == "force_N above 100" and Alarm(BELOW).name == "force_N below -100"
    own = Alarm(AlarmConfig(channel="force_N", above=3000.0, name="grips"))
    assert in_ascii(own.message(3120.5)) == "grips: force 3120.5 N, limit 3000.0 N"


def state_of(events: list[Event]) -> Any:
    """A run whose machine has no channels."""
    health = SimpleNamespace(channels=lambda now: {})
    return SimpleNamespace(health=health, alarms=ActiveAlarms(), event_log=events.append)


@pytest.mark.parametrize(("clock", "after_s"), [("device", 0.465), ("host", 0.465), ("nominal", None)])
def test_an_alarm_says_how_long_after_the_last_frame_it_came(clock: Any, after_s: float | None) -> None:
    events: list[Event] = []
    values: Any = SimpleNamespace(read=lambda measurement: {"axial": 2e-3}, now=Snapshot(START))
    alarm = Alarm(AlarmConfig(channel="axial", above=1e-3))
    watch = AlarmWatch([alarm], values, state_of(events), lambda: START + 0.5)
    m = make_measurement(0)
    watch.measurement(replace(m, burst=replace(m.burst, clock=clock)))
    assert events[0].t == START + 0.5
    assert events[0].data.get("after_s") == (None if after_s is None else pytest.approx(after_s))
    assert watch.end() == "1 came"


@pytest.mark.parametrize("channel", ["silent_s", "mean_axial", "axial"])
def test_what_changes_by_itself_is_looked_at_five_times_a_second(channel: str) -> None:
    nothing: Any = SimpleNamespace(read=dict, now=Snapshot(0.0))
    alarm = Alarm(AlarmConfig(channel=channel, above=1.0))
    watch = AlarmWatch([alarm], nothing, state_of([]), lambda: 0.0)
    assert watch.idle() == 0.2 and watch.end() == "none came"


def test_alarms_see_the_machine_and_both_sides() -> None:
    """The channels of both sides come before those of the machine; why they are lost is told."""
    events: list[Event] = []
    values: Any = SimpleNamespace(read=dict, now=Snapshot(0.0), start=7.0)
    state = state_of(events)
    state.health.channels = lambda now: {"disk_min": now, "mean_axial": 0.0}
    both: Any = SimpleNamespace(lost="", read=lambda start: {"mean_axial": start})
    alarms = [Alarm(AlarmConfig(channel=name, above=1.0)) for name in ("disk_min", "mean_axial")]
    watch = AlarmWatch(alarms, values, state, lambda: 5.0, both)
    watch.idle()
    assert [(event.data["on"], event.data["value"]) for event in events] == [(True, 5.0), (True, 7.0)]
    both.lost = "why"
    assert (
        watch.end() == "2 came" and AlarmWatch(alarms, values, state_of([]), lambda: 5.0).end() == "none came"
    )


@pytest.mark.parametrize(
    ("channel", "value", "words"),
    [
        ("axial", 4.45e-3, "axial 4450 um/m, limit 1000 um/m"),
        ("gauge_tip", -2e-3, "gauge tip -2000 um/m, limit 1000 um/m"),
        ("disk_min", 4.5, "disk full in 4.5 min, limit 0.001"),
        ("lost_share", 0.25, "lost share 0.25, limit 0.001"),
        ("sigma_axial", 5e-6, "sigma axial 5 um/m, limit 1000 um/m"),
        ("sigma_mean_axial", 5e-6, "sigma mean axial 5 um/m, limit 1000 um/m"),
        ("bending_gauge_left", -5e-6, "bending gauge left -5 um/m, limit 1000 um/m"),
        ("stress_MPa", 12.5, "stress 12.5 MPa, limit 0.0 MPa"),
        ("latency_s", 0.25, "latency 0.25 s, limit 0.001"),
        ("noise_GL", 2.5, "noise 2.5 GL, limit 0.001"),
        ("strain_rate", 0.25, "strain rate 0.25, limit 0.001"),
        ("load_silent_s", 2.0, "no force for 2 s, limit 0.001"),
        ("largest", 0.25, "largest 25.000 %, limit 1000 um/m"),
    ],
)
def test_a_channel_is_named_with_its_unit(channel: str, value: float, words: str) -> None:
    assert in_ascii(in_words(channel, value, 1e-3)) == words
