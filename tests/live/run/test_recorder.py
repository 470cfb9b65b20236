"""The recorder: takes everything, counts what it cannot write, and never ends a test."""

from __future__ import annotations

import math
import threading
from typing import Any

from acquire.errors import DataError
from acquire.load_sample import LoadSample
from live.run.recorder import Recorder
from live.tell.journal import Journal
from live.tell.ledger import Ledger
from tests.live.fakes import frame


class FakeWriter:
    """Keeps what is written; fails from the k-th frame on; may be held up."""

    def __init__(self, fails_at: int | None = None, error: Exception | None = None) -> None:
        self.frames: list[int] = []
        self.others: list[Any] = []
        self.ledger: dict[str, Any] | None = None
        self.closed = False
        self._fails_at, self._error = fails_at, error or DataError("session.h5: the disk is full")
        self.unflushed_frames = 0
        self.go = threading.Event()
        self.go.set()

    def write_frame(self, item: Any) -> int:
        self.go.wait(10)
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

    def write_ledger(self, ledger: dict[str, Any]) -> None:
        self.ledger = ledger

    def flush_when_due(self) -> float:
        return math.inf

    def close(self) -> None:
        self.closed = True


def recorded(writer: FakeWriter, n: int, limit: int = 10**6) -> tuple[Ledger, Journal]:
    ledger, journal = Ledger(), Journal()
    recorder = Recorder(writer, ledger, journal, limit)  # type: ignore[arg-type]
    for i in range(n):
        ledger.add(grabbed=1, measured=1)
        recorder.frame(frame(i))
        recorder.sample(LoadSample(t=i, force=1.0))
    writer.go.set()
    recorder.close({"stop_reason": "test"})
    return ledger, journal


def test_everything_is_written_and_the_ledger_last() -> None:
    writer = FakeWriter()
    ledger, journal = recorded(writer, 20)
    assert writer.frames == list(range(20))
    assert len(writer.others) == 20
    assert writer.ledger is not None
    assert writer.ledger["recorded"] == 20
    assert ledger.adds_up
    assert not ledger.loss
    assert writer.closed
    assert not journal.events("warning", "error")


def test_a_full_buffer_leaves_a_counted_gap() -> None:
    writer = FakeWriter()
    writer.go.clear()
    size = frame(0).image.nbytes
    ledger, journal = recorded(writer, 20, limit=3 * size)
    assert ledger.recorded == len(writer.frames) <= 5
    assert ledger.recorded + ledger.unrecorded == 20
    assert ledger.loss
    assert ledger.adds_up
    assert "frames are not recorded; measuring goes on" in journal.events("error")[0].text


def test_a_full_disk_stops_the_recording_alone() -> None:
    writer = FakeWriter(fails_at=7)
    ledger, journal = recorded(writer, 20)
    assert (ledger.recorded, ledger.unrecorded) == (6, 14)  # the seventh was not flushed
    assert ledger.adds_up
    texts = [event.text for event in journal.events("error")]
    assert texts == ["recording has stopped, measuring goes on: session.h5: the disk is full"]
    assert writer.closed


def test_a_defect_is_told_as_one() -> None:
    ledger, journal = recorded(FakeWriter(fails_at=0, error=TypeError("oops")), 2)
    assert ledger.unrecorded == 2
    assert "a defect of the recorder: TypeError('oops')" in journal.events("error")[0].text
