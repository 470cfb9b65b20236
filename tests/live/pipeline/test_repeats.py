"""Events that come again and again: one line with their number, wherever events are kept or shown."""

from __future__ import annotations

import logging
import tracemalloc

import pytest

from acquire.events import Event, EventKind, Level
from live.pipeline import event_log
from live.pipeline.event_log import EventLog, Repeats


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
