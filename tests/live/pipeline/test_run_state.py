"""What a run knows of itself: counts of frames, health, alarms and events."""

from __future__ import annotations

from acquire.events import Event, EventKind
from live.pipeline.event_log import EventLog, sentence
from live.pipeline.run_state import ActiveAlarms, FrameCounts, Health
from live.pipeline.snapshot import Snapshot, peak_force


def test_the_counts_of_frames_in_a_line() -> None:
    counts = FrameCounts(grabbed=100, recorded=90, unrecorded=4, thinned=6, reference=8, measured=60, skipped=20,
                         left_out=12, lost=3, load_lost=2)  # fmt: skip
    assert counts.line() == (
        "grabbed 100 / recorded 90 / measured 60 / skipped 20 (25.0%) / lost 3 / load samples lost 2"
        "  (reference 8, left over 12, not recorded 4 and 6 on purpose; every frame is accounted for)"
    )
    assert FrameCounts(grabbed=2, recorded=2, measured=2).line() == (
        "grabbed 2 / recorded 2 / measured 2 / skipped 0 / lost 0  (reference 0, left over 0, not recorded 0;"
        " every frame is accounted for)"
    )
    assert FrameCounts(load_lost=1).loss and not FrameCounts(skipped=1).loss
    assert list(counts.as_dict()) == [
        "grabbed", "recorded", "unrecorded", "thinned", "reference", "measured", "skipped", "left_out", "lost",
        "load_samples", "load_lost", "failed", "without_force",
    ]  # fmt: skip


def test_health_is_silent_since_the_last_and_has_the_peak_with_its_sign() -> None:
    health = Health(began_t=1.0)
    health.loaded(2.0, -5.0)
    health.loaded(3.0, 4.0)
    health.frame_t, health.disk_s = 2.5, 90.0
    assert health.channels(4.0) == {"silent_s": 1.5, "load_silent_s": 1.0, "disk_min": 1.5}
    assert health.peak_N == -5.0
    assert peak_force(-5.0, 5.0) == -5.0 and peak_force(-5.0, 5.1) == 5.1
    assert (
        Snapshot(0.0, frames={"lost": 2, "unrecorded": 3, "skipped": 9}).lost == 5 and Snapshot(0.0).lost == 0
    )


def test_alarms_that_are_on_are_told_oldest_first() -> None:
    alarms = ActiveAlarms()
    for name in "ab":
        alarms.set(name, f"{name}: high")
    alarms.set("a", "a: higher")
    assert alarms.texts == ("a: higher", "b: high")
    alarms.clear("a")
    alarms.clear("none")
    assert alarms.texts == ("b: high",) and alarms.silence() == ("b",) and alarms.silence() == ()


def test_events_of_devices_have_the_time_of_the_test_and_those_of_frames_keep_theirs() -> None:
    log, told = EventLog(), list[Event]()
    log.origin = 100.0
    log(Event(103.0, EventKind.NOTE, "a", "one", "info"))
    log.record(Event(3.5, EventKind.MEASURED, "m", "two", "info"))
    log.record(Event(3.6, EventKind.NOTE, "m", "three", "warning"))
    log.add_listener(told.append)
    log.record(Event(3.7, EventKind.MEASURED, "m", "four", "info"))
    assert [(event.t, event.text) for event in told] == [(3.0, "one"), (3.6, "three"), (3.7, "four")]
    assert [event.text for event in log.events("warning")] == ["three"] and len(log.events()) == 2


def test_the_source_of_an_event_is_named_once() -> None:
    event = Event(0.0, EventKind.DEVICE, "sim:a", "sim:a: gone", "error")
    assert sentence(event) == "sim:a: gone" and sentence(event, {"sim:a": "camera"}) == "camera: gone"
