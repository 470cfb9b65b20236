"""Opening again in threads: until it works, or until nobody waits any more."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest

from acquire import opening
from acquire.opening import LOOK_S, Opening, Reopening, close_within


class Slow:
    """Opens when it is let, and tells what was closed."""

    def __init__(self, error: Exception | None = None) -> None:
        self.let, self.closed, self._error = threading.Event(), threading.Event(), error

    def __call__(self) -> str:
        self.let.wait(60)
        if self._error is not None:
            raise self._error
        return "open"

    def opening(self) -> Opening[str]:
        return Opening(self, lambda opened: self.closed.set())


def test_what_opens_before_it_is_given_up_is_closed_by_that() -> None:
    slow = Slow()
    slow.let.set()
    opening = slow.opening()
    assert opening.done(60) and not slow.closed.is_set()
    opening.abandon()
    assert slow.closed.is_set()
    slow.closed.clear()
    opening.abandon()
    assert not slow.closed.is_set()


def test_what_is_taken_is_not_closed() -> None:
    slow = Slow()
    slow.let.set()
    opening = slow.opening()
    assert opening.done(60) and opening.take() == "open"
    opening.abandon()
    assert not slow.closed.is_set()


def test_an_error_comes_out_where_it_is_taken() -> None:
    slow = Slow(OSError("gone"))
    opening = slow.opening()
    assert not opening.done(0.0)
    slow.let.set()
    assert opening.done(60)
    with pytest.raises(OSError, match="gone"):
        opening.take()


def opened_again(again: Reopening[str], looks: int = 600) -> str | None:
    return next(filter(None, (again.look() for _ in range(looks))), None)


def tried(attempt: Callable[[], str], **more: Any) -> Reopening[str]:
    return Reopening(attempt, print, (OSError,), lambda seconds: None, **more)


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening, "RETRY_S", 0.0)


def test_it_is_tried_until_it_works(at_once: None) -> None:
    failures = iter((OSError("away"), OSError("busy")))
    failed: list[str] = []

    def attempt() -> str:
        for error in failures:
            raise error
        return "open"

    assert opened_again(tried(attempt, failed=lambda error: failed.append(str(error)))) == "open"
    assert failed == ["away", "busy"]


def test_any_other_error_comes_out() -> None:
    def attempt() -> str:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        opened_again(tried(attempt))


def test_it_is_tried_twice_a_second_and_no_look_waits_long() -> None:
    now, tries, waits = 100.0, [], []

    def attempt() -> str:
        tries.append(round(now, 3))
        if len(tries) < 3:
            raise OSError
        return "open"

    def sleep(seconds: float) -> None:
        nonlocal now
        waits.append(seconds)
        now += seconds

    again = Reopening(attempt, print, (OSError,), sleep, after_s=2.0, clock=lambda: now)
    assert opened_again(again) == "open"
    assert tries == [102.0, 102.5, 103.0] and max(waits) <= LOOK_S


def test_what_was_opened_too_late_is_closed() -> None:
    slow, begun = Slow(), threading.Event()

    def attempt() -> str:
        begun.set()
        return slow()

    again = Reopening(attempt, lambda opened: slow.closed.set(), (OSError,), lambda seconds: None)
    assert again.look() is None and begun.wait(60)
    again.abandon()
    assert not slow.closed.is_set()
    slow.let.set()
    assert slow.closed.wait(60)


def test_a_close_that_blocks_is_left_to_its_thread() -> None:
    go = threading.Event()
    thread = close_within(0.0, lambda: go.wait(60))
    assert thread.is_alive()
    go.set()
    thread.join(60)
    assert not thread.is_alive()
