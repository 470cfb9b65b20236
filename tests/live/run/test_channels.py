"""Mailbox and buffer: newest wins, bounded, everything counted."""

from __future__ import annotations

import threading
import time

import pytest

from live.run import channels
from live.run.channels import ByteBuffer, Mailbox


def test_newest_wins_and_the_rest_is_counted() -> None:
    box: Mailbox[int] = Mailbox()
    for i in range(5):
        box.put(i)
    assert box.get(0) == 4
    assert box.take_skipped() == [0, 1, 2, 3]
    assert box.take_skipped() == []
    assert box.get(0) is None


def test_a_closed_mailbox_gives_what_lies_there() -> None:
    box: Mailbox[int] = Mailbox()
    box.put(1)
    box.close()
    assert not box.finished
    assert box.get() == 1
    assert box.finished
    assert box.get() is None
    box.put(2)
    assert box.take_skipped() == [2]


def test_a_waiting_mailbox_skips_nothing() -> None:
    box: Mailbox[int] = Mailbox(waits=True)

    def produce() -> None:
        for i in range(200):
            box.put(i)
        box.close()

    thread = threading.Thread(target=produce)
    thread.start()
    taken = []
    while not box.finished:
        item = box.get(1.0)
        if item is not None:
            taken.append(item)
    thread.join()
    assert taken == list(range(200))
    assert box.take_skipped() == []


def test_what_comes_while_the_reader_prepares_waits_for_it() -> None:
    box: Mailbox[int] = Mailbox(at_first=3)
    for i in range(5):
        box.put(i)
    assert box.take_skipped() == [0, 1]  # no more than three may wait
    box.begin()
    assert [box.get(0), box.get(0)] == [2, 3]
    box.put(5)
    assert [box.get(0), box.get(0), box.get(0)] == [4, 5, None]  # caught up: from now on the newest
    box.put(6)
    box.put(7)
    assert box.get(0) == 7
    assert box.take_skipped() == [6]


def test_a_reader_who_never_catches_up_goes_on_with_the_newest() -> None:
    box: Mailbox[int] = Mailbox(at_first=3)
    box.begin()
    taken = []
    for i in range(0, 40, 2):
        box.put(i)
        box.put(i + 1)
        taken.append(box.get(0))
    assert taken[:2] == [0, 1]
    assert taken[3:] == list(range(7, 40, 2))


def test_a_slow_reader_is_not_kept_in_the_past(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(channels, "CATCH_UP_S", 0.05)
    box: Mailbox[int] = Mailbox(at_first=50)
    for i in range(40):
        box.put(i)
    box.begin()
    assert box.get(0) == 0
    time.sleep(0.1)
    assert box.get(0) == 39
    assert box.take_skipped() == list(range(1, 39))


def test_closing_frees_a_waiting_producer() -> None:
    box: Mailbox[int] = Mailbox(waits=True)
    box.put(1)
    thread = threading.Thread(target=box.put, args=(2,))
    thread.start()
    box.close()
    thread.join(5)
    assert not thread.is_alive()
    assert box.take_skipped() == [2]


def test_the_buffer_is_bounded_in_bytes() -> None:
    buffer: ByteBuffer[str] = ByteBuffer(100)
    assert buffer.put("a", 60)
    assert not buffer.put("b", 60)
    assert buffer.put("c", 40)
    assert buffer.put("small", 500, always=True)
    assert buffer.waiting_bytes == 600
    assert [buffer.get(0), buffer.get(0), buffer.get(0), buffer.get(0)] == ["a", "c", "small", None]
    assert buffer.put("large", 1000)  # an empty one takes anything, else it would never be written
    buffer.close()
    assert not buffer.put("late", 1)
    assert buffer.get() == "large"
    assert buffer.finished


def test_a_waiting_buffer_loses_nothing() -> None:
    buffer: ByteBuffer[int] = ByteBuffer(3, waits=True)
    thread = threading.Thread(target=lambda: [buffer.put(i, 1) for i in range(100)] and buffer.close())
    thread.start()
    taken = []
    while not buffer.finished:
        item = buffer.get(1.0)
        if item is not None:
            taken.append(item)
    thread.join()
    assert taken == list(range(100))
