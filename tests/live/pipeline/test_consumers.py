"""Consumers: each gets its data by its policy, and a failure of one stops only that one."""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from acquire.errors import DataError
from acquire.events import Event, EventKind
from acquire.load_cell import LoadLog
from acquire.load_sample import LoadSample
from examples.second_consumer import main
from live.pipeline.consumer import Consumer, Policy
from live.pipeline.event_log import EventLog
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import RunState
from live.results.writer import ResultsConsumer
from live.run.alarms import AlarmWatch
from live.run.strain_output import StrainOut
from live.stream.adapted import MAX_EVENTS, Adapted
from live.ui.rerun.consumer import CardWriter, FiguresWriter, RerunConsumer
from live.ui.web.page_consumer import PageConsumer
from tests.live.fakes import frame
from tests.live.made_up import START, make_loads, make_measurement
from tests.live.streaming import Published, record_of
from tests.live.ui.waiting import LONG_S, until


class RecordingConsumer(Consumer):
    """Notes the numbers of its measurements; may wait, and may fail at one."""

    def __init__(self, **how: Any) -> None:
        self.rows: list[int] = []
        self.ended, self.fails_at, self.error = False, None, DataError("strain.h5: the disk is full")
        self.go, self.busy = threading.Event(), threading.Event()
        self.go.set()
        for name, value in how.items():
            setattr(self, name, value)

    def measurement(self, measurement: Measurement) -> None:
        self.busy.set()
        self.go.wait(LONG_S)
        if self.fails_at == len(self.rows):
            raise self.error
        self.rows.append(measurement.number)

    def end(self) -> str:
        self.ended = True
        return "kept"


def outputs(*consumers: Consumer, loads: LoadLog | None = None) -> tuple[Published, EventLog]:
    state = RunState.new(0.5)
    return Published(consumers, state, loads), state.event_log


def give(out: Published, numbers: Sequence[int]) -> None:
    for number in numbers:
        out.add(make_measurement(number))


@pytest.mark.parametrize("blocks", [True, False])
def test_every_measurement_is_passed_on_and_kept(blocks: bool) -> None:
    taker = RecordingConsumer(policy=Policy.WAIT, blocks=blocks)
    out, event_log = outputs(taker)
    give(out, range(100))
    out.end()
    assert taker.rows == list(range(100))
    assert taker.ended
    assert [i.eyy for i in out.history.time_steps] == pytest.approx([1e-3] * 100)
    assert not out.failed
    assert not event_log.events()
    (report,) = out.reports
    assert report.line() == "consumer: 100 measurements; kept"


@pytest.mark.parametrize(
    ("policy", "kept"),
    [(Policy.NEWEST, [0, 8, 9]), (Policy.BOUNDED, [0, 1, 2])],
    ids=["newest wins", "bounded"],
)
def test_one_that_falls_behind_is_served_as_its_policy_says(policy: Policy, kept: list[int]) -> None:
    taker = RecordingConsumer(policy=policy, queue_size=2)
    taker.go.clear()
    out, _ = outputs(taker)
    give(out, [0])
    assert taker.busy.wait(LONG_S)  # it has the first one in hand
    give(out, range(1, 10))  # returns at once
    taker.go.set()
    out.end()
    assert taker.rows == kept
    assert out.reports[0].line() == "consumer: 3 measurements, 7 dropped; kept"


class Putting(RecordingConsumer):
    """Puts something off, and asks to be asked again."""

    asked = 0

    def idle(self) -> float:
        self.asked += 1
        if self.asked == 3:
            self.go.set()
        return 0.01 if self.asked < 3 else math.inf


def test_one_that_puts_things_off_is_asked_when_nothing_comes() -> None:
    taker = Putting(policy=Policy.WAIT)
    out, _ = outputs(taker)
    taker.go.clear()
    out.add(make_measurement(0))
    taker.go.set()
    assert taker.busy.wait(LONG_S)
    taker.go.clear()
    assert taker.go.wait(LONG_S)  # it was asked, although nothing came
    out.end()
    assert taker.rows == [0]


def test_one_that_waits_holds_the_measurement_up_and_loses_nothing() -> None:
    taker = RecordingConsumer(policy=Policy.WAIT, queue_size=2)
    taker.go.clear()
    out, _ = outputs(taker)
    giver = threading.Thread(target=give, args=(out, range(10)))
    giver.start()
    assert taker.busy.wait(LONG_S)
    giver.join(0.2)
    assert giver.is_alive()
    taker.go.set()
    giver.join(LONG_S)
    out.end()
    assert taker.rows == list(range(10))


@pytest.mark.parametrize("blocks", [True, False])
@pytest.mark.parametrize(
    ("error", "says"),
    [(DataError("strain.h5: the disk is full"), "the disk is full"), (TypeError("oops"), "by a defect")],
)
def test_a_failure_stops_one_consumer_alone(error: Exception, says: str, blocks: bool) -> None:
    broken = RecordingConsumer(policy=Policy.WAIT, fails_at=3, error=error, critical=True, blocks=blocks)
    sound = RecordingConsumer(policy=Policy.WAIT)
    out, event_log = outputs(broken, sound)
    give(out, range(200))
    out.end()
    assert broken.rows == [0, 1, 2]
    assert broken.ended
    assert sound.rows == list(range(200))
    assert len(out.history.time_steps) == 200
    assert out.failed
    assert [says in event.text for event in event_log.events("error")] == [True]
    report = out.reports[0]
    assert (report.taken, report.dropped) == ({"measurement": 3}, {}) and says in report.line()


