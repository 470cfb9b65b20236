"""Opening again in a thread: until it works, or until nobody waits any more."""

from __future__ import annotations

import threading

import pytest

from acquire import opening_thread
from acquire.opening_thread import open_again


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening_thread, "RETRY_S", 0.0)


def test_it_is_tried_until_it_works() -> None:
    failures, stopped = iter((OSError("away"), OSError("busy"))), threading.Event()
    failed: list[str] = []

    def attempt() -> str:
        for error in failures:
            raise error
        return "open"

    opened = open_again(attempt, print, stopped, (OSError,), lambda error: failed.append(str(error)))
    assert opened == "open"
    assert failed == ["away", "busy"]


def test_any_other_error_comes_out() -> None:
    def attempt() -> str:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        open_again(attempt, print, threading.Event(), (OSError,))


def test_it_ends_between_two_attempts() -> None:
    stopped = threading.Event()

    def attempt() -> str:
        stopped.set()
        raise OSError

    assert open_again(attempt, print, stopped, (OSError,)) is None


def test_it_ends_during_an_attempt_and_what_was_opened_too_late_is_closed() -> None:
    go, stopped, closed = threading.Event(), threading.Event(), threading.Event()

    def attempt() -> str:
        stopped.set()
        go.wait(60)
        return "open"

    assert open_again(attempt, lambda opened: closed.set(), stopped, (OSError,)) is None
    assert not closed.is_set()
    go.set()
    assert closed.wait(60)
