"""Alarms: when they come on and go off, their actions and delay; and a run with all outputs in real time."""

from __future__ import annotations

import json
import math
import socket
from collections.abc import Iterable
from dataclasses import fields
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
from live.run.alarms import ACTIONS, ActionMeans, Alarm, AlarmWatch, actions_of, check_alarms
from live.run.control import SOCKET_NAME, ControlPort, answer
from live.run.live_run import run_live
from live.ui.terminal.screen import TerminalScreen
from tests.live.made_up import in_ascii
from tests.live.run.test_strain_output import Listener, free_port, read
from tests.live.run.test_tcp_lines import Caller
from tests.live.screens import RecordingScreen
from tests.live.test_end_to_end import live_run
from tests.live.ui.waiting import LONG_S


def changes(alarm: Alarm, *values: float) -> list[bool]:
    return [alarm.on for value in values if alarm.check(value)]


def test_on_beyond_the_limit_and_off_when_back_by_the_hysteresis() -> None:
    alarm = Alarm(AlarmConfig(channel="force_N", above=100.0, hysteresis=10.0))
    assert changes(alarm, 99, 101, 95, math.nan, 91, 90, 100, 101) == [True, False, True]
    alarm = Alarm(AlarmConfig(channel="disk_min", below=5.0, hysteresis=1.0))
    assert changes(alarm, 6, 5, 4.9, 5.5, 6.1) == [True, False]


def test_without_hysteresis_the_limit_itself_is_off() -> None:
    assert changes(Alarm(AlarmConfig(channel="x", above=1.0)), 1.0, 1.1, 1.0, 0.9) == [True, False]


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


@pytest.mark.parametrize(
    ("config", "value", "words"),
    [
        (AlarmConfig(channel="axial", above=0.004), 0.00445, "axial 4450 um/m, limit 4000 um/m"),
        (AlarmConfig(channel="gauge_tip", below=-0.001), -0.002, "gauge tip -2000 um/m, limit -1000 um/m"),
        (
            AlarmConfig(channel="force_N", above=3000.0, name="grips"),
            3120.5,
            "grips: force 3120.5 N, limit 3000.0 N",
        ),
        (AlarmConfig(channel="disk_min", below=5.0), 4.5, "disk full in 4.5 min, limit 5"),
        (AlarmConfig(channel="lost_share", above=0.1), 0.25, "lost share 0.25, limit 0.1"),
    ],
)
def test_its_message_has_value_unit_and_limit(config: AlarmConfig, value: float, words: str) -> None:
    assert in_ascii(Alarm(config).message(value)) == words


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


def test_the_vital_signs() -> None:
    health = Health()
    assert math.isnan(health.channels(5.0)["silent_s"])
    health.frame_t, health.disk_s = 3.0, 120.0
    assert health.channels(5.0)["silent_s"] == 2.0 and health.channels(5.0)["disk_min"] == 2.0


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
