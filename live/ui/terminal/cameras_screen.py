"""The terminal of a test with several cameras: lines with the name of their camera, and one status line of all."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from acquire.text import Message
from acquire.text.message import about
from live.pipeline.screen import Screen
from live.ui.terminal.status_line import cameras_line

if TYPE_CHECKING:
    from live.pipeline.run_state import RunState
    from live.pipeline.snapshot import Snapshot


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
        from live.results.sides.together import newest

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
