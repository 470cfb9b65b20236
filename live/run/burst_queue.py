"""References and bursts in order from the grab thread to the measuring thread; skipped ones are counted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from acquire.burst import PictureMemory, SummedBurst
from acquire.frame import Burst
from live.pipeline.measure import NewReference
from live.pipeline.reference import ReferenceBurst
from live.pipeline.run_state import FrameCounts
from live.run.grabber import Grabber

POLL_S = 0.2
TAKING = "taking the reference"


class BurstQueue:
    """What the measuring thread takes from the grabber.

    Parameters
    ----------
    grabber : Grabber
    frame_counts : FrameCounts
        Takes the frames of bursts that are not measured.
    idle : callable
        Called with a few words whenever nothing has arrived for a while, and after each burst with "".
    memory : PictureMemory, optional
        That of the bursts as they are measured (``memory_for``); by default its own.
    """

    def __init__(
        self,
        grabber: Grabber,
        frame_counts: FrameCounts,
        idle: Callable[[str], None],
        memory: PictureMemory | None = None,
    ) -> None:
        self._grabber, self._frame_counts, self._idle = grabber, frame_counts, idle
        self._memory = memory or PictureMemory()
        self._held: SummedBurst | None = None
        self._reference_end = self._lost = 0
        self.paused = False

    @property
    def fps(self) -> float:
        """Rate of the frames as they arrive, 1/s."""
        return self._grabber.fps

    def next_reference(self) -> ReferenceBurst | None:
        """Wait for a reference burst; None where the run ended before it was complete.

        A burst that came after it is held for the measurement, those before it are skipped.
        """
        while True:
            ended = not self._grabber.running
            burst = self._grabber.bursts.get(POLL_S)
            reference = None if self._grabber.references.empty() else self._grabber.references.get()
            if reference is not None:
                self._reference_end, self._lost = reference.burst.last_index, 0
            self.count_skipped()
            if burst is not None and reference and burst.first_index > reference.burst.last_index:
                self._held = burst
            elif burst is not None:
                self._skip(burst)
            if reference is not None or ended:
                return reference
            self._idle(TAKING)

    def retake_reference(self) -> ReferenceBurst | None:
        """Take a reference from the next frames, and wait for it."""
        if self._held is not None:
            self._skip(self._held)
            self._held = None
        self._grabber.take_reference()
        return self.next_reference()

    def bursts(self) -> Iterator[Burst | NewReference]:
        """Bursts in order, the newest where the reader is late; a new reference before the bursts that follow it.

        The bursts that arrived while the first reference was prepared come first, until the reader has caught up.
        """
        self._grabber.bursts.begin()
        while self._held is not None or not self._grabber.bursts.finished:
            burst, self._held = self._held or self._grabber.bursts.get(POLL_S), None
            self.count_skipped()
            if burst is None:
                self._idle("waiting for frames")
            elif self.paused or burst.first_index <= self._reference_end:
                self._skip(burst)
            elif self._grabber.references.empty():
                yield self._with_all_lost(burst)
            else:
                yield NewReference(self._reference_before(burst))
            self._idle("")
        self.count_skipped()

    def _reference_before(self, burst: SummedBurst) -> Burst:
        """The new reference; ``burst`` is held where it came after it."""
        reference = self._grabber.references.get().burst
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
        for burst in self._grabber.bursts.take_skipped():
            self._skip(burst)

    def _skip(self, burst: SummedBurst) -> None:
        self._frame_counts.add(skipped=burst.n)
        if burst.first_index > self._reference_end:
            self._lost += burst.lost

    def _with_all_lost(self, summed: SummedBurst) -> Burst:
        """The burst with all frames lost since the last measured burst, those of skipped bursts included."""
        lost, self._lost = summed.lost + self._lost, 0
        return replace(summed.burst(self._memory), lost=lost)
