"""The order of references and bursts, defects of threads, keys of a terminal, alarms of a measurement, both sides."""

from __future__ import annotations

import io
import math
import threading
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.burst import SumAccumulator, SummedBurst
from acquire.clock import ClockPair
from acquire.events import Event, EventKind
from acquire.frame import Burst
from live.config.sections import AlarmConfig
from live.pipeline.event_log import EventLog
from live.pipeline.measure import NewReference
from live.pipeline.queues import LatestQueue
from live.pipeline.reference import ReferenceBurst, ReferenceTaker
from live.pipeline.run_state import ActiveAlarms, FrameCounts, RunState
from live.run import measuring, prepared_run
from live.run.alarms import Alarm, AlarmWatch, in_words
from live.run.burst_queue import TAKING, BurstQueue
from live.run.control import ENDED
from live.run.grabber import Grabber, GrabPlan
from live.run.keyboard import HELP, LINES_HELP, Keyboard
from live.run.measuring import MeasureThread
from live.run.prepared_run import PreparedRun, _time_zero
from live.run.tcp_lines import LineServer
from tests.live.fakes import ListCamera, frame
from tests.live.made_up import START, make_measurement
from tests.live.run.test_both_runs import OneRun, both
from tests.live.run.test_control import FakeLive
from tests.live.ui.waiting import LONG_S


def summed(first: int, *, lost: int = 0) -> SummedBurst:
    """A burst of two frames."""
    taker = SumAccumulator(2)
    taker.add(frame(first, lost=lost))
    found = taker.add(frame(first + 1))
    assert found is not None
    return found


def reference(first: int, *, lost: int = 0) -> ReferenceBurst:
    """One of four frames."""
    taker = ReferenceTaker(4)
    found = [taker.add(frame(first + k, lost=lost if k == 0 else 0)) for k in range(4)][-1]
    assert found is not None
    return found


class Grabbed:
    """A grabber that has taken these, one after the other as they are asked for, and has then ended."""

    def __init__(self, *items: SummedBurst | ReferenceBurst) -> None:
        self._items, self.fps, self.retaken = list(items), 10.0, 0
        self.bursts: Any = self
        self.references: Any = self
        self._references: list[ReferenceBurst] = []
        self._skipped: list[SummedBurst] = []

    @property
    def running(self) -> bool:
        return bool(self._items)

    @property
    def finished(self) -> bool:
        return not self._items

    def begin(self) -> None: ...

    def take_reference(self) -> None:
        self.retaken += 1

    def get(self, timeout_s: float | None = None) -> Any:
        if timeout_s is None:
            return self._references.pop(0)
        item = self._items.pop(0) if self._items else None
        if isinstance(item, ReferenceBurst):
            self._references.append(item)
            return None
        # A reference that has come with a burst is there when the burst is taken.
        while self._items and isinstance(self._items[0], ReferenceBurst) and self._items[0].halves is None:
            self._references.append(self._items.pop(0))
        return item

    def empty(self) -> bool:
        return not self._references

    def take_skipped(self) -> list[SummedBurst]:
        skipped, self._skipped = self._skipped, []
        return skipped


def with_burst(one: ReferenceBurst) -> ReferenceBurst:
    """A reference that is there as soon as the burst before it in the list is taken."""
    return replace(one, halves=None)


class Queue:
    """A burst queue on what was grabbed."""

    def __init__(self, *items: SummedBurst | ReferenceBurst) -> None:
        self.grabbed, self.counts, self.words = Grabbed(*items), FrameCounts(), list[str]()
        self.queue = BurstQueue(self.grabbed, self.counts, self.words.append)  # type: ignore[arg-type]

    def taken(self) -> list[tuple[str, int, int]]:
        """Kind, first frame and lost frames of what is to be measured."""
        found = []
        for item in self.queue.bursts():
            burst = item.burst if isinstance(item, NewReference) else item
            found.append((type(item).__name__, burst.first_index, burst.lost))
        return found


def test_bursts_before_a_reference_are_skipped_and_the_one_after_it_is_held() -> None:
    bench = Queue(summed(0), summed(2, lost=5), summed(8, lost=3), with_burst(reference(4)), summed(10))
    found = bench.queue.next_reference()
    assert found is not None and found.burst.first_index == 4
    assert bench.counts.skipped == 4 and bench.words == [TAKING] * 2
    assert bench.taken() == [("Burst", 8, 3), ("Burst", 10, 0)], (
        "what was lost before the reference is no matter"
    )


