"""The recorder and the pre-trigger buffer: what is recorded, in which order, and that every frame is counted."""

from __future__ import annotations

import math
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from acquire.errors import DataError
from acquire.events import Event, EventKind
from acquire.load_sample import LoadSample
from acquire.record_mode import RecordMode
from live.pipeline.event_log import EventLog
from live.pipeline.run_state import FrameCounts
from live.run.control import START, STOP, ControlRefused
from live.run.pre_trigger import PreTrigger, PreTriggerBuffer
from live.run.recorder import Recorder
from tests.live.fakes import frame
from tests.live.made_up import make_measurement
from tests.live.ui.waiting import LONG_S


class FakeWriter:
    """Keeps what is written; fails from the k-th frame on; may be held up."""

    def __init__(self, fails_at: int | None = None, error: Exception | None = None) -> None:
        self.frames: list[int] = []
        self.others: list[Any] = []
        self.frame_counts: dict[str, Any] | None = None
        self.closed = False
        self._fails_at, self._error = fails_at, error or DataError("session.h5: the disk is full")
        self.unflushed_frames = 0
        self.go = threading.Event()
        self.go.set()

    def write_frame(self, item: Any) -> int:
        self.go.wait(LONG_S)
        if self._fails_at is not None and len(self.frames) >= self._fails_at:
            raise self._error
        self.frames.append(item.index)
        self.unflushed_frames = len(self.frames) % 3
        return len(self.frames) - 1

    def write_load(self, sample: Any) -> None:
        self.others.append(sample)

    def write_event(self, event: Any) -> None:
        self.others.append(event)

    def write_clock(self, pair: Any) -> None:
        pass

    def write_ledger(self, frame_counts: dict[str, Any]) -> None:
        self.frame_counts = frame_counts

    def flush_when_due(self) -> float:
        return math.inf

    def close(self) -> None:
        self.closed = True


def recorded(writer: FakeWriter, n: int, limit: int = 10**6) -> tuple[FrameCounts, EventLog]:
    frame_counts, event_log = FrameCounts(), EventLog()
    recorder = Recorder(writer, frame_counts, event_log, limit)  # type: ignore[arg-type]
    for i in range(n):
        frame_counts.add(grabbed=1, measured=1)
        recorder.frame(frame(i))
        recorder.sample(LoadSample(t=i, force=1.0))
    writer.go.set()
    recorder.close({"stop_reason": "test"})
    return frame_counts, event_log


def test_everything_is_written_and_the_ledger_last() -> None:
    writer = FakeWriter()
    frame_counts, event_log = recorded(writer, 20)
    assert writer.frames == list(range(20))
    assert len(writer.others) == 20
    assert writer.frame_counts is not None
    assert writer.frame_counts["recorded"] == 20
    assert frame_counts.adds_up
    assert not frame_counts.loss
    assert writer.closed
    assert not event_log.events("warning", "error")


