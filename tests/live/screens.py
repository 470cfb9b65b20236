"""A screen, a terminal and a run that only keep what they are told."""

from __future__ import annotations

import io
from pathlib import Path

from live.pipeline.consumer import Screen
from live.pipeline.run_state import RunState


class RecordingScreen(Screen):
    """Keeps the lines and the status lines, and counts how often its bell rings."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.statuses: list[str] = []
        self.rung = 0

    def print(self, text: str = "") -> None:
        self.lines.append(text)

    def status(self, text: str) -> None:
        self.statuses.append(text)

    def bell(self) -> None:
        self.rung += 1


class Terminal(io.StringIO):
    """A stream that is a terminal."""

    def isatty(self) -> bool:
        return True


class StatedRun:
    """A run of which only the state is known."""

    paused, recording, live, folder = False, True, True, Path("run")

    def __init__(self, run_state: RunState) -> None:
        self.run_state = run_state
