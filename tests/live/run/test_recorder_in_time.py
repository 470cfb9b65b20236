"""The recorder: how it is opened, what it does from time to time, and what it tells of a gap."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.events import Event, EventKind
from acquire.frame import Burst, CameraInfo
from acquire.load_cell.contract import NoLoadCell
from acquire.load_sample import LoadSample
from live.config.loading import load_config
from live.pipeline.consumer import Screen
from live.pipeline.event_log import EventLog
from live.pipeline.run_state import FrameCounts, RunState
from live.run import recorder
from live.run.control import STOP
from live.run.outcome import StopSignal
from live.run.recorder import Recorder, _announce_disk, open_recording
from tests.live.fakes import frame
from tests.live.made_up import make_measurement
from tests.live.run.test_recording import FakeBurstWriter, FakeWriter, RecordingSetup, recorder_of


class Opened:
    """A recording with these settings, its recorder and writer in name only."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *, live: bool = True, **settings: Any) -> None:
        self.given: dict[str, Any] = {}
        self.state, self.stop = RunState.new(0.5), StopSignal()
        for kind in ("SessionWriter", "RotatingWriter"):
            monkeypatch.setattr(recorder, kind, lambda *given, kind=kind: (kind, *given))
        monkeypatch.setattr(recorder, "Recorder", self._recorder)
        monkeypatch.setattr(recorder, "forecast", lambda path, rate: 600.0)
        monkeypatch.setattr(recorder, "network_share", lambda path: "")
        camera = CameraInfo("a:", "a", 100, 80, 8, live, "device", fps=10.0)
        prepared: Any = SimpleNamespace(
            config=load_config(None, {f"record.{key}": value for key, value in settings.items()}),
            rig=SimpleNamespace(camera=SimpleNamespace(info=camera), load=NoLoadCell()),
            folder=Path("run"),
            start=None,
        )
        self.found = open_recording(prepared, self.state, Screen(), self.stop)

    def _recorder(self, writer: Any, counts: Any, event_log: Any, limit: int, **more: Any) -> Any:
        self.given = {"writer": writer, "limit": limit, **more}
        return SimpleNamespace(failed=None, backlog=0.25, event=lambda event: None)


