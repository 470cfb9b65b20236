"""The load thread: passes the samples of the load cell to the load log, the recording and the outputs."""

from __future__ import annotations

import logging
import threading
import time

from acquire.errors import PhasedicError
from acquire.events import EventKind
from acquire.load_cell import LoadCell
from live.pipeline.consumer_thread import Outputs
from live.pipeline.latency import LOAD, lower_priority
from live.pipeline.run_state import RunState
from live.run.control import TareControl
from live.run.pre_trigger import PreTriggerBuffer

log = logging.getLogger(__name__)


class LoadThread:
    """Reads ``cell`` in its own thread; a failure there never ends the images.

    Parameters
    ----------
    cell : LoadCell
    run_state : RunState
    outputs : Outputs
    recording : PreTriggerBuffer or None

    Attributes
    ----------
    failure : int
        The exit code of the error that ended the load; 0 without one.
    """

    def __init__(
        self, cell: LoadCell, run_state: RunState, outputs: Outputs, recording: PreTriggerBuffer | None
    ) -> None:
        self._cell, self._run_state, self._outputs, self._recording = cell, run_state, outputs, recording
        self.failure = 0
        self._thread = threading.Thread(target=self._work, name="load", daemon=True)

    def start(self) -> None:
        """Begin; the load cell must have been entered."""
        self._run_state.event_log.add_listener(self._run_state.loads.take_event)
        self._thread.start()

    def join(self) -> None:
        """Wait for the end."""
        if self._thread.ident is not None:
            self._thread.join()

    def _work(self) -> None:
        lower_priority(LOAD)
        try:
            for sample in self._cell:
                self._run_state.loads.append(sample)
                self._run_state.health.loaded(time.monotonic(), sample.force)
                self._run_state.frame_counts.add(load_samples=1)
                if self._recording is not None:
                    self._recording.sample(sample)
                self._outputs.load(sample)
        except Exception as error:
            if not isinstance(error, PhasedicError):
                log.exception("the load thread failed")
            self.failure = getattr(error, "exit_code", 1)
            text = f"the load is lost, images go on: {error}"
            self._run_state.event_log.emit(EventKind.DEVICE, self._cell.info.address, text, "error")
        finally:
            self._run_state.loads.close()


def tare_controls(cell: LoadCell, run_state: RunState) -> TareControl:
    """The control that tares ``cell`` in this test."""

    def measured() -> bool:
        return bool(run_state.history.time_steps)

    tares = TareControl(
        cell, measured, lambda: run_state.loads.latest, run_state.event_log.emit, time.monotonic
    )
    run_state.event_log.add_listener(tares.take_event)
    return tares
