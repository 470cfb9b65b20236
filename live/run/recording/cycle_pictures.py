"""The pictures of a cyclic test that are recorded: of some of its cycles the bursts at valley and peak.

A burst is a peak when the force, or the strain where no force is known, has fallen behind it by a tenth of its range
so far; so is a valley. That of a cycle is the one before its peak. Both wait until the cycle has its number.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import dataclass

from acquire.events import Event, EventKind
from acquire.frame import Burst
from acquire.record_mode import RecordMode
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import RunState
from live.run.recording.pre_trigger import PreTriggerBuffer
from live.stream.stream import Matched, Record, Subscriber

_TURN = 0.1  # of the range of the test so far
_MOST_WAITING = 8  # peaks without a cycle: at rest noise turns


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
