"""The measuring thread without a thread: its reference, its words, its period."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.errors import DataError, TooLittleMemory
from acquire.events import Event, EventKind
from acquire.load_sample import LoadSample
from live.pipeline import latency
from live.pipeline.latency import LatencyMonitor, LatencySample, ProcessorUse
from live.pipeline.measurement import Measurement
from live.pipeline.reference import ReferenceMotion
from live.pipeline.run_state import RunState
from live.run import measurer
from live.run.measurer import Measurer, ReferenceSelector, SmearWatch, _measured
from live.run.outcome import StopSignal
from live.stream.stream import Stream
from tests.live.made_up import START, make_measurement
from tests.live.streaming import Noted

N = 8  # frames of a reference
BLANK = 3  # for a motion: the picture of a reference that is blank


def as_motion(motion: float | ReferenceMotion) -> ReferenceMotion:
    return motion if isinstance(motion, ReferenceMotion) else ReferenceMotion(motion)


class References:
    """A queue that gives one reference after the other, each with a motion of its halves, px."""

    def __init__(self, *motions: float | ReferenceMotion, n: int = N) -> None:
        self.state = RunState.new(0.5)
        for k in range(101):
            self.state.loads.append(LoadSample(START - 0.5 + k / 100, float(k)))
        self._taken, self._motions, self._n = 0, motions, n
        plan = SimpleNamespace(
            on=lambda burst, what: SimpleNamespace(burst=burst, what=what, plan=None),
            width=64,
            height=48,
            kernel_grid=SimpleNamespace(n_active=1),
        )
        config = SimpleNamespace(
            measure=SimpleNamespace(reference_shift_px=0.05), camera=SimpleNamespace(address="sim:")
        )
        self.prepared: Any = SimpleNamespace(plan=plan, config=config)

    def next_reference(self) -> Any:
        if self._taken == len(self._motions):
            return None
        motion = self._motions[self._taken]
        blank = BLANK * (motion is BLANK)
        burst = replace(make_measurement(self._taken).burst, n=self._n, blank=blank)
        self._taken += 1
        self.state.frame_counts.add(grabbed=burst.n, reference=burst.n)
        return SimpleNamespace(burst=burst, halves=None if burst.n < 4 else motion)

    retake_reference = next_reference

    def taken(self, monkeypatch: pytest.MonkeyPatch) -> Any:
        monkeypatch.setattr(
            measurer,
            "_motion",
            lambda ready, reference: as_motion(0.0 if reference.halves is None else reference.halves),
        )
        queue: Any = self
        return ReferenceSelector(self.prepared, self.state, queue).take()

    def told(self) -> list[tuple[str, str]]:
        return [(event.level, event.text) for event in self.state.event_log.events("warning", "error")]


MOVED = "the specimen moved by {:.3f} px while the reference was taken: keep it still for these frames"
AGAIN = "the picture moved by {:.3f} px during the reference burst; taking another"
IS_BLANK = (
    "the reference burst cannot be measured (picture 3 of 8 is blank or has less than half the contrast of another; "
    "look at light and cable)"
)
UNSEEN = "the reference burst cannot be measured (fast motion, glare, no focus?)"


@pytest.mark.parametrize(
    ("motions", "used", "told"),
    [
        ((0.05,), 0, []),
        ((0.051, 0.01), 1, [("warning", AGAIN.format(0.051))]),
        ((0.3, 0.2, 0.1, 0.0), 2,
         [("warning", AGAIN.format(0.3)), ("warning", AGAIN.format(0.2)), ("warning", MOVED.format(0.1))]),
        ((ReferenceMotion(0.01, 7e-5, 1e-6), 0.01), 0,
         [("warning", MOVED.replace("{:.3f}", "70 µm/m, 0.010"))]),
        ((ReferenceMotion(0.06, -7e-5, 1e-6), 0.01), 1,
         [("warning", AGAIN.replace("{:.3f}", "−70 µm/m, 0.060"))]),
        ((0.3,), 0, [("warning", AGAIN.format(0.3)), ("warning", MOVED.format(0.3))]),
        ((math.nan, math.nan, math.nan, math.nan, 0.01), 4,
         [("warning", f"{UNSEEN}; taking another")] * 2
         + [("error", f"{UNSEEN}; tried again until the picture is still")]),
        ((BLANK, BLANK, 0.01), 2, [("warning", f"{IS_BLANK}; taking another")] * 2),
        ((math.nan, math.nan, math.nan, math.nan, 0.2), 4,
         [("warning", f"{UNSEEN}; taking another")] * 2
         + [("error", f"{UNSEEN}; tried again until the picture is still"), ("warning", MOVED.format(0.2))]),
    ],
)  # fmt: skip
def test_a_reference_that_moves_is_taken_again_twice_and_one_that_is_not_seen_until_it_is(
    monkeypatch: pytest.MonkeyPatch,
    motions: tuple[float | ReferenceMotion, ...],
    used: int,
    told: list[tuple[str, str]],
) -> None:
    bench = References(*motions)
    ready = bench.taken(monkeypatch)
    assert ready.burst.first_index == 8 * used and bench.told() == told
    assert ready.what == "the reference from sim:"
    counts = bench.state.frame_counts
    assert (counts.reference, counts.left_out) == (N, used * N) and counts.adds_up


@pytest.mark.parametrize("motion", [math.nan, BLANK])
def test_a_run_that_ends_before_a_reference_can_be_measured_has_none(
    monkeypatch: pytest.MonkeyPatch, motion: float
) -> None:
    bench = References(motion)
    assert bench.taken(monkeypatch) is None
    assert bench.told()[-1][1].startswith("no reference could be measured")
    empty = References()
    empty.state.frame_counts.add(grabbed=3)
    assert empty.taken(monkeypatch) is None
    assert empty.told() == [("error", "the camera ended before the reference was complete (3 frames)")]


def reference_event(bench: References) -> Event:
    return next(event for event in bench.state.event_log.events() if event.kind is EventKind.REFERENCE)


def test_the_reference_is_told_with_its_frames_noise_motion_and_mean_force(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """50 N at its middle, and from 3.5 N less to 3.5 N more over its 0.07 s."""
    bench = References(0.0123)
    bench.taken(monkeypatch)
    event = reference_event(bench)
    assert event.t == START
    assert event.data == {
        "first": 0, "last": 7, "n": 8, "noise_GL": 2.5, "force_N": pytest.approx(50.0), "shift_px": 0.0123,
    }  # fmt: skip
    assert event.text == "reference: 8 frames, noise of one 2.50 GL, motion 0.0123 px, force 50.00 N"


def test_one_frame_has_neither_noise_nor_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = References(0.0, n=1)
    bench.state = RunState.new(0.5)
    bench.taken(monkeypatch)
    event = reference_event(bench)
    assert event.text == "reference: 1 frames" and event.data["force_N"] is None


def test_a_measured_burst_is_told_with_its_frames() -> None:
    event = _measured(make_measurement(3).burst)
    assert (event.kind, event.text) == (EventKind.MEASURED, "frames 24 to 31")
    assert event.data == {"first": 24, "last": 31, "n": 8, "lost": 1} and event.t == START + 0.3


def test_each_measurement_is_counted_told_and_published(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measurer, "time", SimpleNamespace(monotonic=lambda: START + 0.5))
    state, order, events = RunState.new(0.5), list[Any](), list[Event]()
    state.event_log.add_listener(events.append)
    made = [make_measurement(k) for k in range(2)]
    made[1] = replace(made[1], burst=replace(made[1].burst, motion_px=0.3))
    ready: Any = SimpleNamespace(measurements=lambda *given: iter(made))
    queue: Any = SimpleNamespace(bursts=lambda: None, newest_only=False)
    state.health.fps, stream = 80.0, Stream()

    def note(record: Any) -> None:
        order.append((record.body.number, round(record.body.time_step.latency_s, 6)))

    Noted(stream, Measurement, each=note)
    monitor: Any = SimpleNamespace(
        check=lambda sample, period_s, newest_only: order.append(period_s) or "", p95_s=0.2
    )
    prepared: Any = SimpleNamespace(folder=Path())
    Measurer(prepared, state, queue, monitor, stream, StopSignal())._measure(ready)
    assert order == [(0, 0.465), 0.1, (1, 0.365), 0.1]
    assert state.frame_counts.measured == 16
    assert [(event.kind, event.data.get("first")) for event in events] == [
        (EventKind.MEASURED, 0), (EventKind.MEASURED, 8), (EventKind.MEASUREMENT, None),
    ]  # fmt: skip
    assert "moves 0.30 px during a burst of 8" in events[2].text


@pytest.mark.parametrize("latency_s", [0.04, math.nan])
def test_the_latency_is_judged_by_the_period_of_the_bursts(latency_s: float) -> None:
    """8 frames at 20 a second."""
    asked: list[tuple[LatencySample, float]] = []

    def check(sample: LatencySample, period_s: float, *, newest_only: bool) -> str:
        asked.append((sample, period_s))
        return "results come late"

    state, nothing = RunState.new(0.5), SimpleNamespace(newest_only=False)
    monitor: Any = SimpleNamespace(check=check, p95_s=0.044)
    state.health.fps = 20.0
    thread = Measurer(nothing, state, nothing, monitor, nothing, nothing)  # type: ignore[arg-type]
    m = make_measurement(0)
    m = replace(m, time_step=replace(m.time_step, measure_s=0.03, latency_s=latency_s))
    thread._check_latency(m)
    if math.isnan(latency_s):
        assert not asked and not state.event_log.events()
        return
    assert asked == [(LatencySample(START, 0.04, 0.03), 0.4)]
    assert state.health.latency_p95_s == 0.044
    assert [(event.level, event.text, event.t) for event in state.event_log.events()] == [
        ("warning", "results come late", START)
    ]
    state.health.fps = 0.0
    thread._check_latency(m)
    assert asked[-1][1] == 8000.0, "before there is a rate nothing is late"


@pytest.mark.parametrize(("motion", "told"), [(0.0501, 1), (0.05, 0)])
def test_smear_begins_beyond_a_twentieth_of_a_pixel(motion: float, told: int) -> None:
    events: list[Event] = []
    SmearWatch(events.append).check(replace(make_measurement(0).burst, motion_px=motion))
    assert len(events) == told


def test_smear_ends_below_four_fifths_of_the_limit() -> None:
    events: list[Event] = []
    guard = SmearWatch(events.append, 1.0)
    for motion, told in ((math.nan, 0), (1.1, 1), (1.2, 1), (math.nan, 1), (0.8, 1), (0.79, 2), (1.1, 3)):
        guard.check(replace(make_measurement(0).burst, motion_px=motion))
        assert len(events) == told
    assert [event.level for event in events] == ["warning", "info", "warning"]
    assert events[0].data == {"motion_px": 1.1, "n": 8}


def test_the_cores_of_others_and_of_the_view_are_over_the_time_between_two_readings() -> None:
    """In 2 s: 6 s by all, 2 s by the program, 1 s by its children."""
    before, now = ProcessorUse(1.0, 10.0, 4.0, 1.0), ProcessorUse(3.0, 16.0, 6.0, 2.0)
    assert now.since(before) == (1.5, 0.5)
    assert ProcessorUse(3.0, 10.0, 6.0, 0.0).since(before) == (0.0, 0.0)


def test_the_processor_time_is_read_with_the_time_of_the_reading(monkeypatch: pytest.MonkeyPatch) -> None:
    clocks = SimpleNamespace(monotonic=lambda: 5.0, process_time=lambda: 3.0)
    monkeypatch.setattr(latency, "time", clocks)
    monkeypatch.setattr(latency, "processor_times", lambda: (100.0, 7.0))
    assert latency.processor_use() == ProcessorUse(t=5.0, all=100.0, own=3.0, children=7.0)
    monkeypatch.setattr(latency, "processor_times", lambda: None)
    assert latency.processor_use() is None


def warned(
    *,
    others: float = 0.0,
    view: float = 0.0,
    kernel_s: float = 0.0,
    backlog: float = 0.0,
    period_s: float = 0.1,
    late_s: float = 1.0,
) -> list[tuple[float, str]]:
    """Times and causes of the warnings of 10 s of results that come so late."""
    now, found = 0.0, []

    def use() -> ProcessorUse:
        return ProcessorUse(now, now * (1.0 + others + view), now, now * view)

    monitor = LatencyMonitor(lambda: backlog, use)
    for k in range(round(10 / period_s)):
        now = k * period_s
        if words := monitor.check(LatencySample(now, late_s, kernel_s), period_s):
            found.append((now, words.rpartition(": ")[2]))
    return found


@pytest.mark.parametrize(
    ("cause", "words"),
    [
        ({"backlog": 0.11, "others": 0.9}, "the disk is too slow"),
        ({"backlog": 0.1}, "the processor is short"),
        ({"others": 0.51, "kernel_s": 0.09}, "another program takes 0.5 processor cores"),
        ({"others": 0.49}, "the processor is short"),
        ({"kernel_s": 0.081, "view": 0.9}, "the kernel needs 81 ms"),
        ({"kernel_s": 0.079}, "the processor is short"),
        ({"view": 0.51}, "drawing takes 0.5 processor cores"),
        ({"view": 0.49}, "the processor is short"),
    ],
)
def test_the_first_cause_beyond_its_limit_is_named(cause: dict[str, float], words: str) -> None:
    ((_, said),) = warned(**cause)
    assert said.startswith(words)


def test_it_takes_ten_results_from_two_seconds_after_the_first_and_two_looks_a_second_apart() -> None:
    """The first is there at 1 s, results count from 3 s on: the tenth is of 4.125 s, the second look at 5.125 s."""
    ((t, _),) = warned(period_s=0.125)
    assert t == 5.125
    assert warned(period_s=0.6) == [], "in 5 s there are 9"
    assert warned(late_s=0.19) == [] and len(warned(late_s=0.21)) == 1, "from two periods on"


def test_the_latency_is_the_95th_percentile_of_five_seconds() -> None:
    monitor = LatencyMonitor(lambda: 0.0, lambda: None)
    for k in range(200):
        monitor.check(LatencySample(k / 10, 9.0 if k < 130 else (k - 130) / 100, 0.0), 100.0)
    # The last look is at 19.1 s or later; it sees what came in the five seconds before, all below 0.7 s.
    assert 0.55 < monitor.p95_s < 0.7


class MeasureSetup:
    """A measuring thread whose reference selector raises, or gives nothing."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, take: Any) -> None:
        self.state, self.skipped = RunState.new(0.5), 0
        monkeypatch.setattr(measurer, "lower_priority", lambda nice: None)
        monkeypatch.setattr(measurer, "ReferenceSelector", lambda *given: SimpleNamespace(take=take))
        queue: Any = SimpleNamespace(skip_rest=self._skip)
        nothing: Any = None
        self.stop = StopSignal()
        self.thread = Measurer(nothing, self.state, queue, nothing, nothing, self.stop)
        self.thread._work()

    def _skip(self) -> None:
        self.skipped += 1


