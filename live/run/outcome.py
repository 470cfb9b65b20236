"""What a run leaves behind.

The wish to end a test: said once, from anywhere, heard by everybody.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from live.config.loading import Config
from live.pipeline.consumer_thread import Outputs
from live.pipeline.run_state import RunState
from live.setup.devices import Rig

if TYPE_CHECKING:
    from pathlib import Path

    from analysis import ZoiGrid


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a run leaves behind.

    Attributes
    ----------
    folder : Path
    config : Config
        As it was in force.
    run_state : RunState
        Events, ledger, loads, and the means of every measured instant.
    outputs : Outputs
    rig : Rig
        Closed; its specimen tells the truth of a simulated test.
    grid : ZoiGrid
    exit_code : int
    """

    folder: Path
    config: Config
    run_state: RunState
    outputs: Outputs
    rig: Rig
    grid: ZoiGrid
    exit_code: int


class StopSignal:
    """Asked from any thread or signal handler; the first reason counts.

    Attributes
    ----------
    reason : str
        Empty until it was asked.
    """

    def __init__(self) -> None:
        self.reason = ""
        self._asked = threading.Event()
        self._hearers: list[Callable[[], None]] = []

    def ask(self, reason: str) -> None:
        """End the test cleanly, soon."""
        self.reason = self.reason or reason
        self._asked.set()
        for hear in list(self._hearers):
            hear()

    def then(self, hear: Callable[[], None]) -> None:
        """Call ``hear``, which must stand being called twice, when it is asked; at once where it has been."""
        self._hearers.append(hear)
        if self._asked.is_set():
            hear()

    @property
    def asked(self) -> bool:
        """Whether somebody has asked."""
        return self._asked.is_set()
