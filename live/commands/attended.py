"""A live test under the eyes of an operator: signals, keyboard, remote commands, and the page in the browser.

A terminal gives each key at once and without echo by termios, on Windows by msvcrt; else commands are whole lines.
"""

from __future__ import annotations

import codecs
import contextlib
import math
import os
import select
import sys
import tempfile
import threading
import time
import webbrowser
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TextIO

from acquire.clock import Clock
from acquire.text import Message
from live.commands.process import signals
from live.config.loading import Config
from live.pipeline.consumer import Screen
from live.run.control import ENDED, ControlPort, Controls, answer
from live.run.live_run import LiveRun
from live.run.outcome import INTERRUPTED, StopSignal
from live.ui.rerun.view import has_display

if TYPE_CHECKING:
    from live.ui.web.page_controller import PageController

HELP = (
    "keys: r new reference, t tare (T whatever the load does, u undo it), p pause/go on, s start recording,"
    " n note, a alarm off, : any command, qq quit, ? the commands"
)
LINES_HELP = (
    "keys (with Enter): r new reference, t tare (t! whatever the load does, u undo it), p pause/go on,"
    " s start recording, n TEXT note, a alarm off, q quit; or the words: ? lists them"
)
SINGLE_KEYS = {"r": "r", "t": "t", "T": "t!", "u": "u", "p": "p", "s": "s", "a": "a", "?": "?"}
QUIT_AGAIN_S = 3.0
"""The second q must come within this time: one key alone ends no test."""
ENTER, BACKSPACE, ESCAPE = ("\r", "\n"), ("\x7f", "\b"), "\x1b"
_POLL_S = 0.5


class Terminal(Protocol):
    """Where single keys come from."""

    def set_single_keys(self) -> bool:
        """Set it to single keys, where it is not; whether it is then."""
        ...

    def read(self, seconds: float) -> bytes | None:
        """What is typed within ``seconds`` (UTF-8); None where nothing is, ``b""`` at the end of the terminal."""
        ...

    def restore(self) -> None:
        """Set it as it was before."""
        ...


if sys.platform == "win32":
    import msvcrt

    _CONSOLE_POLL_S = 0.02
    _PREFIXES = ("\x00", "\xe0")  # of a key without a letter

    class _Console:
        """The console of Windows, which always gives single keys this way."""

        def set_single_keys(self) -> bool:
            return True

        def read(self, seconds: float) -> bytes | None:
            until = time.monotonic() + seconds
            while not msvcrt.kbhit():
                if time.monotonic() >= until:
                    return None
                time.sleep(_CONSOLE_POLL_S)
            key = msvcrt.getwch()
            if key in _PREFIXES:
                msvcrt.getwch()
                return None
            return key.encode()

        def restore(self) -> None: ...

    def terminal_of(stream: TextIO) -> Terminal | None:
        """The terminal of ``stream``, set to single keys; None where that is not possible."""
        return _Console() if stream.isatty() else None

else:

    class _PosixTerminal:
        """A terminal while the program is in the foreground.

        A shell that stopped the program (Ctrl-Z) changes the terminal and leaves it so when the program
        continues: it is set again. In the background the terminal is not changed: that would stop the program.
        """

        def __init__(self, descriptor: int, before: Any) -> None:
            self._descriptor, self._before = descriptor, before

        def set_single_keys(self) -> bool:
            import termios
            import tty

            if not self._in_foreground:
                return False
            try:
                if termios.tcgetattr(self._descriptor)[tty.LFLAG] & termios.ICANON:
                    tty.setcbreak(self._descriptor, termios.TCSADRAIN)
            except (OSError, ValueError, termios.error):
                return False
            return True

        def read(self, seconds: float) -> bytes | None:
            if select.select([self._descriptor], [], [], seconds)[0] and self._in_foreground:
                return os.read(self._descriptor, 256)
            return None

        def restore(self) -> None:
            import termios

            if self._in_foreground:
                with contextlib.suppress(OSError, ValueError, termios.error):
                    termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._before)

        @property
        def _in_foreground(self) -> bool:
            try:
                return os.tcgetpgrp(self._descriptor) == os.getpgrp()
            except OSError:
                return False

    def terminal_of(stream: TextIO) -> Terminal | None:
        """The terminal of ``stream``, set to single keys; None where that is not possible."""
        try:
            import termios
        except ImportError:  # a system without
            return None
        try:
            terminal = _PosixTerminal(stream.fileno(), termios.tcgetattr(stream.fileno()))
        except (OSError, ValueError, termios.error):
            return None
        return terminal if terminal.set_single_keys() else None


