"""Reading ahead: the same items in order, bounded, errors in their place, an end that leaves no thread."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from live.replay.ahead import ahead


def test_the_same_items_in_order() -> None:
    assert list(ahead(range(100), room=3)) == list(range(100))
    assert list(ahead([])) == []


def test_they_are_taken_while_one_is_worked_on_but_no_more_than_there_is_room() -> None:
    taken, waiting = [], threading.Event()

    def items() -> Iterator[int]:
        for k in range(20):
            taken.append(k)
            if k == 4:
                waiting.set()
            yield k

    bursts = ahead(items(), room=3)
    assert next(bursts) == 0
    assert waiting.wait(10), "nothing was read ahead"
    assert max(taken) <= 5
    bursts.close()


def test_an_error_comes_after_what_was_well() -> None:
    def items() -> Iterator[int]:
        yield 1
        yield 2
        raise OSError("the disk is gone")

    bursts = ahead(items())
    assert [next(bursts), next(bursts)] == [1, 2]
    with pytest.raises(OSError, match="the disk is gone"):
        next(bursts)


def test_closing_it_ends_the_thread_and_the_source() -> None:
    before = threading.active_count()

    def items() -> Iterator[int]:
        while True:
            yield 0

    bursts = ahead(items(), room=2)
    next(bursts)
    bursts.close()
    assert threading.active_count() == before
