"""The terminal of a test with two cameras: lines with the name of their side, and one status line of both."""

from __future__ import annotations

from typing import TYPE_CHECKING

from live.config.sides import BACK, FRONT
from live.pipeline.screen import Screen
from live.ui.terminal.status_line import sides_line

if TYPE_CHECKING:
    from live.pipeline.run_state import RunState
    from live.pipeline.snapshot import Snapshot


class SidesScreen:
    """A screen for both sides; ``side`` is the part of one.

    Parameters
    ----------
    screen : Screen
    """

    def __init__(self, screen: Screen) -> None:
        self.screen = screen
        self._snapshots: dict[str, Snapshot] = {}
        self._states: dict[str, RunState] = {}

    def side(self, name: str) -> Screen:
        """The screen of one side."""
        return _SideScreen(name, self)

    def attach(self, states: dict[str, RunState]) -> None:
        """Show strains of both sides, which have begun."""
        self._states = states

    def show(self, name: str, snapshot: Snapshot, words: str) -> None:
        """Renew the status line; ``snapshot`` is of the side ``name``."""
        from live.results.sides.together import newest

        self._snapshots[name] = snapshot
        sides = {side: state.snapshot(snapshot.t) for side, state in self._states.items()} or self._snapshots
        both = newest(self._states[FRONT], self._states[BACK], snapshot.t) if FRONT in self._states else {}
        values = {name: (one.mean, one.bending, one.sigma) for name, one in both.items()}
        self.screen.status(sides_line(sides, values, self.screen.width, words))


class _SideScreen(Screen):
    def __init__(self, name: str, both: SidesScreen) -> None:
        self._name, self._both = name, both

    @property
    def is_due(self) -> bool:
        return self._both.screen.is_due

    def print(self, text: str = "") -> None:
        self._both.screen.print(f"{self._name}: {text}" if text else "")

    def bell(self) -> None:
        self._both.screen.bell()

    def status(self, text: str) -> None:
        self._both.screen.status(f"{self._name}: {text}")

    def snapshot(self, snapshot: Snapshot, words: str = "") -> None:
        self._both.show(self._name, snapshot, words)