def test_a_defect_ends_the_measurement_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = MeasureSetup(monkeypatch, lambda: 1 / 0)
    assert (bench.thread.failure, bench.skipped) == (1, 1)
    (event,) = bench.state.event_log.events("error")
    assert event.text.startswith("measuring has stopped by a defect, recording goes on: ZeroDivisionError(")


def test_without_the_memory_to_measure_recording_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused() -> None:
        raise TooLittleMemory("they take too much")

    bench = MeasureSetup(monkeypatch, refused)
    assert (bench.thread.failure, bench.skipped, bench.stop.reason) == (1, 1, "")
    (event,) = bench.state.event_log.events("error")
    assert event.text == "nothing is measured, recording goes on: they take too much"


def test_without_a_reference_the_rest_is_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = MeasureSetup(monkeypatch, lambda: None)
    assert (bench.thread.failure, bench.skipped, bench.state.event_log.events()) == (0, 1, [])


def test_a_reference_that_cannot_be_used_stops_the_whole_test(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused() -> None:
        raise DataError("no pattern")

    bench = MeasureSetup(monkeypatch, refused)
    assert bench.stop.reason == "the start failed" and bench.skipped == 0
    monkeypatch.setattr(bench.thread, "_thread", SimpleNamespace(join=lambda: None, ident=1))
    with pytest.raises(DataError, match="no pattern"):
        bench.thread.join()


@pytest.fixture
def thread(monkeypatch: pytest.MonkeyPatch) -> Measurer:
    """One that is not started; half a second has passed since START."""
    monkeypatch.setattr(measurer, "time", SimpleNamespace(monotonic=lambda: START + 0.5))
    nothing: Any = None
    return Measurer(nothing, nothing, nothing, nothing, nothing, nothing)


def test_nominal_times_have_none(thread: Measurer) -> None:
    made = make_measurement(0)
    made = replace(made, burst=replace(made.burst, clock="nominal"))
    assert math.isnan(thread._timed(made).time_step.latency_s)


@pytest.mark.skipif(sys.platform != "linux", reason="counts threads in /proc")
def test_the_linear_algebra_of_the_program_has_no_threads_of_its_own() -> None:
    code = """
import contextlib, os, live.cli
with contextlib.suppress(SystemExit):
    live.cli.main(["--version"])
import numpy as np
np.ones((500, 500)) @ np.ones((500, 500))
print(len(os.listdir("/proc/self/task")))
"""
    without = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=without, capture_output=True, text=True, check=True
    )
    assert done.stdout.split()[-1] == "1"