def test_a_failure_of_one_that_is_not_vital_is_a_warning() -> None:
    out, event_log = outputs(RecordingConsumer(fails_at=0))
    give(out, [0])
    out.end()
    assert not out.failed
    assert len(event_log.events("warning")) == 1


def test_one_that_waits_and_fails_lets_the_measurement_go_on() -> None:
    taker = RecordingConsumer(policy=Policy.WAIT, queue_size=1, fails_at=0)
    taker.go.clear()
    out, _ = outputs(taker)
    giver = threading.Thread(target=give, args=(out, range(10)))
    giver.start()
    assert taker.busy.wait(LONG_S)
    taker.go.set()
    giver.join(LONG_S)
    assert not giver.is_alive()
    out.end()


def test_one_that_is_stuck_is_left_behind() -> None:
    taker = RecordingConsumer(timeout_s=0.05)
    taker.go.clear()
    out, _ = outputs(taker)
    give(out, [0])
    assert taker.busy.wait(LONG_S)
    out.end()
    assert "left behind" in out.reports[0].line()
    taker.go.set()


class Listener(Consumer):
    """Takes everything but measurements as they come."""

    name = "listener"

    def __init__(self) -> None:
        self.seen: dict[str, list[Any]] = {"frame": [], "matched": [], "load": [], "event": []}
        self.begun, self.go = threading.Event(), threading.Event()

    def begin(self) -> None:
        self.begun.set()
        self.go.wait(LONG_S)

    def frame(self, frame: Any) -> None:
        self.seen["frame"].append(frame.index)

    def matched(self, measurement: Measurement) -> None:
        self.seen["matched"].append(measurement.force)

    def load(self, sample: LoadSample) -> None:
        self.seen["load"].append(sample)

    def event(self, event: Event) -> None:
        self.seen["event"].append(event.text)


def test_each_kind_reaches_those_who_define_it() -> None:
    listener, taker = Listener(), RecordingConsumer()
    loads = make_loads(10.0, lambda t: 100.0 * t)
    out, event_log = outputs(listener, taker, loads=loads)
    assert listener.begun.wait(LONG_S)
    assert out.wants_frames
    assert not outputs(taker)[0].wants_frames
    give(out, [0, 1])
    for index in range(3):
        out.frame(frame(index))
    sample = LoadSample(START, 5.0, unit="kg")
    out.load(sample)
    for k in range(MAX_EVENTS + 5):
        event_log.emit(EventKind.NOTE, "operator", str(k))
    listener.go.set()
    out.end()
    assert listener.seen["frame"] == [2]  # a camera waits for nobody: the newest wins
    assert listener.seen["matched"] == pytest.approx([0.0, 10.0], abs=1e-6)
    assert listener.seen["load"] == [sample]
    assert listener.seen["event"][0] == "5"
    assert len(listener.seen["event"]) == MAX_EVENTS
    line = out.reports[0].line()
    assert line == "listener: 2 measurements; 1 frame, 2 dropped; 1 load sample; 1\u202f000 events, 5 dropped"


class MatchedConsumer(Consumer):
    """Notes the forces; nothing else is passed on to it."""

    name, blocks = "matched", False

    def __init__(self) -> None:
        self.forces: list[float] = []

    def matched(self, measurement: Measurement) -> None:
        self.forces.append(measurement.force)


def test_measurements_that_wait_for_their_force_come_at_the_end() -> None:
    taker, loads = MatchedConsumer(), make_loads(0.15, lambda t: 100.0 * t)
    out, _ = outputs(taker, loads=loads)
    give(out, [0, 1, 2, 3])
    assert taker.forces == pytest.approx([0.0, 10.0])
    for k in range(16, 40):
        loads.append(LoadSample(START + k / 100, float(k)))
    out.end()
    assert taker.forces == pytest.approx([0.0, 10.0, 20.0, 30.0])


def test_one_that_has_failed_queues_nothing_more() -> None:
    taker, go = RecordingConsumer(queue_size=2, fails_at=0), threading.Event()

    def busy(name: str, why: str, critical: bool) -> None:
        go.wait(LONG_S)

    thread = Adapted(taker, busy)
    thread.start()
    thread.take(record_of(make_measurement(0)))
    until(lambda: bool(thread.failed))
    for number in range(1, 10):
        thread.take(record_of(make_measurement(number)))
    go.set()
    assert thread.end().dropped == {}


def test_it_sees_every_measurement_and_stands_in_the_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(str(tmp_path / "run")) == 0
    lines = capsys.readouterr().out.splitlines()
    printed = [line for line in lines if line.endswith("um/m") and line[:4].strip().isdigit()]
    (report,) = [line for line in lines if line.startswith("largest strain:")]
    assert "the last was" in report
    assert len(printed) >= 3
    assert printed[-1].split()[1] in report


@pytest.mark.parametrize(
    "consumer",
    [ResultsConsumer, AlarmWatch, StrainOut, RerunConsumer, CardWriter, FiguresWriter, PageConsumer],
)
def test_our_consumers_set_attributes_of_the_contract_alone(consumer: type[Consumer]) -> None:
    """One with another name would have no effect: a queue of its default size, say."""
    own = {name for name, value in vars(consumer).items() if name[0] != "_" and not callable(value)}
    assert {name for name in own if not isinstance(vars(consumer)[name], property)} <= set(dir(Consumer))


def test_the_results_may_wait_for_a_slow_disk() -> None:
    assert ResultsConsumer.policy is Policy.WAIT
    assert ResultsConsumer.queue_size >= 64
