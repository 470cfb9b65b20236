"""References and bursts from the grabber, in the order in which they are measured."""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import Any

from acquire.burst import SumAccumulator, SummedBurst
from acquire.frame import Burst
from live.pipeline.measure import NewReference
from live.pipeline.queues import LatestQueue
from live.pipeline.reference import ReferenceBurst, ReferenceTaker
from live.pipeline.run_state import FrameCounts, RunState
from live.run.burst_queue import TAKING, BurstQueue
from live.run.grabber import Grabber, GrabPlan
from tests.live.fakes import ListCamera, frame
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
    state, roles = RunState.new(0.5), list[tuple[int, bool]]()
    grabber = Grabber(
        ListCamera([]), GrabPlan(2, 2), state, lambda one, role: roles.append((one.index, role))
    )
    for k in range(5):
        grabber._take(frame(k))
    grabber.take_reference()
    for k in range(5, 8):
        grabber._take(frame(k))
    assert roles == [(k, k in (0, 1, 5, 6)) for k in range(8)]
    assert [grabber.references.get().burst.first_index for _ in range(2)] == [0, 5]
    counts = state.frame_counts
    assert (counts.grabbed, counts.reference, counts.left_out) == (8, 4, 1), "the fifth frame is of no burst"


def test_a_mean_is_made_of_each_burst_where_bursts_are_recorded() -> None:
    made: list[tuple[int, int, bool]] = []
    grabber = Grabber(
        ListCamera([]), GrabPlan(2, 3), RunState.new(0.5),
        on_burst=lambda burst, role: made.append((burst.first_index, burst.n, role)),
    )  # fmt: skip
    for k in range(8):
        grabber.bursts.get(0)
        grabber._take(frame(k))
    assert made == [(0, 3, True), (3, 2, False), (5, 2, False)]


def test_a_queue_of_bursts_that_waits_for_its_reader_is_that_of_files() -> None:
    grabber = Grabber(ListCamera([], live=False), GrabPlan(1, 1), RunState.new(0.5))
    assert isinstance(grabber.bursts, LatestQueue)
    grabber.bursts.put(summed(0))
    waiting = threading.Thread(target=grabber.bursts.put, args=(summed(2),), daemon=True)
    waiting.start()
    assert grabber.bursts.get(LONG_S) is not None and grabber.bursts.get(LONG_S) is not None
    waiting.join(LONG_S)
    assert grabber.bursts.take_skipped() == []
