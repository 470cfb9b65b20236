"""The keys of the operator: each is a command, and a refusal is shown."""

from __future__ import annotations

import io
import os
import pty
import select
import signal
import sys
import termios
import time
from types import SimpleNamespace
from typing import Any

import pytest

from acquire.events import EventKind
from live.commands.attended import HELP, LINES_HELP, Keyboard, Keys, listen
from live.run.control import ENDED, UNDO
from live.ui.terminal.screen import TerminalScreen
from tests.live.run.test_control import FakeLive
from tests.live.screens import Terminal
from tests.live.ui.waiting import LONG_S


def test_what_nobody_knows_is_answered_with_the_orders() -> None:
    live, screen = FakeLive(), io.StringIO()
    thread = listen(live, Terminal("\nx\nn\n?\n"), TerminalScreen(screen))
    assert thread is not None
    thread.join(LONG_S)
    assert live.calls == []
    lines = screen.getvalue().splitlines()
    assert lines[0].startswith("keys (with Enter)")
    assert [line.partition(":")[0] for line in lines[1:]] == ["no", "no", "ok"]


def test_only_a_terminal_is_listened_to() -> None:
    assert listen(FakeLive(), io.StringIO("q\n"), TerminalScreen(io.StringIO())) is None
    assert listen(FakeLive(), None, TerminalScreen(io.StringIO())) is None


class Typed:
    """Keys on made-up time, and what the screen then shows."""

    def __init__(self) -> None:
        self.live, self.now, self.stream = FakeLive(), 0.0, io.StringIO()
        self.keys = Keys(self.live, TerminalScreen(self.stream), lambda: self.now)

    def type(self, *texts: str) -> list[Any]:
        for text in texts:
            self.keys.type(text)
        return self.live.calls


def test_a_note_is_typed_to_its_end_and_no_key_in_it_is_an_order() -> None:
    typed = Typed()
    assert typed.type("n", "a qx", "\x7f", "\n") == [(EventKind.NOTE, "a q")]
    assert typed.type("n", "half a word", "\x1b", "n", "\r") == [(EventKind.NOTE, "a q")]
    assert typed.type(":", "tare  undo", "\r")[1:] == [(EventKind.TARE, UNDO)]


def test_a_note_without_words_is_none() -> None:
    typed = Typed()
    assert typed.type("n", "\r", "n", "  ", "\n", ":", "\n") == []
    assert "no" not in typed.stream.getvalue().replace("note", "")


def test_other_keys_are_answered_with_the_keys_and_arrows_with_nothing() -> None:
    typed = Typed()
    typed.type("\x1b[A", "\n")
    assert typed.stream.getvalue() == ""
    typed.type("x")
    assert typed.stream.getvalue().startswith("keys: ")


PROGRAM = """
import sys, termios, time
from live.commands.attended import listen
from live.ui.terminal.screen import TerminalScreen
from tests.live.run.test_control import FakeLive
live, before = FakeLive(), termios.tcgetattr(0)
keys = listen(live, sys.stdin, TerminalScreen())
during = termios.tcgetattr(0)
while not live.calls: time.sleep(0.01)
keys.close()
print("CALLS", live.calls[0][0], bool(during[3] & termios.ICANON), termios.tcgetattr(0) == before)
"""


def in_a_terminal() -> tuple[int, int]:
    """The program in its own process, since a terminal has one foreground process; and the terminal."""
    child, master = pty.fork()
    if child == 0:
        os.execv(sys.executable, [sys.executable, "-c", PROGRAM])
    return child, master


def test_a_true_terminal_gives_single_keys_and_is_put_back_as_it_was() -> None:
    child, master = in_a_terminal()
    wait_for(master, b"keys: ")
    os.write(master, b"r")
    wait_for(master, b"CALLS new-reference False True")
    os.waitpid(child, 0)
    os.close(master)


def test_a_terminal_gives_single_keys_again_after_ctrl_z() -> None:
    """The test is the shell: stops the program, has lines itself, and lets it go on."""
    child, master = in_a_terminal()
    lines = termios.tcgetattr(master)
    wait_for(master, b"keys: ")
    assert not has_lines(master)
    os.kill(child, signal.SIGSTOP)
    os.waitpid(child, os.WUNTRACED)
    termios.tcsetattr(master, termios.TCSANOW, lines)
    os.kill(child, signal.SIGCONT)
    until = time.monotonic() + LONG_S
    while has_lines(master):
        assert time.monotonic() < until
        time.sleep(0.02)
    os.write(master, b"r")
    wait_for(master, b"CALLS new-reference")
    os.waitpid(child, 0)
    os.close(master)


