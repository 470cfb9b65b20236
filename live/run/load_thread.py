"""The load thread: passes the samples of the load cell to the load log, the recording and the outputs."""

from __future__ import annotations

import logging
import math
import threading
import time

from acquire.errors import PhasedicError
from acquire.events import EventKind
from acquire.load_cell import LoadCell
from acquire.system import lower_priority
from live.pipeline.consumer_thread import Outputs
from live.pipeline.latency import LOAD
from live.pipeline.run_state import RunState
from live.run.control import TareControl
from live.run.pre_trigger import PreTriggerBuffer

log = logging.getLogger(__name__)
SILENT_S, SILENT_PERIODS = 1.0, 10
"""A load cell that has sent nothing for both is away."""


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
        self._count, self._first_t, self._last_t = 0, math.nan, math.nan
        self._thread = threading.Thread(target=self._work, name="load", daemon=True)

    def start(self) -> None:
        """Begin; the load cell must have been entered."""
        self._run_state.event_log.add_listener(self._run_state.loads.take_event)
        self._last_t = time.monotonic()
        self._thread.start()

    def stop(self) -> None:
        """End it; the samples of a load cell that is away by then are counted."""
        if self._thread.is_alive():
            self._count_open_gap(time.monotonic() - self._last_t)
        self._cell.stop()

    def _count_open_gap(self, silent_s: float) -> None:
        """Count the samples that have not come since the last one; 1 where the rate is not known."""
        span = self._last_t - self._first_t
        rate = (self._count - 1) / span if self._count > 1 and span > 0 else 0.0
        if silent_s <= max(SILENT_S, SILENT_PERIODS / rate if rate else SILENT_S):
            return
        missing = max(1, round(silent_s * rate))
        self._run_state.frame_counts.add(load_lost=missing)
        text = f"the load is missing at the end: no sample came for the last {silent_s:.1f} s"
        data = {"count": missing, "where": "end"}
        self._run_state.event_log.emit(EventKind.LOST, self._cell.info.address, text, "warning", data)

    def join(self) -> None:
        """Wait for the end."""
        if self._thread.ident is not None:
            self._thread.join()

    def _work(self) -> None:
        lower_priority(LOAD)
        try:
            for sample in self._cell:
                self._arrived(time.monotonic())
                loads = self._run_state.loads
                loads.append(sample)
                self._run_state.health.loaded(self._last_t, sample.force, tells=loads.telling is sample)
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

    def _arrived(self, now: float) -> None:
        self._first_t = self._first_t if self._count else now
        self._count, self._last_t = self._count + 1, now


def tare_controls(cell: LoadCell, run_state: RunState) -> TareControl:
    """The control that tares ``cell`` in this test."""

    def measured() -> bool:
        return bool(run_state.history.time_steps)

    tares = TareControl(
        cell, measured, lambda: run_state.loads.latest, run_state.event_log.emit, time.monotonic
    )
    run_state.event_log.add_listener(tares.take_event)
    return tares
