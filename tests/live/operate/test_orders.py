"""One grammar of orders, whoever gives them: a line, an answer in a line."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.events import EventKind
from live.operate import ENDED, FORCED, START, STOP, UNDO, OrderRefused, answer


class FakeLive:
    """Notes what it is asked; refuses what ``refuses`` says."""

    def __init__(self, refuses: str = "", says: str = "") -> None:
        self.calls: list[Any] = []
        self.paused, self.recording = False, True
        self._refuses, self._says = refuses, says

    def stop(self, reason: str) -> None:
        self.calls.append(("stop", reason))

    def command(self, kind: EventKind, note: str = "") -> str:
        if self._refuses:
            raise OrderRefused(self._refuses)
        self.paused = kind is EventKind.PAUSE
        self.calls.append((kind, note))
        return self._says


@pytest.mark.parametrize(
    ("lines", "call"),
    [
        (("start", "s"), (EventKind.RECORD, START)),
        (("stop",), (EventKind.RECORD, STOP)),
        (("reference", "r\n", " r "), (EventKind.NEW_REFERENCE, "")),
        (("tare", "t"), (EventKind.TARE, "")),
        (("tare  force", "t!", "t force"), (EventKind.TARE, FORCED)),
        (("tare undo", "u"), (EventKind.TARE, UNDO)),
        (("pause", "p"), (EventKind.PAUSE, "")),
        (("resume",), (EventKind.RESUME, "")),
        (("note slipped in the grip", "n slipped in the grip\r\n"), (EventKind.NOTE, "slipped in the grip")),
        (("alarm off", "a"), (EventKind.ALARM, "")),
        (("quit", "q"), ("stop", ENDED)),
    ],
)
def test_words_and_their_letters(lines: tuple[str, ...], call: tuple[Any, str]) -> None:
    for line in lines:
        live = FakeLive()
        assert answer(line, live) == "ok"
        assert live.calls == [call]


def test_a_second_p_goes_on() -> None:
    live = FakeLive()
    for _ in range(3):
        answer("p", live)
    assert [call[0] for call in live.calls] == [EventKind.PAUSE, EventKind.RESUME, EventKind.PAUSE]


@pytest.mark.parametrize(
    "line", ["", "\n", "x", "n", "note", "stop it", "quit now", "alarm", "tare twice", "n" * 501]
)
def test_what_is_no_order_is_refused_with_a_reason(line: str) -> None:
    live = FakeLive()
    assert answer(line, live).startswith("no: ")
    assert live.calls == []


def test_whoever_carries_it_out_may_refuse_or_say_more() -> None:
    assert answer("tare", FakeLive(refuses="800 N in\nmid-test")) == "no: 800 N in mid-test"
    assert answer("stop", FakeLive(says="120 frames")) == "ok: 120 frames"


def test_help_lists_the_orders() -> None:
    said = answer("?", FakeLive())
    assert said.startswith("ok: ") and "alarm off" in said and said == answer("help", FakeLive())


@given(st.text())
def test_whatever_comes_is_answered_in_one_printable_line(line: str) -> None:
    said = answer(line, FakeLive())
    assert said.startswith(("ok", "no: ")) and said.splitlines() == [said]


def test_a_note_cannot_command_a_terminal() -> None:
    live = FakeLive()
    answer("note \x1b[2Jgone", live)
    assert live.calls == [(EventKind.NOTE, "\\x1b[2Jgone")]
