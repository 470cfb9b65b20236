"""``reference`` at any moment, from another thread: no frame of a reference is missing in an armed recording."""

from __future__ import annotations

import random
import threading
from collections.abc import Callable
from typing import Any

import pytest

from acquire.frame import Frame
from live.pipeline.event_log import EventLog
from live.pipeline.reference import ReferenceBurst
from live.pipeline.run_state import RunState
from live.run.pre_trigger import PreTrigger, PreTriggerBuffer
from live.run.sources import CameraSource, GrabPlan
from live.stream.stream import ReferenceWanted, Stream
from tests.live.fakes import ListCamera, frame
from tests.live.streaming import Noted

FRAMES, PLACES = 24, ("before", "handed on", "recorded", "averaged")


class Written:
    """In place of the recorder."""

    failed, backlog = None, 0.0

    def __init__(self) -> None:
        self.frames: list[Frame] = []

    def frame(self, one: Frame) -> None:
        self.frames.append(one)

    def __getattr__(self, name: str) -> Any:
        return lambda *arguments: None


def _on_a_thread(give: Callable[[], None]) -> None:
    thread = threading.Thread(target=give)
    thread.start()
    thread.join()


@pytest.mark.parametrize("place", PLACES)
def test_no_frame_of_a_reference_is_missing_wherever_the_command_comes(place: str) -> None:
    rng = random.Random(place)
    for _ in range(250):
        _once(rng, place)


def _once(rng: random.Random, place: str) -> None:
    written, n, at, on = Written(), rng.randint(1, 5), rng.randrange(FRAMES), rng.random() < 0.3
    state, stream, settings = RunState.new(0.25), Stream(), PreTrigger(0.4, 10**6)

    def give(here: str, index: int) -> None:
        if here == place and index == at:
            _on_a_thread(lambda: stream.publish(ReferenceWanted()))

    def giving(here: str) -> None:
        Noted(stream, Frame, each=lambda record: give(here, record.body.index))

    references = Noted(stream, ReferenceBurst)
    giving("handed on")
    stream.add(PreTriggerBuffer(written, state.frame_counts, EventLog(), settings, on=on))  # type: ignore[arg-type]
    giving("recorded")
    source = CameraSource(ListCamera([], live=True), GrabPlan(1, n), state, stream)
    for k in range(FRAMES):
        give("before", k)
        source._take(frame(k))
        give("averaged", k)
    indices = [one.index for one in written.frames]
    assert indices == sorted(set(indices))
    for reference in references.bodies():
        assert {*range(reference.burst.first_index, reference.burst.last_index + 1)} <= {*indices}
