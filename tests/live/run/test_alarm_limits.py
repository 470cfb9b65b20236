"""When an alarm comes on and goes off, value by value."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.events import Event
from live.config.sections import AlarmConfig
from live.pipeline.run_state import ActiveAlarms
from live.pipeline.snapshot import Snapshot
from live.run.alarms import Alarm, AlarmWatch, in_words
from tests.live.made_up import START, in_ascii, make_measurement

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


def state_of(events: list[Event]) -> Any:
    """A run whose machine has no channels."""
    health = SimpleNamespace(channels=lambda now: {})
    return SimpleNamespace(health=health, alarms=ActiveAlarms(), event_log=events.append)


@pytest.mark.parametrize(("clock", "after_s"), [("device", 0.465), ("host", 0.465), ("nominal", None)])
def test_an_alarm_says_how_long_after_the_last_frame_it_came(clock: Any, after_s: float | None) -> None:
    events: list[Event] = []
    values: Any = SimpleNamespace(read=lambda measurement: {"axial": 2e-3}, now=Snapshot(START))
    alarm = Alarm(AlarmConfig(channel="axial", above=1e-3))
    watch = AlarmWatch([alarm], values, state_of(events), lambda: START + 0.5)
    m = make_measurement(0)
    watch.measurement(replace(m, burst=replace(m.burst, clock=clock)))
    assert events[0].t == START + 0.5
    assert events[0].data.get("after_s") == (None if after_s is None else pytest.approx(after_s))
    assert watch.end() == "1 came"


@pytest.mark.parametrize("channel", ["silent_s", "mean_axial", "axial"])
def test_what_changes_by_itself_is_looked_at_five_times_a_second(channel: str) -> None:
    nothing: Any = SimpleNamespace(read=dict, now=Snapshot(0.0))
    alarm = Alarm(AlarmConfig(channel=channel, above=1.0))
    watch = AlarmWatch([alarm], nothing, state_of([]), lambda: 0.0)
    assert watch.idle() == 0.2 and watch.end() == "none came"


def test_alarms_see_the_machine_and_both_sides() -> None:
    """The channels of both sides come before those of the machine; why they are lost is told."""
    events: list[Event] = []
    values: Any = SimpleNamespace(read=dict, now=Snapshot(0.0), start=7.0)
    state = state_of(events)
    state.health.channels = lambda now: {"disk_min": now, "mean_axial": 0.0}
    both: Any = SimpleNamespace(lost="", read=lambda start: {"mean_axial": start})
    alarms = [Alarm(AlarmConfig(channel=name, above=1.0)) for name in ("disk_min", "mean_axial")]
    watch = AlarmWatch(alarms, values, state, lambda: 5.0, both)
    watch.idle()
    assert [(event.data["on"], event.data["value"]) for event in events] == [(True, 5.0), (True, 7.0)]
    both.lost = "why"
    assert (
        watch.end() == "2 came" and AlarmWatch(alarms, values, state_of([]), lambda: 5.0).end() == "none came"
    )


@pytest.mark.parametrize(
    ("channel", "value", "words"),
    [
        ("sigma_axial", 5e-6, "sigma axial 5 um/m, limit 1000 um/m"),
        ("sigma_mean_axial", 5e-6, "sigma mean axial 5 um/m, limit 1000 um/m"),
        ("bending_gauge_left", -5e-6, "bending gauge left -5 um/m, limit 1000 um/m"),
        ("stress_MPa", 12.5, "stress 12.5 MPa, limit 0.0 MPa"),
        ("latency_s", 0.25, "latency 0.25 s, limit 0.001"),
        ("noise_GL", 2.5, "noise 2.5 GL, limit 0.001"),
        ("strain_rate", 0.25, "strain rate 0.25, limit 0.001"),
        ("load_silent_s", 2.0, "no force for 2 s, limit 0.001"),
        ("largest", 0.25, "largest 25.000 %, limit 1000 um/m"),
    ],
)
def test_a_channel_is_named_with_its_unit(channel: str, value: float, words: str) -> None:
    assert in_ascii(in_words(channel, value, 1e-3)) == words
