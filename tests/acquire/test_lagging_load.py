"""A load that is stamped late is looked up later, by as much."""

from __future__ import annotations

import math

import pytest

from acquire.load_cell.load_log import LoadLog
from acquire.load_sample import LoadSample


def ramp(lag_s: float) -> LoadLog:
    """100 N a second, whose samples are stamped ``lag_s`` after the load they show."""
    log = LoadLog(lag_s=lag_s)
    for k in range(101):
        log.append(LoadSample(k / 100 + lag_s, float(k)))
    return log


@pytest.mark.parametrize("lag_s", [0.0, 0.03, 0.2])
def test_the_force_is_that_of_the_instant(lag_s: float) -> None:
    log = ramp(lag_s)
    assert log.force_at(0.505) == pytest.approx(50.5)
    raw = log.raw_force_at(0.505)
    assert math.isnan(raw) if lag_s == 0 else raw == pytest.approx(50.5 - 100 * lag_s)


def test_it_is_covered_once_the_samples_reach_past_the_lag() -> None:
    log = ramp(0.2)  # up to 1.2 s
    assert log.covers(1.0 - 1e-9) and not log.covers(1.0 + 1e-6)
    assert not math.isnan(log.force_at(1.0 - 1e-9)) and math.isnan(log.force_at(1.0 + 1e-6))
    log.close()
    assert log.covers(5.0)
