"""Streams for tests: consumers as in a run, what a camera publishes, and a list of bursts in place of a camera."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from acquire.events import Event
from acquire.frame import Frame
from acquire.load_sample import LoadSample
from live.pipeline.consumer import Consumer, ConsumerReport
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import RunState
from live.stream.adapted import Outputs
from live.stream.stream import Body, Record, StateKeeper, Stream, Subscriber


class Published:
    """Consumers on a stream, with the state of a replay."""

    def __init__(self, consumers: Sequence[Consumer], run_state: RunState, loads: Any = None) -> None:
        self.stream, self.history = Stream(), run_state.history
        self.stream.add(StateKeeper(run_state, ""))
        self._outputs = Outputs(consumers, loads or run_state.loads, run_state.event_log, self.stream)
        run_state.event_log.add_listener(self.stream.publish)

    def add(self, measurement: Measurement) -> None:
        self.stream.publish(measurement)

    def frame(self, frame: Frame) -> None:
        self.stream.publish(frame)

    def load(self, sample: LoadSample) -> None:
        self.stream.publish(sample)

    def event(self, event: Event) -> None:
        self.stream.publish(event)

    @property
    def wants_frames(self) -> bool:
        return self.stream.wants(Frame)

    @property
    def failed(self) -> bool:
        return self._outputs.failed

    @property
    def reports(self) -> Sequence[ConsumerReport]:
        return self._outputs.reports

    def end(self) -> None:
        self._outputs.end()


class Noted(Subscriber):
    """Keeps the records of some kinds; with ``each`` something is done at every one."""

    def __init__(self, stream: Stream, *kinds: type, each: Any = lambda record: None) -> None:
        self.takes, self.records, self._each = kinds, list[Record](), each
        stream.add(self)

    def take(self, record: Record) -> None:
        self.records.append(record)
        self._each(record)

    def bodies(self) -> list[Any]:
        return [record.body for record in self.records]


def record_of(body: Body) -> Record:
    """That of a single camera."""
    return Record("", body)


class KeptState:
    """A stream with the state of a live run, kept as the run keeps it."""

    def __init__(self, load: str = "cell:") -> None:
        self.stream, self.state = Stream(), RunState.new(0.5)
        self.keeper = StateKeeper(self.state, load)
        self.stream.add(self.keeper)
        self.state.event_log.add_listener(self.stream.publish)
