"""The end of a run: the signal that stops it from any thread, and its outcome."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from live.config.loading import Config
from live.pipeline.consumer_thread import Outputs
from live.pipeline.run_state import RunState
from live.results.finished.finished_test import FinishedTest
from live.setup.devices import Rig

if TYPE_CHECKING:
    from pathlib import Path

    from analysis import ZoiGrid


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """The result of a run.

    Attributes
    ----------
    folder : Path
    config : Config
        As used in the run.
    run_state : RunState
        Events, frame counts, loads, and the means of every time step.
    outputs : Outputs
    rig : Rig
        Closed; its specimen has the true strain of a simulated test.
    grid : ZoiGrid
    exit_code : int
    test : FinishedTest
    """

    folder: Path
    config: Config
    run_state: RunState
    outputs: Outputs
    rig: Rig
    grid: ZoiGrid
    exit_code: int
    test: FinishedTest


class StopSignal:
    """Stops a run from any thread or signal handler; the first reason counts.

    Attributes
    ----------
    reason : str
        Empty until the stop is requested.
    """

    def __init__(self) -> None:
        self.reason = ""
        self._requested = threading.Event()
        self._callbacks: list[Callable[[], None]] = []

    def request(self, reason: str) -> None:
        """End the test cleanly, soon."""
        self.reason = self.reason or reason
        self._requested.set()
        for callback in list(self._callbacks):
            callback()

    def on_request(self, callback: Callable[[], None]) -> None:
        """Call ``callback`` when the stop is requested, or now where it has been; perhaps more than once."""
        self._callbacks.append(callback)
        if self._requested.is_set():
            callback()

    @property
    def requested(self) -> bool:
        """Whether the stop is requested."""
        return self._requested.is_set()
