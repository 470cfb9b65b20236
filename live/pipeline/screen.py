"""The interface of a screen: what every part of the program may print for a person."""

from __future__ import annotations

from live.pipeline.measurement import TimeStep
from live.pipeline.snapshot import Snapshot


class Screen:
    """Permanent lines, and one status line that is renewed. Every method does nothing until it is overridden.

    ``live.ui.terminal.screen.TerminalScreen`` prints to a terminal or a log.
    """

    @property
    def is_due(self) -> bool:
        """Whether the status line may be renewed now."""
        return False

    @property
    def width(self) -> int:
        """Letters that a status line may have."""
        return 0

    def print(self, text: str = "") -> None:
        """Print a permanent line."""

    def bell(self) -> None:
        """Ring the bell of the terminal."""

    def status(self, text: str) -> None:
        """Renew the status line, where it is due."""

    def snapshot(self, snapshot: Snapshot, words: str = "") -> None:
        """The status line of a live run; ``words`` name what it waits for."""

    def progress(self, i: TimeStep, done: int, expected: int | None, elapsed_s: float) -> None:
        """The status line of a replay: ``done`` bursts of the ``expected`` after ``elapsed_s``, ``i`` the last."""

    def prompt(self, text: str | None) -> None:
        """Show what the operator types, in place of the status line; None ends it."""
