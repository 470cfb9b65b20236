"""The bursts of a camera on their way to its measurement: in order, the newest where it is late, all counted."""

from __future__ import annotations

import queue
from collections.abc import Iterator
from dataclasses import replace

from acquire.burst import SummedBurst
from acquire.frame import Burst, CameraInfo
from acquire.text import Message
from live.pipeline.measure import NewReference
from live.pipeline.queues import LatestQueue
from live.pipeline.reference import ReferenceBurst
from live.pipeline.run_state import FrameCounts
from live.run.sources import LATE_S, GrabPlan, held_at_first, held_bursts, memory_of_measured
from live.stream.stream import CameraEnded, Record, ReferenceWanted, Stream, Subscriber, Waiting

POLL_S = 0.2
TAKING = Message("taking the reference")


class IncomingBursts(Subscriber):
    """Takes bursts and references from the stream, and hands them to the measuring thread.

    Parameters
    ----------
    stream : Stream
        Takes ``Waiting`` whenever nothing has arrived for a while, and after each burst.
    frame_counts : FrameCounts
        Takes the frames of bursts that are not measured.
    camera : CameraInfo
        With a source that waits for its reader, nothing is skipped.
    plan : GrabPlan
    name : str
        Of the camera in the stream.

    Attributes
    ----------
    paused : bool
        What comes is skipped.
    """

    takes = (SummedBurst, ReferenceBurst, CameraEnded)

    def __init__(
        self, stream: Stream, frame_counts: FrameCounts, camera: CameraInfo, plan: GrabPlan, name: str = ""
    ) -> None:
        self._stream, self._frame_counts, self._name = stream, frame_counts, name
        self._references: queue.SimpleQueue[ReferenceBurst] = queue.SimpleQueue()
        self._bursts: LatestQueue[SummedBurst] = LatestQueue(
            waits=not camera.live,
            at_first=held_at_first(camera, plan),
            keeps=held_bursts(camera, plan, LATE_S),
            brief=SummedBurst.without_pictures,
        )
        self._memory = memory_of_measured(camera, plan)
        self._held: SummedBurst | None = None
        self._reference_end = self._lost = 0
        self.paused = False
        stream.add(self, name)

    def take(self, record: Record) -> None:
        """Queue a burst or a reference; nothing more comes once the camera has ended."""
        body = record.body
        if isinstance(body, SummedBurst):
            self._bursts.put(body)
        elif isinstance(body, ReferenceBurst):
            self._references.put(body)
            self._bursts.wake()  # it is prepared while the next burst is taken
        else:
            self.close()

    @property
    def newest_only(self) -> bool:
        """Whether measuring is slower than the camera, so that it gets the newest burst each time."""
        return self._bursts.newest_only

    def close(self) -> None:
        """What comes from now on is skipped."""
        self._bursts.close()

    def next_reference(self) -> ReferenceBurst | None:
        """Wait for a reference burst; None where the run ended before it was complete.

        A burst that came after it is held for the measurement, those before it are skipped.
        """
        while True:
            ended = self._bursts.finished
            burst = self._bursts.get(POLL_S)
            reference = None if self._references.empty() else self._references.get()
            if reference is not None:
                self._reference_end, self._lost = reference.burst.last_index, 0
            self.count_skipped()
            if burst is not None and reference and burst.first_index > reference.burst.last_index:
                self._held = burst
            elif burst is not None:
                self._skip(burst)
            if reference is not None or ended:
                return reference
            self._wait_for(TAKING)

    def retake_reference(self) -> ReferenceBurst | None:
        """Take a reference from the next frames, and wait for it."""
        if self._held is not None:
            self._skip(self._held)
            self._held = None
        self._stream.publish(ReferenceWanted(), self._name)
        return self.next_reference()

    def bursts(self) -> Iterator[Burst | NewReference]:
        """Bursts in order, the newest where the reader is late; a new reference before the bursts that follow it.

        The bursts that arrived while the first reference was prepared come first, until the reader has caught up.
        """
        self._bursts.begin()
        while self._held is not None or not self._bursts.finished:
            burst, self._held = self._held or self._bursts.get(POLL_S), None
            self.count_skipped()
            if burst is None:
                self._wait_for(Message("waiting for frames"))
            elif self.paused or burst.first_index <= self._reference_end:
                self._skip(burst)
            elif self._references.empty():
                # With all frames lost since the last measured burst, those of skipped bursts included.
                lost, self._lost = burst.lost + self._lost, 0
                yield replace(burst.burst(self._memory), lost=lost)
            else:
                yield NewReference(self._reference_before(burst))
            self._wait_for("")
        self.count_skipped()

    def _wait_for(self, words: str) -> None:
        self._stream.publish(Waiting(words), self._name)

    def _reference_before(self, burst: SummedBurst) -> Burst:
        """The new reference; ``burst`` is held where it came after it."""
        reference = self._references.get().burst
        if burst.first_index > reference.last_index:
            self._held = burst
        else:
            self._skip(burst)
        self._lost += reference.lost
        return reference

    def skip_rest(self) -> None:
        """Take all that still comes and count it as skipped."""
        self.paused = True
        for _ in self.bursts():
            pass

    def count_skipped(self) -> None:
        """Account for bursts that newer ones replaced."""
        for burst in self._bursts.take_skipped():
            self._skip(burst)

    def _skip(self, burst: SummedBurst) -> None:
        self._frame_counts.add(skipped=burst.n)
        if burst.first_index > self._reference_end:
            self._lost += burst.lost
