"""A live run: devices, threads and outputs joined.

Threads: grab (``Grabber``), load (``LoadThread``), record (``Recorder``), measure (``MeasureThread``) and
one for each consumer that may block. The measuring thread takes bursts in order, and the newest where it is
late (``LatestQueue``).
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from acquire.errors import PhasedicError
from acquire.events import EventKind
from acquire.frame import Burst, Frame
from live.config.loading import Config
from live.pipeline.consumer import Compose, RunInfo
from live.pipeline.consumer_thread import Outputs
from live.pipeline.latency import LatencyMonitor
from live.pipeline.run_state import RunState
from live.pipeline.screen import Screen
from live.pipeline.timed.figure import OLD_S
from live.pipeline.timed.force_watch import with_force_watch
from live.results.finished.figures_file import finished
from live.results.finished.finished_test import reference_force
from live.results.writer import write_results
from live.run.burst_queue import TAKING, BurstQueue
from live.run.control import ControlRefused
from live.run.grabber import Grabber, GrabPlan, memory_of_measured
from live.run.load_thread import LoadThread, tare_controls
from live.run.measuring import MeasureThread
from live.run.outcome import Outcome, StopSignal
from live.run.pre_trigger import PreTriggerBuffer
from live.run.prepared_run import PreparedRun, new_run_state, set_up
from live.run.recorder import open_recording
from live.setup.devices import Rig, check_load_sign, open_rig

_ARMED = "; nothing is recorded until the command start"
_SILENT_S = 1.0
_HINT_AFTER = 3  # times the frames of a reference
INTERRUPTED = "interrupted"
"""The reason to stop that gives exit code 130."""
TIME_IS_OVER = "the time is over"


class LiveRun:
    """A test: entering it starts the threads, leaving it closes everything.

    It carries out commands (``live.run.control.Controls``) from any thread.

    Parameters
    ----------
    prepared : PreparedRun
    run_state : RunState
    outputs : Outputs
    recording : PreTriggerBuffer or None
        None: nothing is recorded.
    screen : Screen
    stop : StopSignal
    """

    def __init__(
        self,
        prepared: PreparedRun,
        run_state: RunState,
        outputs: Outputs,
        recording: PreTriggerBuffer | None,
        screen: Screen,
        stop: StopSignal,
    ) -> None:
        self._prepared, self._run_state, self._outputs = prepared, run_state, outputs
        self._recording, self._screen, self._stop = recording, screen, stop
        self._rig = prepared.rig
        self._plan = GrabPlan.of(prepared.config, prepared.bursts)
        on_burst = self._take_burst if recording is not None and recording.takes_bursts else None
        self.grabber = Grabber(self._rig.camera, self._plan, run_state, self._take, on_burst)
        run_state.health.began_t, self._hinted = time.monotonic(), False
        self._has_recorded = self.recording
        memory = memory_of_measured(self._rig.camera.info, self._plan)
        self._burst_queue = BurstQueue(self.grabber, run_state.frame_counts, self._idle, memory)
        self._load = LoadThread(self._rig.load, run_state, outputs, recording)
        self._tares = tare_controls(self._rig.load, run_state)
        latency = LatencyMonitor(lambda: recording.backlog if recording else 0.0)
        self._measure_thread = MeasureThread(
            prepared, run_state, outputs, self._burst_queue, latency, self._show
        )

    # -- what may be called from other threads ------------------------------------------------

    @property
    def paused(self) -> bool:
        """Whether measuring is paused."""
        return self._burst_queue.paused

    @property
    def recording(self) -> bool:
        """Whether frames are recorded; not after the recording has failed, as on a full disk."""
        recording = self._recording
        return recording is not None and recording.on and recording.failed is None

    @property
    def live(self) -> bool:
        """Whether the camera is there now; else its pictures are recorded."""
        return self._rig.camera.info.live

    @property
    def rig(self) -> Rig:
        """The devices."""
        return self._rig

    @property
    def run_state(self) -> RunState:
        """Events, counts, loads and history of the test so far."""
        return self._run_state

    @property
    def folder(self) -> Path:
        """Of the files."""
        return self._prepared.folder

    def stop(self, reason: str) -> None:
        """End the run cleanly, soon."""
        self._stop.request(reason)

    def command(self, kind: EventKind, note: str = "") -> str:
        """Carry out a command of the operator and log it; raises ControlRefused where that is not possible."""
        if kind is EventKind.TARE:
            return self._tares.tare(note)
        if kind in (EventKind.PAUSE, EventKind.RESUME):
            self._pause(kind is EventKind.PAUSE)
        elif kind is EventKind.NEW_REFERENCE:
            self._emit(kind, "a new reference is taken from the next frames")
            self.grabber.take_reference()
        elif kind is EventKind.NOTE:
            self._emit(kind, note)
        elif kind is EventKind.ALARM:
            self._silence()
        elif kind is EventKind.RECORD:
            if self._recording is None:
                raise ControlRefused("this run records nothing (--no-record)")
            text = self._recording.command(note)
            self._has_recorded = True
            return text
        return ""

    def _pause(self, wanted: bool) -> None:
        if wanted is self._burst_queue.paused:
            raise ControlRefused("measuring is paused already" if wanted else "measuring is not paused")
        kind = EventKind.PAUSE if wanted else EventKind.RESUME
        self._emit(kind, "measuring is paused" if wanted else "measuring goes on")
        self._burst_queue.paused = self._run_state.health.paused = wanted
        self._run_state.health.since_t = time.monotonic()

    def _silence(self) -> None:
        names = self._run_state.alarms.silence() + self._run_state.faults.silence()
        if not names:
            raise ControlRefused("no alarm is on")
        self._emit(EventKind.ALARM, f"silenced: {', '.join(names)}")

    def _emit(self, kind: EventKind, text: str) -> None:
        self._run_state.event_log.emit(kind, "operator", text)

    # -- the run ------------------------------------------------------------------------------

    def __enter__(self) -> LiveRun:
        with ExitStack() as stack:
            stack.enter_context(self._rig.camera)
            stack.enter_context(self._rig.load)
            self._stop.on_request(self._rig.camera.stop)
            self._run_state.health.began_t = time.monotonic()
            waits = "" if self.recording or self._recording is None else _ARMED
            self._run_state.health.state = self.state
            self._run_state.event_log.emit(EventKind.START, "phasedic", f"the test begins{waits}")
            self._load.start()
            self.grabber.start()
            stack.pop_all()
        return self

    def wait(self) -> None:
        """Measure until the camera has ended; raises where the start has failed."""
        try:
            self._measure_thread.run()
        except PhasedicError:
            self.stop("the start failed")
            raise

    def __exit__(self, *_: object) -> None:
        """End all threads and close the devices, whatever happened before; no figure gets old by that."""
        self._run_state.health.ended = True
        self._rig.camera.stop()
        self._load.stop()
        self.grabber.bursts.close()
        self.grabber.join()
        if self.grabber.time_is_over:
            self.stop(TIME_IS_OVER)
        self._burst_queue.count_skipped()
        self._load.join()
        self._run_state.loads.close()
        self._rig.load.close()
        self._rig.camera.close()

    @property
    def exit_code(self) -> int:
        """The exit code of the run, after it has been left."""
        error = self.grabber.error
        if error is not None:
            return error.exit_code if isinstance(error, PhasedicError) else 1
        if failure := self._load.failure or self._measure_thread.failure:
            return failure
        if self._stop.reason == INTERRUPTED:
            return 130
        frame_counts = self._run_state.frame_counts
        unwritten = self._recording is not None and self._recording.failed is not None
        lossy = frame_counts.loss or self._outputs.failed or unwritten
        lossy = lossy or self._run_state.health.without_force_s > OLD_S
        return 5 if lossy or not frame_counts.adds_up or not self._run_state.history.ends_with_values else 0

    def _take(self, frame: Frame, is_reference: bool) -> None:
        health = self._run_state.health
        health.framed(time.monotonic(), self.grabber.fps)
        if is_reference:
            health.since_t = frame.t
        if self._recording is not None:
            self._recording.frame(frame, is_reference=is_reference)
        self._outputs.frame(frame)

    def _take_burst(self, burst: Burst, is_reference: bool) -> None:
        if self._recording is not None:
            self._recording.burst(burst, is_reference=is_reference)

    def _idle(self, words: str) -> None:
        """Called between bursts; ends a timed run whose camera gives no frames."""
        now = time.monotonic()
        silent = not now - self._run_state.health.frame_t < _SILENT_S
        if words or self.paused:
            self._show(words if silent or not self._has_measured else "")
        if words == TAKING:
            self._hint_once()
        over = now - self.grabber.begun_t > self._plan.seconds
        if silent and over and self._rig.camera.info.live and not self._stop.requested:
            self.stop(TIME_IS_OVER)

    def _hint_once(self) -> None:
        """A reference needs frames without a gap: warn once where frames are lost again and again."""
        n, counts = self._prepared.bursts[0], self._run_state.frame_counts
        if self._hinted or self._has_measured or not counts.lost or counts.grabbed < _HINT_AFTER * n:
            return
        self._hinted = True
        text = (
            f"no {n} frames in a row for the reference, {counts.lost} were lost: lower the rate of the camera, or take"
            " --reference-burst smaller"
        )
        self._run_state.event_log.emit(EventKind.MEASUREMENT, "reference", text, "warning")

    def _show(self, words: str = "") -> None:
        """Renew the status line; called with every measurement."""
        self._run_state.health.state = self.state
        if self._screen.is_due:
            self._screen.snapshot(self._run_state.snapshot(time.monotonic()), words)

    @property
    def _has_measured(self) -> bool:
        return bool(self._run_state.history.time_steps)

    @property
    def state(self) -> str:
        """What is done with the frames: "REC", "ARMED" ..."""
        if self.recording:
            state = "REC"
        elif self._recording is not None:
            state = "NOT RECORDING" if self._has_recorded else "ARMED"
        else:
            state = "not recorded"
        return f"{state}, PAUSED" if self.paused else state


def run_live(
    config: Config,
    screen: Screen,
    *,
    stop: StopSignal | None = None,
    consumers: Compose = write_results,
    on_start: Callable[[LiveRun], object] = lambda live: None,
) -> Outcome:
    """Run a test from opening the devices to closing the files.

    Parameters
    ----------
    config : Config
    screen : Screen
    stop : StopSignal, optional
        Ends the test from any thread, also while the devices are opened.
    consumers : callable taking RunInfo and RunState
        Makes the consumers of the test; ``live.commands.consumers`` has the standard ones.
    on_start : callable taking the LiveRun
        Called once when the test has begun, to attach keyboard and other controls.

    Raises
    ------
    ConfigError, DeviceError, DataError
        The start failed; whatever was recorded by then is closed and readable.
    """
    stop, run_state = stop or StopSignal(), new_run_state(config, screen)
    check_load_sign(config.load)
    rig = open_rig(
        config.camera.address,
        config.load.address,
        run_state.event_log,
        crop=config.camera.crop,
        zero_N=config.load.zero_N,
    )
    try:
        prepared = set_up(config, rig, run_state.event_log, screen, stop)
        return run_prepared(prepared, run_state, screen, stop, consumers, on_start)
    finally:
        rig.close()


def run_prepared(
    prepared: PreparedRun,
    run_state: RunState,
    screen: Screen,
    stop: StopSignal,
    consumers: Compose,
    on_start: Callable[[LiveRun], object],
) -> Outcome:
    """Run a prepared test to the closing of the files; the devices are left to the caller. As ``run_live``."""
    rig, grid = prepared.rig, prepared.plan.grid
    for line in prepared.announcement():
        screen.print(line)
    about = RunInfo(prepared.config, prepared.folder, rig.camera.info, grid, prepared.start, stop.request)
    made = with_force_watch(consumers(about, run_state), run_state)
    outputs = Outputs(made, run_state.loads, run_state.event_log, run_state.history)
    code = _with_outputs(prepared, run_state, outputs, screen, stop, on_start)
    test = finished(
        prepared.folder, prepared.config, run_state, code, reference_force(run_state.event_log.events())
    )
    return Outcome(prepared.folder, prepared.config, run_state, outputs, rig, grid, code, test)


def _with_outputs(
    prepared: PreparedRun,
    run_state: RunState,
    outputs: Outputs,
    screen: Screen,
    stop: StopSignal,
    on_start: Callable[[LiveRun], object],
) -> int:
    """The run itself; outputs and recording are closed in any case, the recording last, with all events."""
    with ExitStack() as closing:
        closing.callback(outputs.end)
        config = json.dumps(prepared.config.as_dict(), indent=1)
        (prepared.folder / "config.json").write_text(config, encoding="utf-8")
        recording = open_recording(prepared, run_state, screen, stop)
        closing.pop_all()
        closing.callback(lambda: _close(recording, run_state, outputs, stop))
        live = LiveRun(prepared, run_state, outputs, recording, screen, stop)
        with live:
            on_start(live)
            live.wait()
    return live.exit_code


def _close(
    recording: PreTriggerBuffer | None, run_state: RunState, outputs: Outputs, stop: StopSignal
) -> None:
    outputs.end()
    reason = stop.reason or "camera ended"
    run_state.event_log.emit(EventKind.STOP, "phasedic", f"the test ends: {reason}")
    if recording is not None:
        recording.close({"stop_reason": reason})
