"""What of a test is recorded: nothing before its start but the last seconds, and of a cyclic test some of its cycles.

While off, ``PreTrigger`` keeps the last seconds; switched on it records these first. Frames of references, load samples
and events are recorded also while it is off, since a replay needs them. A burst that was measured while its frames were
not recorded is not in the recorded list of bursts.

Of cycles the bursts at valley and peak are recorded. A burst is a peak when the force, or the strain where no force is
known, has fallen behind it by a tenth of its range so far; so is a valley. That of a cycle is the one before its peak.
Both wait until the cycle has its number.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from acquire.events import Event, EventKind
from acquire.frame import Burst, Frame
from acquire.load_sample import LoadSample
from acquire.record_mode import RecordMode
from acquire.text import Message
from live.pipeline.event_log import EventLog
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import FrameCounts, RunState
from live.pipeline.timed.figure import TimedFigure
from live.run.control import START, ControlRefused
from live.stream.stream import Matched, Record, Subscriber

_SMALL = 512  # bytes counted for an event

_TURN = 0.1  # of the range of the test so far
_MOST_WAITING = 8  # peaks without a cycle: at rest noise turns

Item = Frame | Burst | Event


class RecordingSink(Protocol):
    """What the buffer uses of ``Recorder``; no method blocks."""

    @property
    def failed(self) -> str | None: ...

    @property
    def backlog(self) -> float: ...

    def frame(self, frame: Frame) -> None: ...

    def burst(self, burst: Burst) -> None: ...

    def sample(self, sample: LoadSample) -> None: ...

    def event(self, event: Event) -> None: ...

    def close(self, frame_counts: dict[str, Any]) -> None: ...


@dataclass(frozen=True, slots=True)
class PreTrigger:
    """What is kept while recording is off, and what switches it on.

    Attributes
    ----------
    seconds : float, s
    max_bytes : int
    above_N : float, N
        A force of this magnitude, or one that is not known any more, switches it on, once; infinite: only a command
        does.
    bursts : bool
        Bursts are recorded in place of frames.
    """

    seconds: float
    max_bytes: int
    above_N: float = math.inf
    bursts: bool = False


class PreTriggerBuffer(Subscriber):
    """Passes frames on to ``recorder`` while recording is on; may be called from any thread.

    Attributes
    ----------
    on : bool
        Whether recording is on.
    """

    def __init__(
        self,
        recorder: RecordingSink,
        frame_counts: FrameCounts,
        event_log: EventLog,
        settings: PreTrigger,
        *,
        on: bool = True,
        force: Callable[[], TimedFigure] = TimedFigure,
    ) -> None:
        self._recorder, self._frame_counts, self._event_log, self._settings = (
            recorder,
            frame_counts,
            event_log,
            settings,
        )
        self.on, self._force = on, force
        self._kept: deque[tuple[float, int, Item]] = deque()
        self._bytes = 0
        self._above_N = math.inf if on else settings.above_N
        # Sequence numbers recorded last, without a gap while off; inf: from the next item on.
        self._first_recorded: float = 0 if on else math.inf
        self._last_recorded = -1
        self._lock = threading.RLock()
        # Means of bursts are made only where someone takes them.
        self.takes = (Frame, LoadSample, Event, *([Burst] if settings.bursts else []))

    def take(self, record: Record) -> None:
        """Take what is recorded: frames, bursts in their place, load samples and events."""
        body, is_reference = record.body, record.role == "reference"
        if isinstance(body, Frame):
            self.frame(body, is_reference=is_reference)
        elif isinstance(body, Burst):
            self.burst(body, is_reference=is_reference)
        elif isinstance(body, LoadSample):
            self.sample(body)
        elif isinstance(body, Event):
            self.event(body)

    @property
    def failed(self) -> str | None:
        """Why nothing more is written; None while all is well."""
        return self._recorder.failed

    @property
    def backlog(self) -> float:
        """Share of the buffer that waits for the disk."""
        return self._recorder.backlog

    def frame(self, frame: Frame, *, is_reference: bool) -> None:
        """Take a frame; ``is_reference``: part of a reference."""
        self._watch_force()
        with self._lock:
            if self._settings.bursts:
                self._recorder.frame(frame)  # which only counts it
            else:
                self._picture(frame, frame.t, frame.image.nbytes, is_reference)

    def burst(self, burst: Burst, *, is_reference: bool) -> None:
        """Take a burst, recorded where bursts replace frames; ``is_reference``: a reference."""
        if self._settings.bursts:
            with self._lock:
                self._picture(burst, burst.t, burst.mean.nbytes, is_reference)

    def sample(self, sample: LoadSample) -> None:
        """Take a load sample: always recorded, since the pictures just before it need its force."""
        self._recorder.sample(sample)
        if abs(sample.force) > self._above_N and not self.on:
            self._switch_on(Message("the force is above {above_N:g} N", self._above_N))
        self._watch_force()

    def _watch_force(self) -> None:
        """A force that is not known is not one below the trigger: switch on where it is lost or beyond its range."""
        trouble = self._force().trouble("force") if self._above_N < math.inf else ""
        if trouble and not self.on:
            self._switch_on(trouble)

    def event(self, event: Event) -> None:
        """Take an event; without the lock where it may come from the recorder's own thread."""
        if event.kind is not EventKind.MEASURED:
            self._recorder.event(event)
            return
        with self._lock:
            if self._has(event):
                self._recorder.event(event)
            elif not self.on:
                self._hold(event, event.t, _SMALL)

    def command(self, what: str) -> str:
        """Begin (START) or end recording; raises ControlRefused where it is so already, or nothing can be written."""
        if self.failed is not None:
            raise ControlRefused("nothing can be recorded: {failed}", self.failed)
        if (what == START) is self.on:
            raise ControlRefused(Message("recording already") if self.on else Message("not recording"))
        return self._switch_on("ordered") if what == START else self._switch_off()

    def close(self, frame_counts: dict[str, Any]) -> None:
        """Drop what is kept, and close the recording."""
        with self._lock:
            self._drop_kept()
        # Without the lock: the recorder may still emit events while it writes.
        self._recorder.close(frame_counts)

    def _switch_on(self, why: str) -> str:
        with self._lock:
            if self.on:
                return ""
            pictures = [item for _, _, item in self._kept if isinstance(item, Frame | Burst)]
            self.on, self._above_N = True, math.inf
            self._first_recorded = math.inf
            kept, self._kept, self._bytes = self._kept, deque(), 0
            for _, _, item in kept:
                self._pass(item)
        kind = "bursts" if self._settings.bursts else "frames"
        text = Message("recording begins ({why}), with {count} {kind} before", why, len(pictures), kind)
        self._event_log.emit(EventKind.RECORD, "operator", text, data={"on": True, "before": len(pictures)})
        return Message("with {count} before", len(pictures))

    def _switch_off(self) -> str:
        with self._lock:
            self.on = False
        self._event_log.emit(
            EventKind.RECORD, "operator", Message("recording ends, measuring goes on"), data={"on": False}
        )
        return ""

    def _picture(self, item: Frame | Burst, t: float, size: int, is_reference: bool) -> None:
        if self.on:
            self._pass(item)
        elif is_reference:
            self._drop_kept()  # older items would be out of order
            if _first(item) != self._last_recorded + 1:
                self._first_recorded = math.inf
            self._pass(item)
        else:
            self._hold(item, t, size)

    def _pass(self, item: Item) -> None:
        if isinstance(item, Frame | Burst):
            self._first_recorded = min(self._first_recorded, _first(item))
        if isinstance(item, Frame):
            self._last_recorded = item.index
            self._recorder.frame(item)
        elif isinstance(item, Burst):
            self._last_recorded = item.last_index
            self._recorder.burst(item)
        elif self._has(item):
            self._recorder.event(item)

    def _has(self, event: Event) -> bool:
        """Whether the burst of ``event`` is recorded whole."""
        if event.data["first"] < self._first_recorded:
            return False
        return self.on or bool(event.data["last"] <= self._last_recorded)

    def _hold(self, item: Item, t: float, size: int) -> None:
        self._kept.append((t, size, item))
        self._bytes += size
        while self._kept[0][0] < t - self._settings.seconds or self._bytes > self._settings.max_bytes:
            self._drop()
            if not self._kept:
                return

    def _drop(self) -> None:
        _, size, item = self._kept.popleft()
        self._bytes -= size
        if isinstance(item, Frame):
            self._frame_counts.add(thinned=1)

    def _drop_kept(self) -> None:
        while self._kept:
            self._drop()


