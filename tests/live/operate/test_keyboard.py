"""The operator's keys: one line, one order."""

from __future__ import annotations

import io
from typing import Any

import pytest

from acquire.events import EventKind
from live.operate import FORCED, UNDO, carry_out, listen
from live.tell import Screen


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class FakeLive:
    """Notes what it is asked."""

    def __init__(self) -> None:
        self.calls: list[Any] = []
        self.paused = False

    def stop(self, reason: str) -> None:
        self.calls.append(("stop", reason))

    def command(self, kind: EventKind, note: str = "") -> None:
        self.paused = kind is EventKind.PAUSE
        self.calls.append((kind, note))


@pytest.mark.parametrize(
    ("typed", "call"),
    [
        ("r\n", (EventKind.NEW_REFERENCE, "")),
        ("t", (EventKind.TARE, "")),
        ("t!", (EventKind.TARE, FORCED)),
        ("u", (EventKind.TARE, UNDO)),
        ("p", (EventKind.PAUSE, "")),
        ("n slipped in the grip", (EventKind.NOTE, "slipped in the grip")),
        ("q", ("stop", "ended by the operator")),
    ],
)
def test_the_keys(typed: str, call: tuple[Any, str]) -> None:
    live = FakeLive()
    assert carry_out(typed, live)
    assert live.calls == [call]


def test_a_second_p_goes_on() -> None:
    live = FakeLive()
    for _ in range(3):
        carry_out("p", live)
    assert [call[0] for call in live.calls] == [EventKind.PAUSE, EventKind.RESUME, EventKind.PAUSE]


def test_what_nobody_knows_is_answered_with_the_keys() -> None:
    live, screen = FakeLive(), io.StringIO()
    assert carry_out("", live)
    assert not carry_out("x", live)
    thread = listen(live, Terminal("x\nn\n"), Screen(screen))
    assert thread is not None
    thread.join(5)
    assert live.calls == []
    assert screen.getvalue().count("keys (with Enter)") == 3


def test_only_a_terminal_is_listened_to() -> None:
    assert listen(FakeLive(), io.StringIO("q\n"), Screen(io.StringIO())) is None
    assert listen(FakeLive(), None, Screen(io.StringIO())) is None
    live = FakeLive()
    thread = listen(live, Terminal("q\n"), Screen(io.StringIO()))
    assert thread is not None
    thread.join(5)
    assert live.calls == [("stop", "ended by the operator")]