def test_a_run_that_ends_without_a_reference_skips_what_came() -> None:
    bench = Queue(summed(0), summed(2))
    assert bench.queue.next_reference() is None and bench.counts.skipped == 4


def test_a_reference_taken_again_skips_the_burst_that_was_held() -> None:
    bench = Queue(summed(4), with_burst(reference(0)), summed(6), with_burst(reference(8)), summed(12))
    assert bench.queue.next_reference() is not None
    found = bench.queue.retake_reference()
    assert found is not None and found.burst.first_index == 8 and bench.grabbed.retaken == 1
    assert bench.counts.skipped == 4
    assert bench.taken() == [("Burst", 12, 0)]


def test_a_new_reference_comes_before_the_burst_that_follows_it() -> None:
    bench = Queue(summed(2), summed(8, lost=1), with_burst(reference(4, lost=2)), summed(10))
    assert bench.taken() == [("Burst", 2, 0), ("NewReference", 4, 2), ("Burst", 8, 3), ("Burst", 10, 0)]
    assert bench.counts.skipped == 0


def test_a_burst_older_than_a_new_reference_is_skipped() -> None:
    bench = Queue(summed(2, lost=1), with_burst(reference(4, lost=2)), summed(8, lost=4))
    assert bench.taken() == [("NewReference", 4, 2), ("Burst", 8, 7)]
    assert bench.counts.skipped == 2


def test_bursts_while_paused_are_skipped_and_what_was_lost_is_counted_with_the_next() -> None:
    bench = Queue(summed(2), summed(4, lost=3), summed(6, lost=1))
    taken = bench.queue.bursts()
    assert next(taken).first_index == 2  # type: ignore[union-attr]
    bench.queue.paused = True

    def go_on(words: str) -> None:
        bench.queue.paused = not bench.counts.skipped

    bench.queue._idle = go_on
    (last,) = taken
    assert isinstance(last, Burst) and (last.first_index, last.lost) == (6, 4)
    assert bench.counts.skipped == 2


def test_the_rest_of_a_run_may_be_skipped() -> None:
    bench = Queue(summed(0), summed(2), summed(4))
    bench.queue.skip_rest()
    assert bench.counts.skipped == 6 and bench.queue.paused and bench.queue.fps == 10.0


def test_a_defect_of_the_grab_thread_is_told_as_one() -> None:
    state = RunState.new(0.5)
    grabber = Grabber(ListCamera([frame(0)], error=ValueError("oh")), GrabPlan(1, 1), state)  # type: ignore[arg-type]
    grabber.start()
    grabber.join()
    (event,) = state.event_log.events("error")
    assert event.text == "a defect in the grab thread: ValueError('oh')" and event.source == "list:"
    assert state.health.camera_failed and isinstance(grabber.error, ValueError)
    assert grabber.bursts.finished and state.frame_counts.adds_up


def test_frames_after_a_retake_are_a_reference_and_the_begun_burst_is_left_out() -> None:
    state = RunState.new(0.5)
    grabber = Grabber(ListCamera([]), GrabPlan(2, 2), state)
    for k in range(5):
        grabber._take(frame(k))
    assert (state.frame_counts.reference, grabber.taking_reference) == (2, False)
    grabber.take_reference()
    assert grabber.taking_reference
    grabber._take(frame(5))
    assert grabber.taking_reference
    grabber._take(frame(6))
    assert not grabber.taking_reference
    assert [grabber.references.get().burst.first_index for _ in range(2)] == [0, 5]
    counts = state.frame_counts
    assert (counts.grabbed, counts.reference, counts.left_out) == (7, 4, 1), "the fifth frame is of no burst"


def test_a_mean_is_made_of_each_burst_where_bursts_are_recorded() -> None:
    made: list[tuple[int, int]] = []
    grabber = Grabber(
        ListCamera([]), GrabPlan(2, 3), RunState.new(0.5),
        on_burst=lambda burst: made.append((burst.first_index, burst.n)),
    )  # fmt: skip
    for k in range(8):
        grabber.bursts.get(0)
        grabber._take(frame(k))
    assert made == [(0, 3), (3, 2), (5, 2)]


