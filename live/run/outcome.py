"""The end of a test: the signal that stops it from any thread, the outcome of each camera, and the exit code."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from acquire.errors import exit_code_of_all
from acquire.text import Message
from live.config.loading import Config
from live.pipeline.run_state import RunState
from live.results.finished.finished_test import FinishedTest
from live.setup.devices import Rig
from live.stream.adapted import Outputs

if TYPE_CHECKING:
    from pathlib import Path

    from analysis import ZoiGrid

INTERRUPTED, TIME_IS_OVER = Message("interrupted"), Message("the time is over")
"""Reasons to stop; INTERRUPTED gives the exit code of that name."""


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """The result of the run of one camera.

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


@dataclass(frozen=True, slots=True, eq=False)
class OutcomeOfTest:
    """The result of a test with any number of cameras.

    Attributes
    ----------
    folder : Path
        Those of several cameras are in it.
    cameras : mapping of str to Outcome
        By name, the leading one first.
    """

    folder: Path
    cameras: Mapping[str, Outcome]

    @property
    def exit_code(self) -> int:
        """Exit code of all cameras (``acquire.errors.exit_code_of_all``)."""
        return exit_code_of_all(outcome.exit_code for outcome in self.cameras.values())


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

    def is_set(self) -> bool:
        """Whether the stop is requested."""
        return self._requested.is_set()
