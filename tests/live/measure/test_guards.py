"""The smear guard: warns once when it begins and says when it ends."""

from __future__ import annotations

import dataclasses
import math

from acquire.burst.accumulate import burst_of
from acquire.events import Event
from live.measure.guards import SmearGuard
from tests.live.fakes import frame


def test_smear_is_told_when_it_begins_and_ends() -> None:
    told: list[Event] = []
    guard = SmearGuard(told.append)
    burst = burst_of([frame(0), frame(1)])
    for motion in (math.nan, 0.01, 0.2, 0.3, math.nan, 0.045, 0.06, 0.02, 0.01, 0.07):
        guard.look(dataclasses.replace(burst, motion_px=motion))
    assert [event.level for event in told] == ["warning", "info", "warning"]
    assert "0.20 px during a burst of 2" in told[0].text
    assert told[0].data == {"motion_px": 0.2, "n": 2}