def has_lines(master: int) -> bool:
    """Whether a terminal waits for Enter."""
    return bool(termios.tcgetattr(master)[3] & termios.ICANON)


def wait_for(master: int, words: bytes) -> None:
    """Wait for the output ``words``."""
    got, until = b"", time.monotonic() + LONG_S
    while words not in got:
        assert time.monotonic() < until, got
        if select.select([master], [], [], 0.2)[0]:
            got += os.read(master, 4096)


class FakeTerminal:
    """Gives these texts; for None another program has the terminal, or nothing is typed."""

    def __init__(self, *texts: bytes | None) -> None:
        self.texts, self.restored = list(texts), 0

    def set_single_keys(self) -> bool:
        return bool(self.texts) and (self.texts[0] is not None or bool(self.texts.pop(0)))

    def read(self, seconds: float) -> bytes | None:
        assert seconds == 0.5
        return self.texts.pop(0)

    def restore(self) -> None:
        self.restored += 1


def keyboard(monkeypatch: pytest.MonkeyPatch, terminal: FakeTerminal | None, lines: str = "") -> Any:
    monkeypatch.setattr("live.commands.attended.terminal_of", lambda stream: terminal)
    live, printed = FakeLive(), list[str]()
    screen: Any = SimpleNamespace(print=printed.append, prompt=lambda text: None)
    return SimpleNamespace(board=Keyboard(live, io.StringIO(lines), screen), live=live, printed=printed)


def test_keys_are_decoded_across_readings_until_the_terminal_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = FakeTerminal(b"r", b"n\xc3", b"\xa9\r", b"")
    bench = keyboard(monkeypatch, terminal)
    bench.board.start()
    bench.board.join(LONG_S)
    assert bench.live.calls == [(EventKind.NEW_REFERENCE, ""), (EventKind.NOTE, "é")]
    assert bench.printed == [HELP]
    bench.board.close()
    assert terminal.restored == 1


def test_a_keyboard_that_is_closed_takes_no_key(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = keyboard(monkeypatch, FakeTerminal(b"r"))
    bench.board._closed.set()
    bench.board._work()
    assert bench.live.calls == []


def test_without_single_keys_lines_are_taken_and_answers_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = keyboard(monkeypatch, None, "\n r \nhello\nq\n")
    bench.board.start()
    bench.board.join(LONG_S)
    assert bench.live.calls == [(EventKind.NEW_REFERENCE, ""), ("stop", ENDED)]
    assert bench.printed[0] == LINES_HELP and len(bench.printed) == 2
    assert bench.printed[1].startswith("no: 'hello' is no command")
    bench.board.close()


@pytest.mark.parametrize(("after_s", "ends"), [(3.0, True), (3.01, False)])
def test_the_second_q_comes_within_three_seconds(after_s: float, ends: bool) -> None:
    typed = Typed()
    assert typed.type("q") == [] and "q again" in typed.stream.getvalue()
    typed.now = after_s
    assert typed.type("q") == [("stop", ENDED)] * ends


def test_each_key_is_its_command() -> None:
    keys = {
        "r": (EventKind.NEW_REFERENCE, ""), "t": (EventKind.TARE, ""), "T": (EventKind.TARE, "force"),
        "u": (EventKind.TARE, "undo"), "p": (EventKind.PAUSE, ""), "s": (EventKind.RECORD, "start"),
        "a": (EventKind.ALARM, ""),
    }  # fmt: skip
    for key, call in keys.items():
        typed = Typed()
        assert typed.type(key) == [call] and typed.stream.getvalue() == ""
    assert Typed().type("rp", "T") == [keys["r"], keys["p"], keys["T"]]
    typed = Typed()
    typed.type("?")
    assert typed.stream.getvalue().startswith("ok: start, stop, reference")


def test_a_line_that_is_typed_is_shown_and_has_no_letters_that_cannot_be() -> None:
    typed, shown = Typed(), list[str | None]()
    typed.keys._screen.prompt = shown.append  # type: ignore[method-assign]
    typed.type("n", "ab", "\x7f", "\x07", "\x1b")
    assert shown == [": note _", ": note a_", ": note ab_", ": note a_", None]
    typed.type("\x1b")
    assert typed.live.calls == []