def test_what_still_waits_for_a_slow_disk_is_told(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    class SlowWriter(FakeWriter):
        def write_frame(self, item: Any) -> int:
            time.sleep(0.05)
            return super().write_frame(item)

    monkeypatch.setattr("live.run.recorder.TELL_S", 0.01)
    caplog.set_level("INFO", "live.run.recorder")
    recorded(writer := SlowWriter(), 8)
    assert writer.closed and len(writer.frames) == 8
    assert "MB still wait for the disk" in caplog.text


def test_a_full_buffer_leaves_a_counted_gap() -> None:
    writer = FakeWriter()
    writer.go.clear()
    size = frame(0).image.nbytes
    frame_counts, event_log = recorded(writer, 20, limit=3 * size)
    assert frame_counts.recorded == len(writer.frames) <= 5
    assert frame_counts.recorded + frame_counts.unrecorded == 20
    assert frame_counts.loss
    assert frame_counts.adds_up
    assert "frames are not recorded; measuring goes on" in event_log.events("error")[0].text


def test_a_full_disk_stops_the_recording_alone() -> None:
    writer = FakeWriter(fails_at=7)
    frame_counts, event_log = recorded(writer, 20)
    assert (frame_counts.recorded, frame_counts.unrecorded) == (6, 14)  # the seventh was not flushed
    assert frame_counts.adds_up
    texts = [event.text for event in event_log.events("error")]
    assert texts == ["recording has stopped, measuring goes on: session.h5: the disk is full"]
    assert writer.closed


def test_a_defect_is_told_as_one() -> None:
    frame_counts, event_log = recorded(FakeWriter(fails_at=0, error=TypeError("oops")), 2)
    assert frame_counts.unrecorded == 2
    assert "a defect of the recorder: TypeError('oops')" in event_log.events("error")[0].text


class FakeBurstWriter(FakeWriter):
    """Takes bursts too, and is a file on a disk."""

    path, bytes_written = Path("session.h5"), 10**6

    def write_burst(self, item: Any) -> int:
        self.others.append(item)
        return 0


def recorder_of(mode: str, *, full: bool = False) -> tuple[Recorder, FakeBurstWriter, FrameCounts, EventLog]:
    writer, frame_counts, event_log = FakeBurstWriter(), FrameCounts(), EventLog()
    one = Recorder(writer, frame_counts, event_log, 10**6, mode=RecordMode.parse(mode))  # type: ignore[arg-type]
    if full:
        one._buffer.put = lambda item, size, **_: False  # type: ignore[method-assign]
    return one, writer, frame_counts, event_log


@pytest.mark.parametrize(("full", "counts"), [(False, (8, 0, 0)), (True, (0, 8, 0))])
def test_frames_of_a_burst_are_recorded_or_missing_with_it(full: bool, counts: tuple[int, ...]) -> None:
    one, writer, found, _ = recorder_of("bursts", full=full)
    for k in range(8):
        one.frame(frame(k))
    assert (found.recorded, found.unrecorded, found.thinned) == (0, 0, 8)
    one.burst(make_measurement(0).burst)
    one.close({})
    assert (found.recorded, found.unrecorded, found.thinned) == counts
    assert len(writer.others) == (not full) and writer.frames == []


def test_where_frames_are_recorded_bursts_are_not() -> None:
    one, writer, found, _ = recorder_of("all")
    one.frame(frame(0))
    one.burst(make_measurement(0).burst)
    one.close({})
    assert (writer.frames, writer.others) == ([0], [])
    assert (found.recorded, found.thinned) == (1, 0)


def test_a_disk_that_fills_is_told_once_until_it_has_room_again(monkeypatch: pytest.MonkeyPatch) -> None:
    rates, seconds = [], iter([30.0, 20.0, 1e6, 10.0])

    def forecast(path: Path, rate: float) -> float:
        rates.append(rate)
        return next(seconds)

    monkeypatch.setattr("live.run.recorder.forecast", forecast)
    one, _, _, event_log = recorder_of("all")
    for _ in range(4):
        one._check_disk(2.0)
    one.close({})
    assert rates == [5e5] * 4, "bytes a second so far"
    assert [event.data["seconds"] for event in event_log.events("warning")] == [30.0, 10.0]


class FakeRecorder:
    """Notes what it is given, frames by their number."""

    def __init__(self) -> None:
        self.given: list[Any] = []
        self.failed: str | None = None
        self.backlog = 0.0

    def frame(self, item: Any) -> None:
        self.given.append(item.index)

    def burst(self, burst: Any) -> None:
        self.given.append(("burst", burst.first_index))

    def sample(self, sample: LoadSample) -> None:
        self.given.append(("load", sample.force))

    def event(self, event: Event) -> None:
        self.given.append((str(event.kind), event.data.get("first")))

    def close(self, frame_counts: dict[str, Any]) -> None:
        self.given.append("closed")


class RecordingSetup:
    """A gate with frames of 24 bytes, ten a second."""

    def __init__(
        self, seconds: float = 0.5, *, on: bool = False, most: int = 10**6, above_N: float = math.inf
    ) -> None:
        self.recorder, self.frame_counts = FakeRecorder(), FrameCounts()
        self.pre_trigger = PreTriggerBuffer(
            self.recorder, self.frame_counts, EventLog(), PreTrigger(seconds, most, above_N), on=on
        )

    def frames(self, *indices: int, is_reference: bool = False) -> None:
        for index in indices:
            self.pre_trigger.frame(frame(index), is_reference=is_reference)

    def measured(self, first: int, last: int) -> None:
        self.pre_trigger.event(
            Event(
                last / 10,
                EventKind.MEASURED,
                "m",
                "",
                "info",
                {"first": first, "last": last, "n": last - first + 1},
            )
        )

    @property
    def given(self) -> list[Any]:
        return self.recorder.given


def test_what_came_a_little_before_goes_first_and_in_order() -> None:
    bench = RecordingSetup()
    bench.frames(*range(10))
    bench.pre_trigger.sample(LoadSample(0.9, 5.0))  # the load is recorded all the time
    bench.frames(10)
    assert bench.given == [("load", 5.0)]
    assert bench.pre_trigger.command(START) == "with 6 before"
    bench.frames(11)
    assert bench.given == [("load", 5.0), 5, 6, 7, 8, 9, 10, 11]
    assert bench.frame_counts.thinned == 5
    bench.pre_trigger.command(STOP)
    bench.frames(12, 13)
    bench.pre_trigger.close({})
    assert bench.given[-2:] == [11, "closed"]
    assert bench.frame_counts.thinned == 7


def test_what_is_kept_is_bounded_in_bytes() -> None:
    bench = RecordingSetup(60, most=24 * 3 + 10)
    bench.frames(*range(8))
    bench.pre_trigger.command(START)
    assert bench.given == [5, 6, 7] and bench.frame_counts.thinned == 5


def test_a_reference_passes_a_shut_gate() -> None:
    bench = RecordingSetup()
    bench.frames(0, 1)
    bench.frames(2, 3, is_reference=True)
    bench.pre_trigger.event(Event(0.3, EventKind.REFERENCE, "m", "", "info", {"first": 2, "last": 3, "n": 2}))
    bench.frames(4)
    bench.pre_trigger.command(START)
    assert bench.given == [2, 3, ("reference", 2), 4] and bench.frame_counts.thinned == 2


def test_measured_bursts_are_told_where_their_frames_are_recorded_whole() -> None:
    bench = RecordingSetup(0.25)
    bench.frames(0, 1, is_reference=True)
    bench.frames(*range(2, 9))
    for first in (2, 5, 6):
        bench.measured(first, first + 1)
    bench.pre_trigger.command(START)
    bench.frames(9)
    bench.measured(8, 9)
    bench.pre_trigger.command(STOP)
    bench.measured(7, 8)  # after the end, but its frames are there
    bench.frames(10)
    bench.measured(9, 10)
    assert bench.given == [0, 1, 6, 7, 8, ("measured", 6), 9, ("measured", 8), ("measured", 7)]


def test_with_nothing_kept_no_burst_from_before_is_told() -> None:
    bench = RecordingSetup(most=10)
    bench.frames(0, is_reference=True)
    bench.frames(1, 2, 3)
    bench.pre_trigger.command(START)
    bench.given.clear()
    bench.measured(1, 2)
    bench.frames(4, 5)
    bench.measured(3, 4)
    bench.measured(4, 5)
    assert bench.given == [4, 5, ("measured", 4)]


def test_a_force_opens_it_once() -> None:
    bench = RecordingSetup(above_N=10.0)
    for force in (9.0, math.nan, -11.0):
        assert not bench.pre_trigger.on
        bench.pre_trigger.sample(LoadSample(0.1, force))
    assert bench.pre_trigger.on and bench.given[-1] == ("load", -11.0)
    bench.pre_trigger.command(STOP)
    bench.pre_trigger.sample(LoadSample(0.2, 99.0))
    assert not bench.pre_trigger.on


def test_an_order_that_changes_nothing_is_refused() -> None:
    bench = RecordingSetup(on=True)
    with pytest.raises(ControlRefused, match="already"):
        bench.pre_trigger.command(START)
    bench.pre_trigger.command(STOP)
    with pytest.raises(ControlRefused, match="not recording"):
        bench.pre_trigger.command(STOP)
    bench.recorder.failed = "the disk is full"
    with pytest.raises(ControlRefused, match="disk is full"):
        bench.pre_trigger.command(START)


class TellingRecorder(FakeRecorder):
    """Its thread emits an event while it takes a frame and while it closes, and the caller waits for it."""

    pre_trigger: PreTriggerBuffer

    def _tell(self) -> None:
        event = Event(0.0, EventKind.RECORDER, "session.h5", "the disk is full in 20 s", "warning")
        thread = threading.Thread(target=self.pre_trigger.event, args=(event,), daemon=True)
        thread.start()
        thread.join(LONG_S)
        assert not thread.is_alive(), "it waits for whoever waits for it"

    def frame(self, item: Any) -> None:
        self._tell()
        super().frame(item)

    def close(self, frame_counts: dict[str, Any]) -> None:
        self._tell()
        super().close(frame_counts)


def test_a_recorder_that_tells_something_does_not_hold_itself_up() -> None:
    recorder = TellingRecorder()
    recorder.pre_trigger = PreTriggerBuffer(
        recorder, FrameCounts(), EventLog(), PreTrigger(0.5, 10**6), on=True
    )
    recorder.pre_trigger.frame(frame(0), is_reference=False)
    recorder.pre_trigger.close({})
    assert recorder.given == [("recorder", None), 0, ("recorder", None), "closed"]
