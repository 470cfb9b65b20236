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
from typing import Any

from acquire.events import EventKind
from live.run.control import ENDED, FORCED, UNDO
from live.run.keyboard import Keys, listen
from live.ui.terminal.screen import TerminalScreen
from tests.live.run.test_control import FakeLive
from tests.live.ui.waiting import LONG_S


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


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
    live = FakeLive()
    thread = listen(live, Terminal("q\n"), TerminalScreen(io.StringIO()))
    assert thread is not None
    thread.join(LONG_S)
    assert live.calls == [("stop", ENDED)]


class Typed:
    """Keys on made-up time, and what the screen then shows."""

    def __init__(self) -> None:
        self.live, self.now, self.stream = FakeLive(), 0.0, io.StringIO()
        self.keys = Keys(self.live, TerminalScreen(self.stream), lambda: self.now)

    def type(self, *texts: str) -> list[Any]:
        for text in texts:
            self.keys.type(text)
        return self.live.calls


def test_single_keys_are_orders_at_once() -> None:
    calls = Typed().type("rp", "T")
    assert calls == [(EventKind.NEW_REFERENCE, ""), (EventKind.PAUSE, ""), (EventKind.TARE, FORCED)]


def test_a_note_is_typed_to_its_end_and_no_key_in_it_is_an_order() -> None:
    typed = Typed()
    assert typed.type("n", "a qx", "\x7f", "\n") == [(EventKind.NOTE, "a q")]
    assert typed.type("n", "half a word", "\x1b", "n", "\r") == [(EventKind.NOTE, "a q")]
    assert typed.type(":", "tare  undo", "\r")[1:] == [(EventKind.TARE, UNDO)]


def test_a_note_without_words_is_none() -> None:
    typed = Typed()
    assert typed.type("n", "\r", "n", "  ", "\n", ":", "\n") == []
    assert "no" not in typed.stream.getvalue().replace("note", "")


def test_one_q_alone_ends_no_test() -> None:
    typed = Typed()
    assert typed.type("q") == [] and "q again" in typed.stream.getvalue()
    typed.now = 3.5
    assert typed.type("q") == []
    typed.now = 5.0
    assert typed.type("q") == [("stop", ENDED)]


def test_other_keys_are_answered_with_the_keys_and_arrows_with_nothing() -> None:
    typed = Typed()
    typed.type("\x1b[A", "\n")
    assert typed.stream.getvalue() == ""
    typed.type("x")
    assert typed.stream.getvalue().startswith("keys: ")


def test_a_true_terminal_gives_single_keys_and_is_put_back_as_it_was() -> None:
    """In its own process, since a terminal has one foreground process."""
    program = (
        "import sys, termios; from live.run.keyboard import listen; from live.ui.terminal.screen import TerminalScreen;"
        "from tests.live.run.test_control import FakeLive; live = FakeLive();"
        "before = termios.tcgetattr(0); k = listen(live, sys.stdin, TerminalScreen());"
        "during = termios.tcgetattr(0)\n"
        "import time\n"
        "while not live.calls: time.sleep(0.01)\n"
        "k.close()\n"
        "print('CALLS', live.calls[0][0], bool(during[3] & termios.ICANON), termios.tcgetattr(0) == before)"
    )
    child, master = pty.fork()
    if child == 0:
        os.execv(sys.executable, [sys.executable, "-c", program])
    got, until = b"", time.monotonic() + LONG_S
    sent = False
    while b"CALLS" not in got or not got.endswith(b"\n"):
        assert time.monotonic() < until, got
        if not select.select([master], [], [], 0.2)[0]:
            continue
        try:
            got += os.read(master, 4096)
        except OSError:
            break
        if b"keys: " in got and not sent:
            sent = True
            os.write(master, b"r")
    os.waitpid(child, 0)
    os.close(master)
    assert b"CALLS new-reference False True" in got


def test_a_terminal_gives_single_keys_again_after_ctrl_z() -> None:
    """The test is the shell: stops the program, has lines itself, and lets it go on."""
    program = (
        "import sys, time; from live.run.keyboard import listen; from live.ui.terminal.screen import TerminalScreen;"
        "from tests.live.run.test_control import FakeLive; live = FakeLive();"
        "k = listen(live, sys.stdin, TerminalScreen())\n"
        "while not live.calls: time.sleep(0.01)\n"
        "k.close()\n"
        "print('CALLS', live.calls[0][0])"
    )
    child, master = pty.fork()
    if child == 0:
        os.execv(sys.executable, [sys.executable, "-c", program])
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
