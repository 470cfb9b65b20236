"""A live run that is not started: its words, its exit code, its commands, and its end."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.errors import DataError, DeviceError
from acquire.events import EventKind
from acquire.frame import Frame
from acquire.load_cell.contract import NoLoadCell
from live.config.loading import load_config
from live.pipeline.consumer import Consumer, Screen
from live.pipeline.run_state import RunState
from live.run import camera_run as module
from live.run.camera_run import CameraRun
from live.run.control import ControlRefused
from live.run.incoming_bursts import TAKING
from live.run.live_run import CameraOfTest, LiveRun, _run
from live.run.outcome import INTERRUPTED, TIME_IS_OVER, StopSignal
from live.stream.stream import Stream, Subscriber, Waiting
from tests.live.fakes import ListCamera, frame
from tests.live.made_up import make_measurement


class Words(Screen):
    """Keeps what is shown."""

    is_due = True

    def __init__(self) -> None:
        self.shown: list[tuple[str, str]] = []

    def snapshot(self, snapshot: Any, words: str = "") -> None:
        self.shown.append((snapshot.doing, words))


class Recording(Subscriber):
    """In place of the pre-trigger buffer."""

    takes = (Frame,)

    def __init__(self, *, on: bool = True) -> None:
        self.on, self.failed, self.backlog = on, None, 0.0
        self.given: list[tuple[int, str]] = []

    def take(self, record: Any) -> None:
        self.given.append((record.body.index, record.role))

    def command(self, what: str) -> str:
        self.on = what == "start"
        return what


def run(recording: Any = None, *, live: bool = True, seconds: float | None = None, measured: int = 0) -> Any:
    """A run of a reference of 4 and bursts of 2, that has ``measured`` so many bursts."""
    run_state, screen, stop, stream = RunState.new(0.5), Words(), StopSignal(), Stream()
    prepared: Any = SimpleNamespace(
        rig=SimpleNamespace(camera=ListCamera([], live=live), load=NoLoadCell()),
        config=load_config(None, {} if seconds is None else {"output.seconds": seconds}),
        bursts=(4, 2),
        folder=Path("run"),
        plan=SimpleNamespace(grid=SimpleNamespace(size=32, step=16)),
        start=None,
    )
    for k in range(measured):
        run_state.history.add(make_measurement(k).time_step)
    one = CameraRun("", prepared, run_state, screen, stop, stream, lambda about, state: [])
    one.record_with(recording)
    whole = LiveRun({"": one}, prepared.rig.load, Path("run"), stream, stop)
    return SimpleNamespace(
        run=whole, one=one, state=run_state, screen=screen, stop=stop, stream=stream, prepared=prepared
    )


def test_the_state_is_what_is_done_with_the_frames() -> None:
    assert run().one.state == "not recorded" and not run().run.recording
    recording = Recording()
    bench = run(recording)
    assert bench.one.state == "REC" and bench.run.recording
    bench.run.command(EventKind.PAUSE)
    assert bench.one.state == "REC" and bench.run.paused
    assert bench.state.snapshot(0.0).paused
    recording.failed = "the disk is full"  # type: ignore[assignment]
    assert bench.one.state == "NOT RECORDING"
    armed = run(Recording(on=False))
    assert armed.one.state == "ARMED"
    assert armed.run.command(EventKind.RECORD, "start") == "start" and armed.one.state == "REC"
    armed.run.command(EventKind.RECORD, "stop")
    assert armed.one.state == "NOT RECORDING"
    with pytest.raises(ControlRefused, match="records nothing"):
        run().run.command(EventKind.RECORD, "start")


def test_commands_that_change_nothing_are_refused_and_others_are_events() -> None:
    bench = run()
    with pytest.raises(ControlRefused, match="measuring is not paused"):
        bench.run.command(EventKind.RESUME)
    bench.run.command(EventKind.PAUSE)
    with pytest.raises(ControlRefused, match="measuring is paused already"):
        bench.run.command(EventKind.PAUSE)
    bench.run.command(EventKind.RESUME)
    bench.run.command(EventKind.NOTE, "slipped")
    bench.run.command(EventKind.NEW_REFERENCE)
    bench.state.alarms.set("a", "a: high")
    bench.run.command(EventKind.ALARM)
    with pytest.raises(ControlRefused, match="no alarm is on"):
        bench.run.command(EventKind.ALARM)
    assert [(event.kind, event.text) for event in bench.state.event_log.events()] == [
        (EventKind.PAUSE, "measuring is paused"), (EventKind.RESUME, "measuring goes on"),
        (EventKind.NOTE, "slipped"), (EventKind.NEW_REFERENCE, "a new reference is taken from the next frames"),
        (EventKind.ALARM, "silenced: a"),
    ]  # fmt: skip
    assert bench.one.source._retake.is_set()


def test_a_frame_is_of_a_reference_until_that_is_complete() -> None:
    recording = Recording()
    bench = run(recording)
    for k in range(6):
        bench.one.source._take(frame(k))
    assert recording.given == [(k, "reference" if k < 4 else "plain") for k in range(6)]
    assert bench.state.health.fps == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("what", "code"),
    [
        ("", 0), ("DataError", 4), ("DeviceError", 3), ("a defect", 1), ("load", 3), ("measuring", 1),
        ("interrupted", 130), ("lost", 5), ("unrecorded", 5), ("load_lost", 5), ("not counted", 5),
        ("disk", 5), ("results", 5), ("no values", 5), ("skipped", 0),
    ],
)  # fmt: skip
def test_the_exit_code_says_what_was_lost(what: str, code: int) -> None:
    recording: Any = Recording()
    bench = run(recording, measured=0 if what == "no values" else 1)
    errors = {"DataError": DataError("x"), "DeviceError": DeviceError("x"), "a defect": ValueError("x")}
    bench.one.source.error = errors.get(what)
    bench.one._keeper.load_failure = 3 if what == "load" else 0
    bench.one.measurer.failure = int(what == "measuring")
    bench.stop.request(INTERRUPTED if what == "interrupted" else "the time is over")
    counts = {"lost": {"lost": 1}, "load_lost": {"load_lost": 1}, "not counted": {"grabbed": 1},
              "unrecorded": {"unrecorded": 1, "grabbed": 1, "measured": 1},
              "skipped": {"grabbed": 5, "recorded": 5, "skipped": 5}}  # fmt: skip
    bench.state.frame_counts.add(**counts.get(what, {}))
    recording.failed = "the disk is full" if what == "disk" else None
    if what == "results":
        bench.one.outputs._adapted.append(SimpleNamespace(failed="stuck", critical=True))
    assert bench.one.exit_code == code


@pytest.mark.parametrize(
    ("live", "begun_s", "silent_s", "ends"),
    [
        (True, 10.1, 1.0, True), (True, 10.1, 0.9, False), (True, 10.0, 5.0, False), (False, 10.1, 5.0, False),
        (True, 10.1, float("nan"), True),
    ],
)  # fmt: skip
def test_a_timed_run_ends_where_a_live_camera_has_gone_silent(
    monkeypatch: pytest.MonkeyPatch, live: bool, begun_s: float, silent_s: float, ends: bool
) -> None:
    bench = run(live=live, seconds=10.0)
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: 100.0))
    bench.one.source.begun_t, bench.state.health.frame_t = 100.0 - begun_s, 100.0 - silent_s
    bench.stream.publish(Waiting(""))
    assert bench.prepared.rig.camera.stopped.is_set() is ends
    assert not bench.stop.is_set(), "other cameras go on"
    bench.one.close()
    (ended,) = bench.state.event_log.events()
    assert ended.text == f"the test ends: {TIME_IS_OVER if ends else 'camera ended'}"


def test_what_it_waits_for_is_shown_while_nothing_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: 100.0))

    def shown(words: str, silent_s: float, measured: int, *, paused: bool = False) -> list[tuple[str, str]]:
        bench = run(measured=measured)
        bench.state.health.frame_t = 100.0 - silent_s
        bench.one._incoming.paused = bench.state.health.paused = paused
        bench.stream.publish(Waiting(words))
        return list(bench.screen.shown)

    assert shown("waiting for frames", 2.0, 1) == [("not recorded", "waiting for frames")]
    assert shown("waiting for frames", 0.5, 1) == [("not recorded", "")]
    assert shown("waiting for frames", 0.5, 0) == [("not recorded", "waiting for frames")]
    assert shown("", 2.0, 1) == []
    assert shown("", 0.5, 1, paused=True) == [("not recorded, PAUSED", "")]


@pytest.mark.parametrize(
    ("grabbed", "lost", "measured", "hints"), [(12, 1, 0, 1), (11, 1, 0, 0), (12, 0, 0, 0), (12, 1, 1, 0)]
)
def test_a_hint_where_frames_are_lost_again_and_again_in_the_reference(
    grabbed: int, lost: int, measured: int, hints: int
) -> None:
    bench = run(measured=measured)
    bench.state.frame_counts.add(grabbed=grabbed, lost=lost)
    for _ in range(2):
        bench.stream.publish(Waiting(TAKING))
    assert len(bench.state.event_log.events("warning")) == hints


def ending(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, opened: Any) -> list[Any]:
    """What is done at the end of a test whose recording is ``opened``, or cannot be, and whose start fails."""
    bench, done = run(), list[Any]()

    def open_recording(*given: Any) -> Any:
        if isinstance(opened, Exception):
            raise opened
        return opened

    def fails(live: Any) -> None:
        raise DeviceError("the start failed")

    class Ends(Consumer):
        blocks = False

        def end(self) -> str:
            done.append("outputs")
            return ""

    monkeypatch.setattr(module, "open_recording", open_recording)
    bench.state.event_log.add_listener(lambda event: done.append(event.text))
    bench.prepared.folder, bench.prepared.announcement = tmp_path, lambda: ()
    camera = CameraOfTest(bench.prepared.config, bench.screen, lambda about, state: [Ends()])
    with pytest.raises((DataError, DeviceError)):
        _run({"": camera}, {"": bench.prepared}, {"": bench.state}, tmp_path, bench.stop, fails)
    assert '"address"' in (tmp_path / "config.json").read_text(encoding="utf-8")
    return done


def test_outputs_are_ended_where_the_recording_cannot_be_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert ending(tmp_path, monkeypatch, DataError("the folder is full")) == ["outputs"]


def test_the_recording_is_closed_last_with_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording: Any = Recording()
    closed: list[Any] = []
    recording.close = closed.append
    done = ending(tmp_path, monkeypatch, recording)
    assert done[0] == "the test begins" and done[-2:] == ["outputs", "the test ends: camera ended"]
    assert closed == [{"stop_reason": "camera ended"}]


def test_all_that_measure_have_ended_before_the_outputs_are_closed() -> None:
    """The reference of one camera is refused while another still measures."""
    bench, order = run(), list[str]()
    measurer: Any = SimpleNamespace(end=lambda: order.append("measured"))
    bench.one.measurer = measurer
    bench.one.outputs = SimpleNamespace(end=lambda: order.append("outputs"))
    bench.one.drain()
    bench.one.close()
    assert order == ["measured", "outputs"]


def test_a_run_that_is_armed_says_so_when_it_begins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording: Any = Recording(on=False)
    recording.close = lambda counts: None
    done = ending(tmp_path, monkeypatch, recording)
    assert done[0] == "the test begins; nothing is recorded until the command start"


def test_the_first_reason_to_stop_counts_and_whoever_asks_late_is_told_at_once() -> None:
    stop, told = StopSignal(), list[str]()
    stop.on_request(lambda: told.append("early"))
    assert not stop.is_set() and stop.reason == "" and told == []
    stop.request("an alarm")
    stop.request("the time is over")
    assert stop.is_set() and stop.reason == "an alarm" and told == ["early", "early"]
    stop.on_request(lambda: told.append("late"))
    assert told[2:] == ["late"]


def test_a_run_tells_the_range_of_its_load_cell(monkeypatch: pytest.MonkeyPatch) -> None:
    assert math.isnan(run().state.health.load_range_N), "no load cell, no range"
    monkeypatch.setattr(NoLoadCell, "info", replace(NoLoadCell.info, capacity_N=2000.0))
    assert run().state.health.load_range_N == 2000.0
