"""Screen, ledger, journal and numbers in words."""

from __future__ import annotations

import dataclasses
import io
import math
from typing import Any

import pytest

from acquire.events import Event, EventKind
from live.measure import Instant
from live.tell.figures import quantity
from live.tell.journal import Journal, sentence
from live.tell.ledger import Ledger
from live.tell.screen import Screen


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class Gone(Terminal):
    def write(self, text: str) -> int:
        raise OSError(5, "Input/output error")


def test_the_status_line_is_renewed_in_place_and_not_too_often() -> None:
    now = [0.0]
    stream = Terminal()
    screen = Screen(stream, now=lambda: now[0])
    screen.status("one long line")
    screen.status("too early")
    now[0] = 1.0
    screen.status("two")
    screen.say("stays")
    assert stream.getvalue() == "one long line\rtwo          \r   \rstays\n"


def test_the_progress_of_a_replay_is_one_line() -> None:
    stream = io.StringIO()
    now = iter(range(0, 100, 10))
    screen = Screen(stream, now=lambda: next(now))
    screen.progress(instant(), 5, 20, 2.5)
    screen.progress(instant(), 5, None, 0.0)
    screen.progress(instant(), 21, 20, 2.5)
    screen.progress(instant(), 1, 100_000, 1.0)
    assert stream.getvalue().splitlines() == [
        "5 of 20 bursts  7.0 N  exx +100  eyy -200  exy +0 um/m  8/10 ZOIs  20 ZOI/s  0:08 left",
        "5 bursts  7.0 N  exx +100  eyy -200  exy +0 um/m  8/10 ZOIs",
        "21 bursts  7.0 N  exx +100  eyy -200  exy +0 um/m  8/10 ZOIs  84 ZOI/s",
        "1 of 100000 bursts  7.0 N  exx +100  eyy -200  exy +0 um/m  8/10 ZOIs  10 ZOI/s  27:46:39 left",
    ]


def instant() -> Instant:
    numbers = {f.name: 0.0 for f in dataclasses.fields(Instant) if f.default is dataclasses.MISSING}
    told: Any = {**numbers, "force": 7.0, "exx": 1e-4, "eyy": -2e-4, "n_valid": 8, "n_zoi": 10}
    return Instant(**told)


def test_an_address_is_told_once_and_without_its_settings() -> None:
    long = "sim:woven?bits=12&fps=60&note=a:b"
    for text in ("the stream stalls: 1.5 s", f"{long}: the stream stalls: 1.5 s"):
        event = Event(1.0, EventKind.DEVICE, long, text)
        assert sentence(event) == "sim:woven: the stream stalls: 1.5 s"
    assert sentence(Event(1.0, EventKind.NOTE, "operator", "is x?a=b right")) == "operator: is x?a=b right"


def test_a_lost_terminal_does_not_matter() -> None:
    screen = Screen(Gone())
    screen.say("nobody reads this")
    screen.say("nor this")


def test_the_ledger_tells_when_it_does_not_add_up() -> None:
    ledger = Ledger()
    ledger.add(grabbed=10, measured=6, skipped=2, reference=1, left_out=1, recorded=10)
    assert ledger.adds_up
    assert not ledger.loss
    ledger.add(grabbed=1)
    assert not ledger.adds_up
    assert "DOES NOT ADD UP" in ledger.line()
    ledger.add(left_out=1, unrecorded=1)
    assert ledger.adds_up
    assert ledger.loss


def test_late_listeners_hear_everything_once() -> None:
    journal, heard = Journal(), []
    journal(Event(1.0, EventKind.DEVICE, "a", "first"))
    journal.add_listener(heard.append)
    journal(Event(2.0, EventKind.LOST, "a", "second", "warning"))
    assert [event.text for event in heard] == ["first", "second"]
    assert [event.text for event in journal.events("warning")] == ["second"]


@pytest.mark.parametrize(
    ("value", "sigma", "says"),
    [
        (70.123456, 0.0234, "70.123 +- 0.023 GPa"),
        (70.1, math.nan, "70.1 GPa"),
        (math.nan, 1.0, "not known"),
        (123456.0, 1200.0, "123456 +- 1200 GPa"),
    ],
)
def test_quantities_have_the_digits_they_deserve(value: float, sigma: float, says: str) -> None:
    assert quantity(value, sigma, "GPa") == says
