"""Prints messages, and one status line that is renewed in place on a terminal.

A terminal that was closed must not end a recording: what cannot be printed is dropped. Text from a file or a
device may contain control characters; they are escaped.

The terminal of a test with several cameras: lines with the name of their camera, and one status line of all.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, TextIO

from acquire.text import Amount, Message, about, counts, joined
from acquire.text.message import duration, printable, share_text
from acquire.text.quantity import IN_ASCII
from live.pipeline.consumer import Screen
from live.ui.terminal.status_line import GAP, cameras_line, force_text, gauge_texts, status_line
from live.words.language import told

if TYPE_CHECKING:
    from live.pipeline.measurement import TimeStep
    from live.pipeline.run_state import RunState
    from live.pipeline.snapshot import Snapshot

_TERMINAL_EVERY_S, _FILE_EVERY_S = 0.25, 5.0
_UNKNOWN_WIDTH, _FILE_WIDTH = 119, 1000


def print_line(text: str = "") -> None:
    """Print a line on standard output, control characters escaped; for commands without a status line."""
    TerminalScreen().print(text)


class TerminalScreen(Screen):
    """Prints to ``stream``; the status line at most four times a second (a log: every 5 s)."""

    def __init__(
        self, stream: TextIO | None = None, now: Callable[[], float] = time.monotonic, quiet: bool = False
    ) -> None:
        self._stream = stream or sys.stdout
        self._now, self._quiet = now, quiet
        self._terminal = self._stream.isatty()
        self._every = _TERMINAL_EVERY_S if self._terminal else _FILE_EVERY_S
        self._last = -math.inf
        self._width = 0
        self._prompt: str | None = None

    def print(self, text: str = "") -> None:
        """Print a line that stays."""
        if not self._quiet:
            self._write(" " * self._width + "\r" * (self._width > 0) + told(printable(text)) + "\n")
            self._width = 0
            if self._prompt is not None:
                self._renew(self._prompt)

    def bell(self) -> None:
        """Ring the bell of a terminal."""
        if self._terminal and not self._quiet:
            self._write("\a")

    @property
    def is_due(self) -> bool:
        """Whether the status line may be renewed by now."""
        return not self._quiet and self._prompt is None and self._now() - self._last >= self._every

    @property
    def width(self) -> int:
        """Letters of the status line; many in a log."""
        return self._columns() if self._terminal else _FILE_WIDTH

    def status(self, text: str) -> None:
        """Renew the status line, in place on a terminal."""
        if not self.is_due:
            return
        self._last = self._now()
        if self._terminal:
            self._renew(text)
        else:
            self._write(told(printable(text)) + "\n")

    def _renew(self, text: str) -> None:
        """Renew the last line, cut to the width of the terminal: a line that wraps cannot be renewed."""
        text = told(printable(text))[: self._columns()]
        self._write(text.ljust(self._width) + "\r")
        self._width = len(text)

    def _columns(self) -> int:
        """Usable columns: a character in the last column may wrap."""
        try:
            return os.get_terminal_size(self._stream.fileno()).columns - 1
        except (OSError, ValueError):
            return _UNKNOWN_WIDTH

    def snapshot(self, snapshot: Snapshot, words: str = "") -> None:
        """Renew the status line of a live run; ``words`` name what it waits for."""
        self.status(status_line(snapshot, self.width, words))

    def prompt(self, text: str | None) -> None:
        """Show what the operator types in place of the status line; None ends that."""
        self._prompt = text
        if self._terminal and not self._quiet:
            self._renew(text or "")

    def progress(self, i: TimeStep, done: int, expected: int | None, elapsed_s: float) -> None:
        """Renew the status line of a replay: ``done`` of ``expected`` bursts, ZOI/s, remaining time."""
        bursts, left, rate = Message("{done} bursts", *counts(done)), "", ""
        if expected is not None and done <= expected:
            bursts = Message("{done} of {expected} bursts", *counts(done, expected))
            left = Message("{time} left", duration(elapsed_s / done * (expected - done)))
        if elapsed_s > 0:
            rate = Message("{rate} ZOI/s", Amount("count", done * i.n_zoi / elapsed_s))
        valid = Message("{valid}/{zois} ZOIs", *counts(i.n_valid, i.n_zoi))
        strains = (*gauge_texts(i), share_text(i.area_share))
        self.status(joined(GAP, (bursts, force_text(i.force), *strains, valid, rate, left)))

    def _write(self, text: str) -> None:
        encoding = getattr(self._stream, "encoding", None) or "utf-8"
        try:
            text.encode(encoding)
        except UnicodeEncodeError:
            text = text.translate(IN_ASCII).encode(encoding, "backslashreplace").decode(encoding)
        try:
            self._stream.write(text)
            self._stream.flush()
        except (OSError, ValueError):
            self._quiet = True


class CamerasScreen:
    """A screen for all cameras; ``of`` is the part of one.

    Parameters
    ----------
    screen : Screen
    """

    def __init__(self, screen: Screen) -> None:
        self.screen = screen
        self._snapshots: dict[str, Snapshot] = {}
        self._states: Mapping[str, RunState] = {}

    def of(self, name: str) -> Screen:
        """The screen of one camera; that of all for a camera without a name."""
        return _CameraScreen(name, self) if name else self.screen

    def attach(self, states: Mapping[str, RunState]) -> None:
        """Show strains of all cameras, which have begun."""
        self._states = states

    def show(self, name: str, snapshot: Snapshot, words: str) -> None:
        """Renew the status line; ``snapshot`` is of the camera ``name``."""
        from live.results.sides import newest

        self._snapshots[name] = snapshot
        all_of = {one: state.snapshot(snapshot.t) for one, state in self._states.items()} or self._snapshots
        both = newest(self._states, snapshot.t)
        self.screen.status(cameras_line(all_of, both, self.screen.width, words))


class _CameraScreen(Screen):
    def __init__(self, name: str, every: CamerasScreen) -> None:
        self._name, self._every = name, every

    @property
    def is_due(self) -> bool:
        return self._every.screen.is_due

    def print(self, text: str = "") -> None:
        self._every.screen.print(about(Message(self._name), text) if text else "")

    def bell(self) -> None:
        self._every.screen.bell()

    def status(self, text: str) -> None:
        self._every.screen.status(f"{self._name}: {text}")

    def snapshot(self, snapshot: Snapshot, words: str = "") -> None:
        self._every.show(self._name, snapshot, words)
