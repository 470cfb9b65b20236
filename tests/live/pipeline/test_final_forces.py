"""The force of a measurement is final: also that of the last ones, which nothing comes after."""

from __future__ import annotations

import pytest

from acquire.events import Event, EventKind
from acquire.load_cell.load_log import LoadLog
from acquire.load_sample import LoadSample
from live.pipeline.measurement import HOLD_S, ForceMatching
from tests.live.made_up import START, make_measurement


def loads(until: float, lag_s: float = 0.0) -> LoadLog:
    """10 N at the START and 100 N more each second, tared by 5 N a quarter of a second in."""
    log = LoadLog(lag_s=lag_s)
    for k in range(round(100 * until) + 1):
        log.append(LoadSample(START + k / 100, 10.0 + k))
    log.take_event(Event(START + 0.25, EventKind.TARE, "a cell", "", "info", {"step_N": 5.0}))
    return log


def test_the_last_ones_have_the_force_of_their_time() -> None:
    """They wait until the run ends, and what came meanwhile counts."""
    log = loads(0.15)
    matching = ForceMatching(log)
    waiting = [m for k in (2, 3) for m in matching.add(make_measurement(k))]
    assert waiting == [] and len(matching) == 2
    for k in range(16, 40):
        log.append(LoadSample(START + k / 100, 10.0 + k))
    last = matching.flush()
    assert [m.force for m in last] == pytest.approx([30.0, 40.0])
    assert [m.time_step.zero for m in last] == [0.0, 5.0]
    assert len(matching) == 0 and matching.flush() == []


def test_a_lag_is_taken_off_and_the_stamped_force_kept() -> None:
    matching = ForceMatching(loads(1.0, lag_s=0.05))
    (matched,) = matching.add(make_measurement(3))
    assert matched.force == pytest.approx(45.0)
    assert matched.time_step.force_raw == pytest.approx(40.0)


def test_a_force_is_final_once_the_log_reaches_past_the_lag() -> None:
    matching = ForceMatching(loads(0.12, lag_s=0.05))
    assert [m.number for k in (0, 1) for m in matching.add(make_measurement(k))] == [0]


def test_it_waits_no_longer_than_that() -> None:
    matching, held = ForceMatching(LoadLog()), round(HOLD_S / 0.1)
    given = [len(matching.add(make_measurement(k))) for k in range(held + 3)]
    assert given[:held] == [0] * held and sum(given) in (2, 3)
