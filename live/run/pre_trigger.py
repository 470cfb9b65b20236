"""The gate before the recorder: shut, it keeps the last seconds; opened, these go first and then all that comes.

What a replay cannot do without passes also a shut gate: the frames of references, the load, and what is told. A
burst that was measured while its frames were not recorded is not in the recorded list of bursts.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import dataclass
from typing import Any, Protocol

from acquire.events import Event, EventKind
from acquire.frame import Burst, Frame
from acquire.load_sample import LoadSample
from live.pipeline.event_log import EventLog
from live.pipeline.frame_counts import FrameCounts
from live.run.control import START, ControlRefused

_SMALL = 512  # bytes counted for an event


class Recorded(Protocol):
    """Who records what passes the gate; nothing here waits."""

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
    """What is kept while the gate is shut, and what opens it.

    Attributes
    ----------
    seconds : float, s
    most_bytes : int
    above_N : float, N
        A force of this magnitude opens it, once; infinite: only an order does.
    bursts : bool
        Bursts are recorded in place of frames.
    """

    seconds: float
    most_bytes: int
    above_N: float = math.inf
    bursts: bool = False


Item = Frame | Burst | Event


class PreTriggerBuffer:
    """Passes on to ``recorder`` while it is open; may be called from any thread.

    Attributes
    ----------
    on : bool
        Whether it is open.
    """

    def __init__(
        self,
        recorder: Recorded,
        frame_counts: FrameCounts,
        event_log: EventLog,
        keep: PreTrigger,
        *,
        on: bool = True,
    ) -> None:
        self._recorder, self._frame_counts, self._event_log, self._keep = (
            recorder,
            frame_counts,
            event_log,
            keep,
        )
        self.on = on
        self._kept: deque[tuple[float, int, Item]] = deque()
        self._bytes = 0
        self._above_N = math.inf if on else keep.above_N
        # Sequence numbers that were recorded last, without a gap of ours; inf: from the next that comes.
        self._from: float = 0 if on else math.inf
        self._to = -1
        self._lock = threading.RLock()

    @property
    def failed(self) -> str | None:
        """Why nothing more is written; None while all is well."""
        return self._recorder.failed

    @property
    def backlog(self) -> float:
        """Share of the buffer that waits for the disk."""
        return self._recorder.backlog

    def frame(self, frame: Frame, *, needed: bool) -> None:
        """A frame; ``needed``: part of a reference."""
        with self._lock:
            if self._keep.bursts:
                self._recorder.frame(frame)  # which only counts it
            else:
                self._picture(frame, frame.t, frame.image.nbytes, needed)

    def burst(self, burst: Burst, *, needed: bool) -> None:
        """A burst, which is recorded where bursts are; ``needed``: a reference."""
        if self._keep.bursts:
            with self._lock:
                self._picture(burst, burst.t, burst.mean.nbytes, needed)

    def sample(self, sample: LoadSample) -> None:
        """A load sample: small, and wanted for the pictures just before it; always recorded."""
        self._recorder.sample(sample)
        if abs(sample.force) > self._above_N and not self.on:
            self._open(f"the force is above {self._above_N:g} N")

    def event(self, event: Event) -> None:
        """An event; those of the recorder's own thread must not wait for whoever waits for that thread."""
        if event.kind is not EventKind.MEASURED:
            self._recorder.event(event)
            return
        with self._lock:
            if self._has(event):
                self._recorder.event(event)
            elif not self.on:
                self._hold(event, event.t, _SMALL)

    def order(self, what: str) -> str:
        """Begin (START) or end recording; raises OrderRefused where it is so already, or nothing can be written."""
        if self.failed is not None:
            raise ControlRefused(f"nothing can be recorded: {self.failed}")
        if (what == START) is self.on:
            raise ControlRefused("recording already" if self.on else "not recording")
        return self._open("ordered") if what == START else self._shut()

    def close(self, frame_counts: dict[str, Any]) -> None:
        """Let go what is kept, and close the recording."""
        with self._lock:
            self._let_go()
        # Without the lock: what is still to be written may be told of.
        self._recorder.close(frame_counts)

    def _open(self, why: str) -> str:
        with self._lock:
            if self.on:
                return ""
            pictures = [item for _, _, item in self._kept if isinstance(item, Frame | Burst)]
            self.on, self._above_N = True, math.inf
            self._from = math.inf
            kept, self._kept, self._bytes = self._kept, deque(), 0
            for _, _, item in kept:
                self._pass(item)
        text = f"recording begins ({why}), with {len(pictures)} {'bursts' if self._keep.bursts else 'frames'} before"
        self._event_log.tell(EventKind.RECORD, "operator", text, data={"on": True, "before": len(pictures)})
        return f"with {len(pictures)} before"

    def _shut(self) -> str:
        with self._lock:
            self.on = False
        self._event_log.tell(
            EventKind.RECORD, "operator", "recording ends, measuring goes on", data={"on": False}
        )
        return ""

    def _picture(self, item: Frame | Burst, t: float, size: int, needed: bool) -> None:
        if self.on:
            self._pass(item)
        elif needed:
            self._let_go()  # what came before would be out of order
            if _first(item) != self._to + 1:
                self._from = math.inf
            self._pass(item)
        else:
            self._hold(item, t, size)

    def _pass(self, item: Item) -> None:
        if isinstance(item, Frame | Burst):
            self._from = min(self._from, _first(item))
        if isinstance(item, Frame):
            self._to = item.index
            self._recorder.frame(item)
        elif isinstance(item, Burst):
            self._to = item.last_index
            self._recorder.burst(item)
        elif self._has(item):
            self._recorder.event(item)

    def _has(self, event: Event) -> bool:
        """Whether the burst that ``event`` tells of is recorded whole."""
        if event.data["first"] < self._from:
            return False
        return self.on or bool(event.data["last"] <= self._to)

    def _hold(self, item: Item, t: float, size: int) -> None:
        self._kept.append((t, size, item))
        self._bytes += size
        while self._kept[0][0] < t - self._keep.seconds or self._bytes > self._keep.most_bytes:
            self._drop()
            if not self._kept:
                return

    def _drop(self) -> None:
        _, size, item = self._kept.popleft()
        self._bytes -= size
        if isinstance(item, Frame):
            self._frame_counts.add(thinned=1)

    def _let_go(self) -> None:
        while self._kept:
            self._drop()


def _first(item: Frame | Burst) -> int:
    return item.index if isinstance(item, Frame) else item.first_index
