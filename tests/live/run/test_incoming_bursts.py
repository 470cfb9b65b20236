"""References and bursts of a camera, in the order in which they are measured; and its source."""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import Any

from acquire.burst import SumAccumulator, SummedBurst
from acquire.frame import Burst, Frame
from live.pipeline.measure import NewReference
from live.pipeline.reference import ReferenceBurst, ReferenceTaker
from live.pipeline.run_state import FrameCounts
from live.run.incoming_bursts import TAKING, IncomingBursts
from live.run.sources import CameraSource, GrabPlan
from live.stream.stream import CameraEnded, ReferenceWanted, Stream, Waiting
from tests.live.fakes import ListCamera, frame
from tests.live.streaming import KeptState, Noted, record_of
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
    """A camera that gives these, one after the other as they are asked for, and has then ended."""

    def __init__(self, *items: SummedBurst | ReferenceBurst) -> None:
        self._items = list(items)
        self._references: list[ReferenceBurst] = []
        self._skipped: list[SummedBurst] = []

    @property
    def finished(self) -> bool:
        return not self._items

    def begin(self) -> None: ...

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


def incoming_of(stream: Stream, counts: FrameCounts, *, live: bool = False) -> IncomingBursts:
    """The incoming bursts of two frames of a camera."""
    return IncomingBursts(stream, counts, ListCamera([], live=live).info, GrabPlan(2, 4))


class Incoming:
    """What comes of these."""

    def __init__(self, *items: SummedBurst | ReferenceBurst) -> None:
        self.counts, self.stream = FrameCounts(), Stream()
        self.waiting, self.wanted = Noted(self.stream, Waiting), Noted(self.stream, ReferenceWanted)
        self.queue = incoming_of(self.stream, self.counts)
        grabbed: Any = Grabbed(*items)
        self.queue._bursts = self.queue._references = grabbed

    @property
    def words(self) -> list[str]:
        return [one.words for one in self.waiting.bodies()]

    def taken(self) -> list[tuple[str, int, int]]:
        """Kind, first frame and lost frames of what is to be measured."""
        found = []
        for item in self.queue.bursts():
            burst = item.burst if isinstance(item, NewReference) else item
            found.append((type(item).__name__, burst.first_index, burst.lost))
        return found


def test_bursts_before_a_reference_are_skipped_and_the_one_after_it_is_held() -> None:
    bench = Incoming(summed(0), summed(2, lost=5), summed(8, lost=3), with_burst(reference(4)), summed(10))
    found = bench.queue.next_reference()
    assert found is not None and found.burst.first_index == 4
    assert bench.counts.skipped == 4 and bench.words == [TAKING] * 2
    assert bench.taken() == [("Burst", 8, 3), ("Burst", 10, 0)], (
        "what was lost before the reference is no matter"
    )


def test_a_run_that_ends_without_a_reference_skips_what_came() -> None:
    bench = Incoming(summed(0), summed(2))
    assert bench.queue.next_reference() is None and bench.counts.skipped == 4


def test_a_reference_taken_again_skips_the_burst_that_was_held() -> None:
    bench = Incoming(summed(4), with_burst(reference(0)), summed(6), with_burst(reference(8)), summed(12))
    assert bench.queue.next_reference() is not None
    found = bench.queue.retake_reference()
    assert found is not None and found.burst.first_index == 8 and len(bench.wanted.records) == 1
    assert bench.counts.skipped == 4
    assert bench.taken() == [("Burst", 12, 0)]


def test_a_new_reference_comes_before_the_burst_that_follows_it() -> None:
    bench = Incoming(summed(2), summed(8, lost=1), with_burst(reference(4, lost=2)), summed(10))
    assert bench.taken() == [("Burst", 2, 0), ("NewReference", 4, 2), ("Burst", 8, 3), ("Burst", 10, 0)]
    assert bench.counts.skipped == 0


def test_a_burst_older_than_a_new_reference_is_skipped() -> None:
    bench = Incoming(summed(2, lost=1), with_burst(reference(4, lost=2)), summed(8, lost=4))
    assert bench.taken() == [("NewReference", 4, 2), ("Burst", 8, 7)]
    assert bench.counts.skipped == 2


def test_bursts_while_paused_are_skipped_and_what_was_lost_is_counted_with_the_next() -> None:
    bench = Incoming(summed(2), summed(4, lost=3), summed(6, lost=1))
    taken = bench.queue.bursts()
    assert next(taken).first_index == 2  # type: ignore[union-attr]
    bench.queue.paused = True

    def go_on(record: object) -> None:
        bench.queue.paused = not bench.counts.skipped

    Noted(bench.stream, Waiting, each=go_on)
    (last,) = taken
    assert isinstance(last, Burst) and (last.first_index, last.lost) == (6, 4)
    assert bench.counts.skipped == 2