def test_a_recording_is_opened_as_configured(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Opened(monkeypatch)
    assert bench.found is not None and bench.found.on and Burst not in bench.found.takes
    assert bench.given["writer"][:2] == ("SessionWriter", Path("run/session.h5"))
    assert (bench.given["limit"], bench.given["waits"], bench.given["mode"].kind) == (
        512_000_000,
        False,
        "all",
    )
    settings = bench.found._settings
    assert (settings.seconds, settings.max_bytes, settings.above_N) == (2.0, 256_000_000, math.inf)
    assert bench.state.health.disk_s == 600.0 and bench.found.backlog == 0.25
    other = Opened(
        monkeypatch, live=False, buffer_MB=4.0, rotate_MB=20.0, keep_s=0.5, armed=True, start_above_N=30.0,
        mode="bursts",
    )  # fmt: skip
    assert other.found is not None and not other.found.on and Burst in other.found.takes
    assert other.given["writer"][0] == "RotatingWriter" and other.given["writer"][3] == 20_000_000
    assert (other.given["limit"], other.given["waits"], other.given["mode"].kind) == (
        4_000_000,
        True,
        "bursts",
    )
    settings = other.found._settings
    assert (settings.seconds, settings.max_bytes, settings.above_N) == (0.5, 2_000_000, 30.0)
    assert Opened(monkeypatch, enabled=False).found is None


@pytest.mark.parametrize(("when_full", "stops"), [("gap", False), ("stop", True)])
def test_a_recording_that_fails_ends_the_run_where_it_was_asked_to(
    monkeypatch: pytest.MonkeyPatch, when_full: str, stops: bool
) -> None:
    bench = Opened(monkeypatch, when_full=when_full)
    assert bench.given["stop"] is (bench.stop if stops else None)


@pytest.mark.parametrize(
    ("bits", "mode", "fps", "room_s", "MB", "words"),
    [
        pytest.param(8, "all", None, 1800.0, 15, "recording about 15 MB/s", id="of no rate"),
        pytest.param(8, "all", 10.0, 1799.0, 5, "warning: recording about 5 MB/s", id="below half an hour"),
        pytest.param(12, "all", 50.0, 1800.0, 50, "recording about 50 MB/s", id="two bytes a pixel"),
        pytest.param(12, "every=2", 50.0, 1800.0, 25, "recording about 25 MB/s", id="every second frame"),
    ],
)
def test_the_room_on_the_disk_is_announced_for_the_bytes_that_are_recorded(
    monkeypatch: pytest.MonkeyPatch,
    bits: int,
    mode: str,
    fps: float | None,
    room_s: float,
    MB: int,
    words: str,
) -> None:
    printed: list[str] = []
    asked: list[float] = []
    monkeypatch.setattr(Screen, "print", lambda self, text="": printed.append(text))
    monkeypatch.setattr(recorder, "forecast", lambda path, rate: asked.append(rate) or room_s)
    monkeypatch.setattr(recorder, "network_share", lambda path: "nfs")
    camera = CameraInfo("a:", "a", 1000, 500, bits, True, "device", fps=fps)
    kept = recorder.RecordMode.parse(mode)
    assert _announce_disk(Path("run/session.h5"), camera, kept, Screen()) == room_s
    assert asked == pytest.approx([MB * 1e6])
    assert printed == [
        f"{words} at most, room for 30 minutes",
        "warning: run is on a network share (nfs); a local disk is safer",
    ]


class ClockWriter(FakeBurstWriter):
    """Counts the pairs of clocks."""

    def __init__(self) -> None:
        super().__init__()
        self.clocks = 0

    def write_clock(self, pair: Any) -> None:
        self.clocks += 1

    def flush(self) -> None:
        pass


def test_clocks_are_compared_each_minute_and_the_disk_each_five_seconds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rates: list[float] = []
    monkeypatch.setattr(recorder, "forecast", lambda path, rate: rates.append(rate) or 200.0)
    writer, health = ClockWriter(), RunState.new(0.5).health
    one = Recorder(writer, FrameCounts(), EventLog(), 10**6, health=health, now=lambda: 100.0)  # type: ignore[arg-type]
    one.close({})
    assert writer.clocks == 2, "when it begins and when it ends"
    for now in (160.0, 160.1, 219.9, 220.1):
        one._do_periodic(now)
    assert writer.clocks == 4
    assert rates == [10**6 / 60.0, 10**6 / 119.9], "bytes a second since it began"
    for now in (224.9, 225.0, 225.1, 229.9):
        one._do_periodic(now)
    assert len(rates) == 3 and health.disk_s == 200.0


@pytest.mark.parametrize(("seconds", "warned"), [(180.0, False), (179.0, True)])
def test_a_disk_that_lasts_less_than_three_minutes_is_told(
    monkeypatch: pytest.MonkeyPatch, seconds: float, warned: bool
) -> None:
    monkeypatch.setattr(recorder, "forecast", lambda path, rate: seconds)
    one, _, _, event_log = recorder_of("all")
    one._check_disk(2.0)
    one.close({})
    texts = [event.text for event in event_log.events("warning")]
    assert texts == (
        ["the disk is full in 179 s at this rate; free some space, the recording goes on"] * warned
    )


def test_a_gap_is_told_when_it_begins_and_with_its_frames_when_it_ends() -> None:
    one, writer, counts, event_log = recorder_of("all")
    put, full = one._buffer.put, iter([False, True, True, True, False, False])
    one._buffer.put = lambda *given, **more: not next(full) and put(*given, **more)  # type: ignore[method-assign]
    for k in range(6):
        one.frame(frame(k))
    one.close({})
    assert (counts.recorded, counts.unrecorded, writer.frames) == (3, 3, [0, 4, 5])
    assert [(event.level, dict(event.data)) for event in event_log.events("warning", "error")] == [
        ("error", {"from": 1}), ("warning", {"count": 3}),
    ]  # fmt: skip


def test_samples_and_events_are_written_however_full_the_buffer_is() -> None:
    writer = FakeWriter()
    writer.go.clear()
    one = Recorder(writer, FrameCounts(), EventLog(), 1)  # type: ignore[arg-type]
    for k in range(3):
        one.frame(frame(k))
    event, sample = Event(1.0, EventKind.NOTE, "operator", "slipped"), LoadSample(1.0, 5.0, raw=b"5 N")
    one.event(event)
    one.sample(sample)
    writer.go.set()
    one.close({})
    assert writer.others == [event, sample] and len(writer.frames) < 3


def test_every_third_frame_is_recorded_and_the_others_are_left_out_on_purpose() -> None:
    one, writer, counts, _ = recorder_of("every=3")
    for k in range(10, 18):
        one.frame(frame(k))
    one.close({})
    assert writer.frames == [10, 13, 16]
    assert (counts.recorded, counts.thinned, counts.unrecorded) == (3, 5, 0)


def test_bursts_that_do_not_fit_are_a_gap_of_their_frames() -> None:
    one, _, counts, event_log = recorder_of("bursts", full=True)
    for k in range(2):
        one.burst(make_measurement(k).burst)
    assert (counts.unrecorded, counts.thinned) == (16, -16)
    one._buffer.put = lambda *_, **__: True  # type: ignore[method-assign]
    one.burst(make_measurement(2).burst)
    one.close({})
    assert [dict(event.data) for event in event_log.events("warning")] == [{"count": 16}]


def test_nothing_is_written_after_a_failure_and_the_file_is_closed() -> None:
    failed, stop = list[str](), StopSignal()
    stop.on_request(lambda: failed.append(stop.reason))
    writer = FakeWriter(fails_at=1)
    counts = FrameCounts()
    one = Recorder(writer, counts, EventLog(), 10**6, stop=stop)  # type: ignore[arg-type]
    for k in range(4):
        one.frame(frame(k))
    one.close({})
    assert (failed, writer.closed, writer.frame_counts) == (["recording failed"], True, None)
    assert one.failed == "session.h5: the disk is full"
    assert (counts.recorded, counts.unrecorded) == (0, 4), "the first was not flushed"


def test_a_force_begins_no_recording_that_was_on_and_was_ended() -> None:
    bench = RecordingSetup(above_N=10.0, on=True)
    bench.pre_trigger.command(STOP)
    bench.pre_trigger.sample(LoadSample(0.1, 99.0))
    assert not bench.pre_trigger.on
    armed = RecordingSetup(above_N=10.0)
    armed.pre_trigger.sample(LoadSample(0.1, 10.0))
    assert not armed.pre_trigger.on, "at the limit it is not above"


@pytest.mark.parametrize(("first", "asked", "told"), [(4, (2, 4), [2, 4]), (5, (4, 5), [5])])
def test_bursts_are_told_across_a_reference_that_follows_without_a_gap_alone(
    first: int, asked: tuple[int, int], told: list[int]
) -> None:
    """Frames 0 to 3 were recorded, then a reference of two frames: at once, or with frame 4 not recorded."""
    bench = RecordingSetup(on=True)
    bench.frames(0, 1, 2, 3)
    bench.pre_trigger.command(STOP)
    bench.frames(*range(4, first))
    bench.frames(first, first + 1, is_reference=True)
    for begin in asked:
        bench.measured(begin, begin + 1)
    assert [item[1] for item in bench.given if isinstance(item, tuple)] == told


def test_the_backlog_is_the_share_of_the_buffer() -> None:
    writer = FakeWriter()
    writer.go.clear()
    one = Recorder(writer, FrameCounts(), EventLog(), 96)  # type: ignore[arg-type]
    one._buffer.put(frame(0), 0, always=True)
    while one._buffer._items:  # the thread has it, and is held up
        pass
    for k in (1, 2):
        one.frame(frame(k))
    assert (one.waiting_bytes, one.backlog) == (48, 0.5)
    writer.go.set()
    one.close({})