class MeasureSetup:
    """A measuring thread whose reference selector raises, or gives nothing."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, take: Any) -> None:
        self.state, self.skipped = RunState.new(0.5), 0
        monkeypatch.setattr(measuring, "lower_priority", lambda nice: None)
        monkeypatch.setattr(measuring, "ReferenceSelector", lambda *given: SimpleNamespace(take=take))
        queue: Any = SimpleNamespace(skip_rest=self._skip)
        nothing: Any = None
        self.thread = MeasureThread(nothing, self.state, nothing, queue, nothing, lambda: None)
        self.thread._work()

    def _skip(self) -> None:
        self.skipped += 1


def test_a_defect_ends_the_measurement_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = MeasureSetup(monkeypatch, lambda: 1 / 0)
    assert (bench.thread.failure, bench.skipped) == (1, 1)
    (event,) = bench.state.event_log.events("error")
    assert event.text.startswith("measuring has stopped by a defect, recording goes on: ZeroDivisionError(")


def test_without_a_reference_the_rest_is_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = MeasureSetup(monkeypatch, lambda: None)
    assert (bench.thread.failure, bench.skipped, bench.state.event_log.events()) == (0, 1, [])


class FakeTerminal:
    """Gives these texts; for None another program has the terminal, or nothing is typed."""

    def __init__(self, *texts: bytes | None) -> None:
        self.texts, self.restored = list(texts), 0

    def set_single_keys(self) -> bool:
        return bool(self.texts) and (self.texts[0] is not None or bool(self.texts.pop(0)))

    def read(self, seconds: float) -> bytes | None:
        assert seconds == 0.5
        return self.texts.pop(0)

    def restore(self) -> None:
        self.restored += 1


def keyboard(monkeypatch: pytest.MonkeyPatch, terminal: FakeTerminal | None, lines: str = "") -> Any:
    monkeypatch.setattr("live.run.keyboard.terminal_of", lambda stream: terminal)
    live, printed = FakeLive(), list[str]()
    screen: Any = SimpleNamespace(print=printed.append, prompt=lambda text: None)
    return SimpleNamespace(board=Keyboard(live, io.StringIO(lines), screen), live=live, printed=printed)


def test_keys_are_decoded_across_readings_until_the_terminal_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = FakeTerminal(b"r", b"n\xc3", b"\xa9\r", b"")
    bench = keyboard(monkeypatch, terminal)
    bench.board.start()
    bench.board.join(LONG_S)
    assert bench.live.calls == [(EventKind.NEW_REFERENCE, ""), (EventKind.NOTE, "é")]
    assert bench.printed == [HELP]
    bench.board.close()
    assert terminal.restored == 1


def test_a_keyboard_that_is_closed_takes_no_key(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = keyboard(monkeypatch, FakeTerminal(b"r"))
    bench.board._closed.set()
    bench.board._work()
    assert bench.live.calls == []


def test_without_single_keys_lines_are_taken_and_answers_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = keyboard(monkeypatch, None, "\n r \nhello\nq\n")
    bench.board.start()
    bench.board.join(LONG_S)
    assert bench.live.calls == [(EventKind.NEW_REFERENCE, ""), ("stop", ENDED)]
    assert bench.printed[0] == LINES_HELP and len(bench.printed) == 2
    assert bench.printed[1].startswith("no: 'hello' is no command")
    bench.board.close()


@pytest.mark.parametrize(("clock", "after_s"), [("device", 0.465), ("host", 0.465), ("nominal", None)])
def test_an_alarm_says_how_long_after_the_last_frame_it_came(clock: Any, after_s: float | None) -> None:
    events: list[Event] = []
    values: Any = SimpleNamespace(read=lambda measurement: {"axial": 2e-3})
    alarm = Alarm(AlarmConfig(channel="axial", above=1e-3))
    watch = AlarmWatch([alarm], values, lambda now: {}, ActiveAlarms(), events.append, lambda: START + 0.5)
    m = make_measurement(0)
    watch.measurement(replace(m, burst=replace(m.burst, clock=clock)))
    assert events[0].t == START + 0.5
    assert events[0].data.get("after_s") == (None if after_s is None else pytest.approx(after_s))
    assert watch.end() == "1 came"


@pytest.mark.parametrize(("channel", "idle_s"), [("silent_s", 0.2), ("mean_axial", 0.2), ("axial", math.inf)])
def test_what_changes_by_itself_is_looked_at_five_times_a_second(channel: str, idle_s: float) -> None:
    nothing: Any = None
    alarm = Alarm(AlarmConfig(channel=channel, above=1.0))
    watch = AlarmWatch([alarm], nothing, lambda now: {}, ActiveAlarms(), [].append, lambda: 0.0)
    assert watch.idle() == idle_s and watch.end() == "none came"


@pytest.mark.parametrize(
    ("channel", "value", "words"),
    [
        ("sigma_axial", 5e-6, "sigma axial 5 µm/m, limit 1000"),
        ("sigma_mean_axial", 5e-6, "sigma mean axial 5 µm/m, limit 1000"),
        ("bending_gauge_left", -5e-6, "bending gauge left -5 µm/m, limit 1000"),
        ("stress_MPa", 12.5, "stress 12.5 MPa, limit 0.001"),
        ("latency_s", 0.25, "latency 0.25 s, limit 0.001"),
        ("noise_GL", 2.5, "noise 2.5 GL, limit 0.001"),
        ("strain_rate", 0.25, "strain rate 0.25, limit 0.001"),
        ("load_silent_s", 2.0, "no force for 2 s, limit 0.001"),
        ("largest", 0.25, "largest 250000 µm/m, limit 1000"),
    ],
)
def test_a_channel_is_named_with_its_unit(channel: str, value: float, words: str) -> None:
    assert in_words(channel, value, 1e-3) == words


def test_both_sides_are_paused_and_stopped_as_one() -> None:
    front, back = OneRun(), OneRun()
    control = both(front, back)
    back.paused, back.live = True, False
    assert (control.paused, control.live) == (False, True)
    front.grabber.running = False
    assert (control.paused, control.live) == (True, False)
    control.stop("enough")
    assert control._stop.reason == "enough"


def test_time_zero_is_that_of_the_clock_or_of_the_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    now = ClockPair.now()
    monkeypatch.setattr(
        prepared_run, "ClockPair", type("Clock", (ClockPair,), {"now": staticmethod(lambda: now)})
    )

    def zero(clock: str) -> tuple[float, float]:
        log = EventLog()
        rig: Any = SimpleNamespace(camera=SimpleNamespace(info=SimpleNamespace(clock=clock)))
        found = _time_zero(rig, log)
        assert found.utc == now.utc
        return found.monotonic, log.origin

    assert zero("device") == zero("host") == (now.monotonic, 0.0)
    assert zero("nominal") == (0.0, now.monotonic)


def test_devices_are_announced_with_their_warnings() -> None:
    camera = replace(ListCamera([frame(0)]).info, fps=12.5, warnings=("its gain is automatic",))
    cell = SimpleNamespace(name="a cell", warnings=("old",))
    rig: Any = SimpleNamespace(camera=SimpleNamespace(info=camera), load=SimpleNamespace(info=cell))
    prepared = PreparedRun(rig, None, (4, 2), "run", None)  # type: ignore[arg-type]
    assert list(prepared.announcement()) == [
        "camera: a list of frames, 6 x 4 px, 8 bits, 12.5 fps", "load cell: a cell",
        "warning: its gain is automatic", "warning: old", "files: run",
    ]  # fmt: skip


def test_lines_of_clients_are_ignored_where_nobody_answers() -> None:
    client: Any = SimpleNamespace(authorized=True)
    server = object.__new__(LineServer)
    server._answer = None
    assert server._handle(client, "hello") and not server._handle(client, "GET / HTTP/1.1")


def test_a_queue_of_bursts_that_waits_for_its_reader_is_that_of_files() -> None:
    grabber = Grabber(ListCamera([], live=False), GrabPlan(1, 1), RunState.new(0.5))
    assert isinstance(grabber.bursts, LatestQueue)
    grabber.bursts.put(summed(0))
    waiting = threading.Thread(target=grabber.bursts.put, args=(summed(2),), daemon=True)
    waiting.start()
    assert grabber.bursts.get(LONG_S) is not None and grabber.bursts.get(LONG_S) is not None
    waiting.join(LONG_S)
    assert grabber.bursts.take_skipped() == []
