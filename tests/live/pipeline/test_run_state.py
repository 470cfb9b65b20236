"""What a run knows of itself: counts of frames, health, alarms and events."""

from __future__ import annotations

import logging
import tracemalloc

import pytest

from acquire.events import Event, EventKind, Level
from live.pipeline import event_log
from live.pipeline.event_log import EventLog, Repeats, sentence
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


SOUND = {"grabbed": 100, "recorded": 90, "unrecorded": 4, "thinned": 6,
         "reference": 8, "measured": 60, "skipped": 30, "left_out": 2}  # fmt: skip


def test_they_add_up() -> None:
    assert FrameCounts(**SOUND).adds_up
    assert FrameCounts(
        **{**SOUND, "recorded": 0, "unrecorded": 0, "thinned": 0}
    ).adds_up  # nothing is recorded


@pytest.mark.parametrize("name", SOUND)
@pytest.mark.parametrize("more", [1, -1])
def test_one_frame_too_many_or_too_few(name: str, more: int) -> None:
    counts = FrameCounts(**SOUND)
    counts.add(**{name: more})
    assert not counts.adds_up and "NOT EVERY FRAME IS ACCOUNTED FOR" in counts.line()


@pytest.mark.parametrize(
    ("counts", "loss"),
    [({"lost": 1}, True), ({"unrecorded": 1}, True), ({"load_lost": 1}, True), ({"skipped": 9}, False)],
)
def test_what_is_missing_for_good(counts: dict[str, int], loss: bool) -> None:
    assert FrameCounts(**counts).loss is loss


def test_the_share_that_was_not_measured() -> None:
    assert FrameCounts(**SOUND).skipped_share == pytest.approx(1 / 3)
    assert FrameCounts().skipped_share == 0


def alarm(k: int, level: Level = "warning") -> Event:
    text = f"alarm high: force is {1000 + k:,} N" if level == "warning" else "alarm high is over"
    return Event(float(k), EventKind.ALARM, "alarm", text, level, {"alarm": "high", "on": level == "warning"})


def kept(held: Repeats) -> list[tuple[str, int]]:
    return [(event.text, count) for event, count in held]


def test_the_first_three_stand_as_they_come_and_then_the_newest_with_the_number_of_all() -> None:
    held = Repeats()
    assert [held.add(alarm(k)) for k in range(3)] == [1, 2, 3]
    held.add(Event(3.0, EventKind.DEVICE, "cell", "no reading for 2.0 s", "warning"))
    for k in range(3, 4556):
        held.add(alarm(k))
    assert kept(held) == [
        ("alarm high: force is 1,000 N", 1), ("alarm high: force is 1,001 N", 1),
        ("alarm high: force is 1,002 N", 1), ("no reading for 2.0 s", 1), ("alarm high: force is 5,555 N", 4556),
    ]  # fmt: skip


def test_what_a_person_says_or_does_is_never_put_together() -> None:
    held = Repeats()
    for k in range(20):
        for kind in (EventKind.NOTE, EventKind.TARE, EventKind.REFERENCE, EventKind.PAUSE):
            assert held.add(Event(k, kind, "operator", f"crack of {k} mm")) == 1
    assert len(kept(held)) == 80 and {count for _, count in held} == {1}


def test_other_sources_levels_and_words_are_others() -> None:
    held = Repeats()
    for k in range(5):
        held.add(alarm(k))
        held.add(alarm(k, "info"))
        held.add(Event(k, EventKind.DEVICE, f"cell {k}", "lost", "error"))
    assert sorted(count for _, count in held) == [1] * 11 + [5] * 2


def test_texts_without_end_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(event_log, "MAX_KINDS", 10)
    held = Repeats()
    for k in range(500):
        held.add(Event(k, EventKind.VIEW, "view", "x" * k, "warning"))
    assert len(kept(held)) == 10 + 4 and kept(held)[-1] == ("x" * 499, 490)


def test_a_log_counts_all_keeps_few_and_says_one_a_minute(caplog: pytest.LogCaptureFixture) -> None:
    log, passed = EventLog(), list[Event]()
    log.add_listener(passed.append)
    with caplog.at_level(logging.INFO):
        for k in range(600):
            log.record(Event(k / 10, EventKind.LOST, "sim:", f"{k} frames lost", "warning"))
        log.record(Event(60.0, EventKind.DEVICE, "sim:", "it is back", "info"))
    assert len(passed) == 601, "recording and outputs take each"
    assert log.count("warning") == 600 and log.count("error") == 0
    assert [event.text for event in log.events("warning")] == [
        "0 frames lost", "1 frames lost", "2 frames lost", "599 frames lost",
    ]  # fmt: skip
    said = [one.getMessage() for one in caplog.records]
    assert said[3:] == ["sim:: 3 frames lost (4 times)", "sim:: it is back"], said
    late: list[Event] = []
    log.add_listener(late.append)
    assert len(late) == 5


def test_a_chattering_alarm_of_an_hour_takes_no_memory() -> None:
    log = EventLog()
    logging.getLogger("live.pipeline.event_log").setLevel(logging.ERROR)

    def chatter(begin: int, end: int) -> None:
        for k in range(begin, end):
            log.record(alarm(k))
            log.record(alarm(k, "info"))

    chatter(0, 1000)
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    chatter(1000, 10_000)
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    logging.getLogger("live.pipeline.event_log").setLevel(logging.NOTSET)
    assert grown < 20_000
