"""The stream: takes a record from any thread and gives it to all who take its kind, in the order they were added.

Nothing is queued here and no lock is held while records are passed on, so the records of one thread keep their order
and the thread that takes frames from a camera waits for nobody. Who takes a record returns at once; one that has work
to do has a queue of its own, with its policy and its counts.

Frames, bursts, load samples, events and measurements go through a test, each a record of the stream. ``StateKeeper``
keeps the state of a camera's run from them: loads, history, counts and health.
"""

from __future__ import annotations

import math
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from acquire.burst import SummedBurst
from acquire.clock import Clock
from acquire.errors import exit_code_of
from acquire.events import Event, EventKind
from acquire.frame import Burst, Frame
from acquire.load_sample import LoadSample
from acquire.text import Message
from live.pipeline.measurement import Measurement
from live.pipeline.reference import ReferenceBurst
from live.pipeline.run_state import RunState

Role = Literal["plain", "reference"]
"""Of a frame or a burst: decided once, before it is published, so that all who take it agree."""
ALL = ""
"""In place of the name of a camera: the record is for every camera, as a load sample is."""

SILENT_S, SILENT_PERIODS = 1.0, 10
"""A load cell that has sent nothing for both is away."""
_RATE_SHARE = 0.1  # of the newest interval in the rate of the frames


@dataclass(frozen=True, slots=True, eq=False)
class Matched:
    """A measurement whose force is final."""

    measurement: Measurement


@dataclass(frozen=True, slots=True)
class ReferenceWanted:
    """The next frames of the camera are to be a reference."""


@dataclass(frozen=True, slots=True)
class Waiting:
    """Between two bursts: ``words`` name what the measurement waits for; empty after a burst that came in time."""

    words: str


@dataclass(frozen=True, slots=True)
class CameraEnded:
    """The camera gives no more frames."""


@dataclass(frozen=True, slots=True)
class LoadEnded:
    """The load cell gives no more samples; ``error`` is what ended it, if anything."""

    error: Exception | None = None


Body = (
    Frame
    | Burst
    | SummedBurst
    | ReferenceBurst
    | LoadSample
    | Event
    | Measurement
    | Matched
    | ReferenceWanted
    | Waiting
    | CameraEnded
    | LoadEnded
)
"""What a record holds. ``Burst``: a mean, made only where it is recorded; ``SummedBurst``: what is measured."""


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """One thing that happened in a test.

    Attributes
    ----------
    camera : str
        The name of its camera; ``ALL`` for every one.
    body : Body
    role : "plain" or "reference"
        Of a frame or burst.
    """

    camera: str
    body: Body
    role: Role = "plain"


class Subscriber(ABC):
    """Takes the records of some kinds, in the thread that publishes them.

    Attributes
    ----------
    takes : iterable of type
        Kinds of bodies that it takes.
    """

    takes: Iterable[type] = ()

    @abstractmethod
    def take(self, record: Record) -> None:
        """Take one record; returns at once, but for sources that wait for their readers, and does not raise."""


class Stream:
    """Passes records on; may be called from any thread."""

    def __init__(self) -> None:
        self._takers: dict[type, tuple[tuple[str, Subscriber], ...]] = {}
        self._lock = threading.Lock()

    def add(self, subscriber: Subscriber, camera: str = ALL) -> None:
        """Give ``subscriber`` the records of ``camera`` (``ALL``: of each) from now on."""
        with self._lock:
            for kind in subscriber.takes:
                self._takers[kind] = (*self._takers.get(kind, ()), (camera, subscriber))

    def publish(self, body: Body, camera: str = ALL, role: Role = "plain") -> None:
        """Give ``body`` to all who take it; of ``ALL`` cameras to the subscribers of each."""
        record = Record(camera, body, role)
        for subscriber in self._takers_of(type(body), camera):
            subscriber.take(record)

    def wants(self, kind: type, camera: str = ALL) -> bool:
        """Whether anyone takes bodies of this kind: what nobody takes need not be made."""
        return bool(self._takers_of(kind, camera))

    def _takers_of(self, kind: type, camera: str) -> list[Subscriber]:
        takers = self._takers.get(kind, ())
        return [one for wanted, one in takers if ALL in (wanted, camera) or wanted == camera]


class StateKeeper(Subscriber):
    """Fills ``run_state``, before all others take a record.

    Parameters
    ----------
    run_state : RunState
    load : str
        Address of the load cell, for events; empty in a replay, whose loads are there already.
    clock : callable giving monotonic seconds

    Attributes
    ----------
    load_failure : int
        The exit code of the error that ended the load; 0 without one.
    """

    takes: Sequence[type] = (Frame, LoadSample, Measurement, Event, LoadEnded)

    def __init__(self, run_state: RunState, load: str, clock: Clock = time.monotonic) -> None:
        self._run_state, self._load, self._clock = run_state, load, clock
        self._last_frame_t = math.nan
        self._samples, self._first_t, self._last_t = 0, math.nan, math.nan
        self._load_ended = False
        self.load_failure = 0
        if not load:
            self.takes = (Measurement,)

    def take(self, record: Record) -> None:
        """Note what it says."""
        state, body = self._run_state, record.body
        if isinstance(body, Frame):
            self._framed(body)
            if record.role == "reference":
                state.health.since_t = body.t
        elif isinstance(body, LoadSample):
            self._loaded(body)
        elif isinstance(body, Measurement):
            state.add(body.time_step)
        elif isinstance(body, Event):
            state.loads.take_event(body)
        elif isinstance(body, LoadEnded):
            self._end_load(body.error)

    def begin(self) -> None:
        """The test begins now."""
        self._last_t = self._clock()

    def _framed(self, frame: Frame) -> None:
        health = self._run_state.health
        fps, before = health.fps, self._last_frame_t
        if frame.t > before:
            rate = 1 / (frame.t - before)
            fps = fps + _RATE_SHARE * (rate - fps) if fps else rate
        self._last_frame_t = frame.t
        health.framed(self._clock(), fps)

    def _loaded(self, sample: LoadSample) -> None:
        state, now = self._run_state, self._clock()
        self._first_t = self._first_t if self._samples else now
        self._samples, self._last_t = self._samples + 1, now
        state.loads.append(sample)
        state.health.loaded(now, sample.force, tells=state.loads.telling is sample)
        state.frame_counts.add(load_samples=1)

    def _end_load(self, error: Exception | None) -> None:
        self._load_ended = True
        if error is not None:
            self.load_failure = exit_code_of(error)
            text = Message("the load is lost, images go on: {error}", error)
            self._run_state.event_log.emit(EventKind.DEVICE, self._load, text, "error")
        self._run_state.loads.close()

    def end(self) -> None:
        """Count the samples of a load cell that is away when the test ends; 1 where the rate is not known."""
        if self._load_ended:
            return
        silent_s, span = self._clock() - self._last_t, self._last_t - self._first_t
        rate = (self._samples - 1) / span if self._samples > 1 and span > 0 else 0.0
        if silent_s <= max(SILENT_S, SILENT_PERIODS / rate if rate else SILENT_S):
            return
        missing = max(1, round(silent_s * rate))
        self._run_state.frame_counts.add(load_lost=missing)
        text = Message(
            "the load is missing at the end: no sample came for the last {silent_s:.1f} s", silent_s
        )
        data = {"count": missing, "where": "end"}
        self._run_state.event_log.emit(EventKind.LOST, self._load, text, "warning", data)