def _first(item: Frame | Burst) -> int:
    return item.index if isinstance(item, Frame) else item.first_index


@dataclass(frozen=True, slots=True, eq=False)
class _Measured:
    """A burst, its force or strain, and the event that it was measured."""

    value: float
    burst: Burst
    event: Event


class CyclePictures(Subscriber):
    """Passes on to ``recording`` what it takes, but of the bursts those that are kept; references always are.

    Parameters
    ----------
    recording : PreTriggerBuffer
    mode : RecordMode
    run_state : RunState
        Counts the cycles, before this takes a measurement.
    max_bytes : int
        Of bursts that wait for their measurement; the oldest are left out beyond it.
    """

    def __init__(
        self, recording: PreTriggerBuffer, mode: RecordMode, run_state: RunState, max_bytes: int
    ) -> None:
        self._recording, self._mode, self._run_state = recording, mode, run_state
        self.takes = (*recording.takes, Measurement, Matched)
        self._max_bytes, self._bytes = max_bytes, 0
        self._bursts: dict[int, Burst] = {}
        self._events: dict[int, Event] = {}
        self._low, self._high, self._rises = math.inf, -math.inf, False
        self._extreme: _Measured | None = None
        self._valley: _Measured | None = None
        self._newest: tuple[_Measured, ...] = ()  # valley and peak
        self._waiting: deque[tuple[_Measured, _Measured]] = deque(maxlen=_MOST_WAITING)
        self._last_index = -1
        self._lock = threading.RLock()

    def take(self, record: Record) -> None:
        """Hold a burst and what is known of it, pass on all else; a reference makes an end of what waits."""
        body = record.body
        with self._lock:
            if isinstance(body, Burst) and record.role == "reference":
                self._begin_after(body)
                self._recording.take(record)
            elif isinstance(body, Burst):
                self._hold(body)
            elif isinstance(body, Event) and body.kind is EventKind.MEASURED:
                self._events[int(body.data["first"])] = body
            elif isinstance(body, Measurement):
                self._keep_cycles()
            elif isinstance(body, Matched):
                self._judge(body.measurement)
            else:
                self._recording.take(record)

    def _begin_after(self, reference: Burst) -> None:
        self._bursts.clear()
        self._waiting.clear()
        self._bytes, self._extreme, self._valley, self._newest = 0, None, None, ()
        self._last_index = reference.last_index

    def _hold(self, burst: Burst) -> None:
        self._bursts[burst.first_index] = burst
        self._bytes += burst.mean.nbytes
        while self._bytes > self._max_bytes and len(self._bursts) > 1:
            self._drop(next(iter(self._bursts)))

    def _drop(self, first: int) -> Burst:
        burst = self._bursts.pop(first)
        self._bytes -= burst.mean.nbytes
        return burst

    def _judge(self, m: Measurement) -> None:
        """Note a burst whose force is final; those before it were not measured."""
        first, found = m.burst.first_index, None
        for number in [number for number in self._bursts if number <= first]:
            found = self._drop(number)
        event = self._events.get(first)
        self._events = {number: one for number, one in self._events.items() if number > first}
        strain = m.time_step.axial(self._run_state.history.current_axis)[0]
        value = m.force if self._run_state.with_load else strain
        if found is None or found.first_index != first or event is None or math.isnan(value):
            return
        self._low, self._high = min(self._low, value), max(self._high, value)
        self._turn(_Measured(value, found, event))

    def _turn(self, new: _Measured) -> None:
        extreme, sign = self._extreme, 1 if self._rises else -1
        if extreme is None or sign * (new.value - extreme.value) >= 0:
            self._extreme = new
        elif abs(new.value - extreme.value) > _TURN * (self._high - self._low):
            if self._rises and self._valley is not None:
                self._newest = self._valley, extreme
                self._waiting.append(self._newest)
            self._valley = None if self._rises else extreme
            self._extreme, self._rises = new, not self._rises

    def _keep_cycles(self) -> None:
        """Record those of the cycles that the newest burst has completed."""
        for cycle in self._run_state.cycles.newest:
            since, until = cycle.t, cycle.t + cycle.duration
            inside = [pair for pair in self._waiting if since <= pair[1].burst.t <= until]
            for pair in [pair for pair in self._waiting if pair[1].burst.t <= until]:
                self._waiting.remove(pair)
            if inside and self._mode.keeps_cycle(cycle.number):
                self._record(max(inside, key=lambda pair: pair[1].value))

    def _record(self, kept: tuple[_Measured, ...]) -> None:
        for one in kept:
            if one.burst.first_index > self._last_index:
                self._last_index = one.burst.last_index
                self._recording.burst(one.burst, is_reference=False)
                self._recording.event(one.event)

    def end(self) -> None:
        """Record the last peak, with its valley, and the newest turn: what there is of the end of the test."""
        with self._lock:
            last = (*self._newest, self._valley, self._extreme)
            self._record(tuple(one for one in last if one is not None))
