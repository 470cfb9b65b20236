"""When an alarm comes on and goes off, value by value."""

from __future__ import annotations

import math

import pytest

from live.config.sections import AlarmConfig
from live.run.alarms import Alarm

ABOVE = AlarmConfig(channel="force_N", above=100.0, hysteresis=10.0)
BELOW = AlarmConfig(channel="force_N", below=-100.0, hysteresis=10.0)
COURSE = [
    (99.9, False),
    (100.0, False),  # at the limit it is not yet beyond
    (100.1, True),
    (95.0, True),  # back, not by the hysteresis
    (90.1, True),
    (90.0, False),
    (95.0, False),  # within the hysteresis nothing comes on
    (100.0, False),
    (109.0, True),
    (math.nan, True),  # not known: as before
    (89.0, False),
    (math.nan, False),
]


@pytest.mark.parametrize(("config", "sign"), [(ABOVE, 1), (BELOW, -1)])
def test_on_beyond_the_limit_off_within_it_by_the_hysteresis(config: AlarmConfig, sign: int) -> None:
    alarm, before = Alarm(config), False
    for value, on in COURSE:
        assert alarm.check(sign * value) == (on != before), value
        assert alarm.on == on, value
        before = on


def test_its_name_has_the_limit() -> None:
    assert Alarm(ABOVE).name == "force_N above 100" and Alarm(BELOW).name == "force_N below -100"
