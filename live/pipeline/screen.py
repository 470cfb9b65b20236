"""Where a person reads how a test goes: what every part of the program may ask of a screen."""

from __future__ import annotations

from live.pipeline.measurement import TimeStep
from live.pipeline.snapshot import Snapshot


class Screen:
    """Lines that stay, and one status line that is renewed. Every method does nothing until it is defined anew.

    ``live.ui.terminal.screen.TerminalScreen`` prints to a terminal or a log.
    """

    @property
    def is_due(self) -> bool:
        """Whether the status line may be renewed by now."""
        return False

    def say(self, text: str = "") -> None:
        """A line that stays."""

    def bell(self) -> None:
        """Ring."""

    def status(self, text: str) -> None:
        """The status line, where it is due."""

    def snapshot(self, snapshot: Snapshot, words: str = "") -> None:
        """The status line of a live run; ``words`` name what it waits for."""

    def progress(self, i: TimeStep, done: int, expected: int | None, elapsed_s: float) -> None:
        """The status line of a replay: ``done`` bursts of the ``expected`` after ``elapsed_s``, ``i`` the last."""

    def prompt(self, text: str | None) -> None:
        """What the operator types, in place of the status line; None: no more."""
