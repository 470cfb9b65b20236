"""``reference`` at any moment, from another thread: no frame of a reference is missing in an armed recording."""

from __future__ import annotations

import random
import threading
from collections.abc import Callable
from typing import Any

import pytest

from acquire.frame import Frame
from live.pipeline.event_log import EventLog
from live.pipeline.run_state import RunState
from live.run.grabber import Grabber, GrabPlan
from live.run.pre_trigger import PreTrigger, PreTriggerBuffer
from tests.live.fakes import ListCamera, frame

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
    state, settings = RunState.new(0.25), PreTrigger(0.4, 10**6)
    buffer = PreTriggerBuffer(written, state.frame_counts, EventLog(), settings, on=on)  # type: ignore[arg-type]

    def give(here: str, one: Frame) -> None:
        if here == place and one.index == at:
            _on_a_thread(grabber.take_reference)

    def take(one: Frame, is_reference: bool) -> None:
        give("handed on", one)
        buffer.frame(one, is_reference=is_reference)
        give("recorded", one)

    def before(one: Frame) -> None:
        give("before", one)
        rate(one)

    grabber = Grabber(ListCamera([], live=True), GrabPlan(1, n), state, take)
    rate, grabber._rate = grabber._rate, before  # type: ignore[method-assign]
    for k in range(FRAMES):
        grabber._take(frame(k))
        give("averaged", frame(k))
    indices = [one.index for one in written.frames]
    assert indices == sorted(set(indices))
    while not grabber.references.empty():
        burst = grabber.references.get().burst
        assert {*range(burst.first_index, burst.last_index + 1)} <= {*indices}
