"""Damaged pictures in a live test: counted as lost, told when they begin and when they end."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from acquire.frame import Frame
from live.pipeline.run_state import RunState
from live.run.sources import CameraSource, GrabPlan
from tests.live.fakes import ListCamera, frame
from tests.live.streaming import KeptState, Noted


def grabbed(frames: list[Any]) -> tuple[RunState, CameraSource, list[Any]]:
    """What comes of frames 0.05 s apart, by a reference of 2 and bursts of 2."""
    kept = KeptState()
    seen, camera = Noted(kept.stream, Frame), ListCamera(frames, live=True)
    source = CameraSource(camera, GrabPlan(2, 2), kept.state, kept.stream)
    with camera:
        source.start()
        source.join()
    return kept.state, source, seen.bodies()


def frames(n: int, damaged: range) -> list[Any]:
    return [replace(frame(k), damaged=k in damaged) for k in range(n)]


@pytest.mark.parametrize(("damaged", "told"), [(range(4, 164), 2), (range(4, 5), 2), (range(0), 0)])
def test_they_are_lost_and_said(damaged: range, told: int) -> None:
    state, _, _ = grabbed(frames(170, damaged))
    counts = state.frame_counts
    assert counts.lost == len(damaged) and counts.grabbed == 170
    assert counts.loss is bool(damaged)
    events = state.event_log.events("warning")
    assert len(events) == told
    if told:
        assert events[0].data["before"] == damaged[0] and events[-1].data["before"] == damaged[-1] + 1
        assert events[-1].data["count"] == len(damaged)


def test_those_that_last_to_the_end_are_said_at_their_begin() -> None:
    state, _, _ = grabbed(frames(20, range(10, 20)))
    assert state.frame_counts.lost == 10
    assert [event.data["before"] for event in state.event_log.events("warning")] == [10]


def test_a_picture_of_another_size_is_a_damaged_one() -> None:
    given = frames(10, range(0))
    given[5] = replace(given[5], image=np.zeros((4, 7), given[5].image.dtype))
    state, source, seen = grabbed(given)
    assert source.error is None and state.frame_counts.lost == 1
    assert [one.index for one in seen if one.damaged] == [5]
    assert seen[5].image.shape == given[0].image.shape and not seen[5].image.any()