def test_the_rest_of_a_run_may_be_skipped() -> None:
    bench = Incoming(summed(0), summed(2), summed(4))
    bench.queue.skip_rest()
    assert bench.counts.skipped == 6 and bench.queue.paused


def test_a_defect_of_the_grab_thread_is_told_as_one() -> None:
    kept = KeptState()
    state, ended = kept.state, Noted(kept.stream, CameraEnded)
    source = CameraSource(
        ListCamera([frame(0)], error=ValueError("oh")),  # type: ignore[arg-type]
        GrabPlan(1, 1), state, kept.stream,
    )  # fmt: skip
    source.start()
    source.join()
    (event,) = state.event_log.events("error")
    assert event.text == "a defect in the grab thread: ValueError('oh')" and event.source == "list:"
    assert state.health.camera_failed and isinstance(source.error, ValueError)
    assert len(ended.records) == 1 and state.frame_counts.adds_up


def test_frames_after_a_retake_are_a_reference_and_the_begun_burst_is_left_out() -> None:
    kept = KeptState()
    frames, references = Noted(kept.stream, Frame), Noted(kept.stream, ReferenceBurst)
    source = CameraSource(ListCamera([]), GrabPlan(2, 2), kept.state, kept.stream)
    for k in range(5):
        source._take(frame(k))
    kept.stream.publish(ReferenceWanted())
    for k in range(5, 8):
        source._take(frame(k))
    found = [(record.body.index, record.role) for record in frames.records]  # type: ignore[union-attr]
    assert found == [(k, "reference" if k in (0, 1, 5, 6) else "plain") for k in range(8)]
    assert [one.burst.first_index for one in references.bodies()] == [0, 5]
    counts = kept.state.frame_counts
    assert (counts.grabbed, counts.reference, counts.left_out) == (8, 4, 1), "the fifth frame is of no burst"


def test_a_mean_is_made_of_each_burst_where_someone_takes_means() -> None:
    kept = KeptState()
    source = CameraSource(ListCamera([]), GrabPlan(2, 3), kept.state, kept.stream)
    assert not kept.stream.wants(Burst)
    made = Noted(kept.stream, Burst)
    for k in range(8):
        source._take(frame(k))
    found = [(one.body.first_index, one.body.n, one.role) for one in made.records]  # type: ignore[union-attr]
    assert found == [(0, 3, "reference"), (3, 2, "plain"), (5, 2, "plain")]


def test_a_source_that_waits_for_its_reader_waits_for_the_measurement() -> None:
    stream, counts = Stream(), FrameCounts()
    incoming = incoming_of(stream, counts)
    stream.publish(summed(2))
    waiting = threading.Thread(target=stream.publish, args=(summed(4),), daemon=True)
    waiting.start()
    bursts = incoming.bursts()
    assert [next(bursts).first_index for _ in range(2)] == [2, 4]  # type: ignore[union-attr]
    waiting.join(LONG_S)
    incoming.count_skipped()
    assert counts.skipped == 0


def test_a_live_camera_is_never_waited_for() -> None:
    """Nobody takes the bursts: all but the newest are skipped, and counted."""
    stream, counts = Stream(), FrameCounts()
    incoming = incoming_of(stream, counts, live=True)
    for k in range(10):
        incoming.take(record_of(summed(2 * k)))
    assert sum(burst.nbytes for burst in incoming._bursts._skipped) == 0, (
        "many, while a reference is prepared"
    )
    incoming.count_skipped()
    assert counts.skipped == 18
    stream.publish(CameraEnded())
    (last,) = incoming.bursts()
    assert isinstance(last, Burst) and last.last_index == 19


def test_frames_lost_before_skipped_bursts_are_lost_before_the_one_that_is_measured() -> None:
    stream, counts = Stream(), FrameCounts()
    incoming = incoming_of(stream, counts, live=True)
    for k, lost in enumerate((2, 0, 3, 1)):
        stream.publish(summed(10 + 2 * k, lost=lost))
    stream.publish(CameraEnded())
    taken = list(incoming.bursts())
    assert [(burst.first_index, burst.lost) for burst in taken if isinstance(burst, Burst)] == [(16, 6)]
    assert counts.skipped == 6