class Keys:
    """Reads typed letters: single keys are commands, ``n`` and ``:`` begin a line that is typed first.

    Parameters
    ----------
    controls : Controls
    screen : Screen
        Shows a line while it is typed, and answers other than ``ok``.
    clock : callable giving seconds
    """

    def __init__(self, controls: Controls, screen: Screen, clock: Clock = time.monotonic) -> None:
        self._controls, self._screen, self._clock = controls, screen, clock
        self._line: str | None = None
        self._quit_t = -math.inf

    def type(self, text: str) -> None:
        """Take typed letters; a text that begins with an escape is a key without a letter."""
        if text.startswith(ESCAPE) and len(text) > 1:
            return
        for letter in text:
            if self._line is None:
                self._press(letter)
            else:
                self._edit(letter)

    def _press(self, letter: str) -> None:
        if letter in SINGLE_KEYS:
            self._command(SINGLE_KEYS[letter])
        elif letter == "n":
            self._show("note ")
        elif letter == ":":
            self._show("")
        elif letter == "q":
            self._quit()
        elif letter not in ENTER:
            self._screen.print(HELP)

    def _edit(self, letter: str) -> None:
        line = self._line or ""
        if letter in ENTER:
            self._show(None)
            if line.strip() not in ("", "note"):
                self._command(line)
        elif letter == ESCAPE:
            self._show(None)
        elif letter in BACKSPACE:
            self._show(line[:-1])
        elif letter.isprintable():
            self._show(line + letter)

    def _show(self, line: str | None) -> None:
        self._line = line
        self._screen.prompt(None if line is None else f": {line}_")

    def _command(self, line: str) -> None:
        if (text := answer(line, self._controls)) != "ok":
            self._screen.print(text)

    def _quit(self) -> None:
        before, self._quit_t = self._quit_t, self._clock()
        if self._quit_t - before <= QUIT_AGAIN_S:
            self._controls.stop(ENDED)
        else:
            self._screen.print(Message("q again within {seconds:g} s ends the test", QUIT_AGAIN_S))


class Keyboard:
    """Reads the keyboard in its own thread, from ``start`` to ``close``."""

    def __init__(self, controls: Controls, stream: TextIO, screen: Screen) -> None:
        self._controls, self._stream, self._screen = controls, stream, screen
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._work, name="keyboard", daemon=True)
        self._terminal = terminal_of(stream)

    def start(self) -> None:
        """Show the keys, and begin to read."""
        self._screen.print(HELP if self._terminal else LINES_HELP)
        self._thread.start()

    def join(self, seconds: float) -> None:
        """Wait until the stream has ended."""
        self._thread.join(seconds)

    def close(self) -> None:
        """Stop reading, and restore the terminal."""
        self._closed.set()
        if self._terminal is not None:
            self._thread.join(2 * _POLL_S)
            self._terminal.restore()

    def _work(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            if self._terminal is None:
                for text in self._stream:
                    if text.strip() and (reply := answer(text, self._controls)) != "ok":
                        self._screen.print(reply)
            else:
                self._take_keys(self._terminal)

    def _take_keys(self, terminal: Terminal) -> None:
        keys = Keys(self._controls, self._screen)
        for text in self._typed(terminal):
            keys.type(text)

    def _typed(self, terminal: Terminal) -> Iterator[str]:
        decoder = codecs.getincrementaldecoder("utf-8")("replace")
        while not self._closed.is_set():
            if not terminal.set_single_keys():
                self._closed.wait(_POLL_S)  # another program has the terminal
            elif (data := terminal.read(_POLL_S)) is not None:
                if not data:
                    return
                yield decoder.decode(data)


def listen(controls: Controls, stream: TextIO | None, screen: Screen) -> Keyboard | None:
    """Read commands from ``stream``, where it is a terminal."""
    if stream is None or stream.closed or not stream.isatty():
        return None
    keyboard = Keyboard(controls, stream, screen)
    keyboard.start()
    return keyboard


@contextlib.contextmanager
def attended(config: Config, screen: Screen, stop: StopSignal) -> Iterator[Callable[[LiveRun], None]]:
    """Signals end a test by ``stop``; what is yielded attaches keyboard and remote commands to one that has begun."""
    ports = config.operate
    with contextlib.ExitStack() as stack:
        port = ControlPort(ports.orders, ports.token_file, screen) if ports.orders else None

        def attach(live: LiveRun) -> None:
            keyboard = listen(live, sys.stdin, screen)
            if keyboard is not None:
                stack.callback(keyboard.close)
            if port is not None:
                port.open(live, live.folder)

        if port is not None:
            stack.callback(port.close)
        stack.enter_context(signals(lambda: stop.request(INTERRUPTED), screen))
        yield attach


@contextlib.contextmanager
def page_opened(controller: PageController, screen: Screen) -> Iterator[None]:
    """Print the address of the page and open it if there is a display, by a file of this user alone that leads there.

    The address has the token, and every user can read the command line of a browser, which may stay in the foreground.
    """
    with tempfile.TemporaryDirectory(prefix="phasedic-", ignore_cleanup_errors=True) as folder:
        if has_display():
            way = Path(folder, "page.html")
            way.touch(0o600)
            way.write_text(
                f'<meta http-equiv="refresh" content="0; url={controller.address}">', encoding="ascii"
            )
            threading.Thread(target=_open, args=(way.as_uri(), screen), name="browser", daemon=True).start()
        screen.print(Message("the page: {address}", controller.address))
        yield


def _open(address: str, screen: Screen) -> None:
    with contextlib.suppress(webbrowser.Error):
        if webbrowser.open(address):
            return
    screen.print(Message("no browser opens here; open the address of the page in yours"))
