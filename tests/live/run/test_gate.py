"""The gate before the recorder: what passes, what is kept, in which order, and that every frame is counted."""

from __future__ import annotations

import math
import threading
from typing import Any

import pytest

from acquire.events import Event, EventKind
from acquire.load_sample import LoadSample
from live.operate import START, STOP, OrderRefused
from live.run.gate import Gate, Keep
from live.tell import Journal, Ledger
from tests.live.fakes import frame


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

    def close(self, ledger: dict[str, Any]) -> None:
        self.given.append("closed")


class Bench:
    """A gate with frames of 24 bytes, ten a second."""

    def __init__(
        self, seconds: float = 0.5, *, on: bool = False, most: int = 10**6, above_N: float = math.inf
    ) -> None:
        self.recorder, self.ledger = FakeRecorder(), Ledger()
        self.gate = Gate(self.recorder, self.ledger, Journal(), Keep(seconds, most, above_N), on=on)

    def frames(self, *indices: int, needed: bool = False) -> None:
        for index in indices:
            self.gate.frame(frame(index), needed=needed)

    def measured(self, first: int, last: int) -> None:
        self.gate.event(
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
    bench = Bench()
    bench.frames(*range(10))
    bench.gate.sample(LoadSample(0.9, 5.0))  # the load is recorded all the time
    bench.frames(10)
    assert bench.given == [("load", 5.0)]
    assert bench.gate.order(START) == "with 6 before"
    bench.frames(11)
    assert bench.given == [("load", 5.0), 5, 6, 7, 8, 9, 10, 11]
    assert bench.ledger.thinned == 5
    bench.gate.order(STOP)
    bench.frames(12, 13)
    bench.gate.close({})
    assert bench.given[-2:] == [11, "closed"]
    assert bench.ledger.thinned == 7


def test_what_is_kept_is_bounded_in_bytes() -> None:
    bench = Bench(60, most=24 * 3 + 10)
    bench.frames(*range(8))
    bench.gate.order(START)
    assert bench.given == [5, 6, 7] and bench.ledger.thinned == 5


def test_a_reference_passes_a_shut_gate() -> None:
    bench = Bench()
    bench.frames(0, 1)
    bench.frames(2, 3, needed=True)
    bench.gate.event(Event(0.3, EventKind.REFERENCE, "m", "", "info", {"first": 2, "last": 3, "n": 2}))
    bench.frames(4)
    bench.gate.order(START)
    assert bench.given == [2, 3, ("reference", 2), 4] and bench.ledger.thinned == 2


def test_measured_bursts_are_told_where_their_frames_are_recorded_whole() -> None:
    bench = Bench(0.25)
    bench.frames(0, 1, needed=True)
    bench.frames(*range(2, 9))
    for first in (2, 5, 6):
        bench.measured(first, first + 1)
    bench.gate.order(START)
    bench.frames(9)
    bench.measured(8, 9)
    bench.gate.order(STOP)
    bench.measured(7, 8)  # after the end, but its frames are there
    bench.frames(10)
    bench.measured(9, 10)
    assert bench.given == [0, 1, 6, 7, 8, ("measured", 6), 9, ("measured", 8), ("measured", 7)]


def test_with_nothing_kept_no_burst_from_before_is_told() -> None:
    bench = Bench(most=10)
    bench.frames(0, needed=True)
    bench.frames(1, 2, 3)
    bench.gate.order(START)
    bench.given.clear()
    bench.measured(1, 2)
    bench.frames(4, 5)
    bench.measured(3, 4)
    bench.measured(4, 5)
    assert bench.given == [4, 5, ("measured", 4)]


def test_a_force_opens_it_once() -> None:
    bench = Bench(above_N=10.0)
    for force in (9.0, math.nan, -11.0):
        assert not bench.gate.on
        bench.gate.sample(LoadSample(0.1, force))
    assert bench.gate.on and bench.given[-1] == ("load", -11.0)
    bench.gate.order(STOP)
    bench.gate.sample(LoadSample(0.2, 99.0))
    assert not bench.gate.on


def test_an_order_that_changes_nothing_is_refused() -> None:
    bench = Bench(on=True)
    with pytest.raises(OrderRefused, match="already"):
        bench.gate.order(START)
    bench.gate.order(STOP)
    with pytest.raises(OrderRefused, match="not recording"):
        bench.gate.order(STOP)
    bench.recorder.failed = "the disk is full"
    with pytest.raises(OrderRefused, match="disk is full"):
        bench.gate.order(START)


class TellingRecorder(FakeRecorder):
    """Its own thread tells something while it takes a frame and while it is closed, and is waited for."""

    gate: Gate

    def _tell(self) -> None:
        event = Event(0.0, EventKind.RECORDER, "session.h5", "the disk is full in 20 s", "warning")
        thread = threading.Thread(target=self.gate.event, args=(event,), daemon=True)
        thread.start()
        thread.join(5.0)
        assert not thread.is_alive(), "it waits for whoever waits for it"

    def frame(self, item: Any) -> None:
        self._tell()
        super().frame(item)

    def close(self, ledger: dict[str, Any]) -> None:
        self._tell()
        super().close(ledger)


def test_a_recorder_that_tells_something_does_not_hold_itself_up() -> None:
    recorder = TellingRecorder()
    recorder.gate = Gate(recorder, Ledger(), Journal(), Keep(0.5, 10**6), on=True)
    recorder.gate.frame(frame(0), needed=False)
    recorder.gate.close({})
    assert recorder.given == [("recorder", None), 0, ("recorder", None), "closed"]
