"""One camera of a live test: its source, its recording, its measurement and its outputs, joined by the stream."""

from __future__ import annotations

import json
import math
import time

from acquire.errors import EXIT_INTERRUPTED, LOSS, exit_code_of
from acquire.events import Event, EventKind
from acquire.hdf5 import FolderWatch
from acquire.record_mode import RecordMode
from acquire.text import Message
from live.pipeline.consumer import Compose, RunInfo, Screen
from live.pipeline.latency import KernelWork, LatencyMonitor
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import RunState
from live.pipeline.timed.figure import OLD_S
from live.pipeline.timed.force_watch import with_force_watch
from live.results.finished.figures_file import finished
from live.results.finished.finished_test import reference_force
from live.run.control import ControlRefused
from live.run.incoming_bursts import TAKING, IncomingBursts
from live.run.measurer import Measurer
from live.run.outcome import INTERRUPTED, TIME_IS_OVER, Outcome, StopSignal
from live.run.pre_trigger import CyclePictures, PreTriggerBuffer
from live.run.prepared_run import PreparedRun
from live.run.recorder import open_recording
from live.run.sources import CameraSource, GrabPlan
from live.setup.devices import Rig
from live.stream.adapted import Outputs
from live.stream.stream import Record, ReferenceWanted, StateKeeper, Stream, Subscriber, Waiting

_ARMED = Message("; nothing is recorded until the command start")
_SILENT_S = 1.0
_HINT_AFTER = 3  # times the frames of a reference


class CameraRun(Subscriber):
    """The run of one camera. Who takes its records is added in the order in which they are to have them.

    Parameters
    ----------
    name : str
        In the stream.
    prepared : PreparedRun
    run_state : RunState
    screen : Screen
    stop : StopSignal
        Of the whole test.
    stream : Stream
    consumers : callable taking RunInfo and RunState

    Attributes
    ----------
    outputs : Outputs
    run_state : RunState
        Events, counts, loads and history so far.
    source : CameraSource
    measurer : Measurer
    folder : Path
        Of the files; at the end where it is then, if it has been renamed.
    """

    takes = (Waiting, Measurement)

    def __init__(
        self,
        name: str,
        prepared: PreparedRun,
        run_state: RunState,
        screen: Screen,
        stop: StopSignal,
        stream: Stream,
        consumers: Compose,
    ) -> None:
        self.name, self._prepared, self.run_state = name, prepared, run_state
        self.folder = prepared.folder
        self._held = FolderWatch(self.folder)
        self._screen, self._stop, self._stream = screen, stop, stream
        self._recording: PreTriggerBuffer | None = None
        self._chosen: CyclePictures | None = None
        self._has_recorded = self._hinted = False
        self._own_time_is_over = False
        rig = prepared.rig
        plan = GrabPlan.of(prepared.config, prepared.bursts)
        self._seconds = plan.seconds
        self._keeper = StateKeeper(run_state, rig.load.info.address)
        run_state.health.load_range_N = rig.load.info.capacity_N or math.nan
        stream.add(self._keeper, name)
        about = RunInfo(
            prepared.config,
            prepared.folder,
            rig.camera.info,
            prepared.plan.grid,
            prepared.start,
            stop.request,
        )
        made = with_force_watch(consumers(about, run_state), run_state)
        self.outputs = Outputs(made, run_state.loads, run_state.event_log, stream, name)
        stream.add(self, name)
        self.source = CameraSource(rig.camera, plan, run_state, stream, name)
        self._incoming = IncomingBursts(stream, run_state.frame_counts, rig.camera.info, plan, name)
        latency = LatencyMonitor(
            lambda: self._recording.backlog if self._recording else 0.0,
            work=KernelWork(prepared.plan.grid.size, prepared.plan.grid.step, plan.burst),
        )
        self.measurer = Measurer(prepared, run_state, self._incoming, latency, stream, stop, name)

    def open_recording(self) -> None:
        """Open the recording, and pass the events so far, and those to come, to all who take them.

        Raises
        ------
        DataError
            A file exists already, or cannot be made.
        """
        config = json.dumps(self._prepared.config.as_dict(), indent=1)
        (self.folder / "config.json").write_text(config, encoding="utf-8")
        self.record_with(open_recording(self._prepared, self.run_state, self._screen, self._stop))

    def record_with(self, recording: PreTriggerBuffer | None) -> None:
        """Use ``recording``, None for none."""
        self._recording = recording
        if recording is not None:
            record = self._prepared.config.record
            mode, room = RecordMode.parse(record.mode), int(record.buffer_MB * 5e5)
            if mode.cycles:
                self._chosen = CyclePictures(recording, mode, self.run_state, room)
            self._stream.add(self._chosen or recording, self.name)
        self._has_recorded = self.recording
        self.run_state.event_log.add_listener(self._publish)

    def _publish(self, event: Event) -> None:
        self._stream.publish(event, self.name)

    # -- what may be called from other threads ------------------------------------------------

    @property
    def paused(self) -> bool:
        """Whether measuring is paused."""
        return self._incoming.paused

    @property
    def recording(self) -> bool:
        """Whether frames are recorded; not after the recording has failed, as on a full disk."""
        recording = self._recording
        return recording is not None and recording.on and recording.failed is None

    @property
    def live(self) -> bool:
        """Whether the camera is there now; else its pictures are recorded."""
        return self.rig.camera.info.live

    @property
    def running(self) -> bool:
        """Whether frames may still arrive."""
        return self.source.running

    @property
    def rig(self) -> Rig:
        """The devices."""
        return self._prepared.rig

    @property
    def has_measured(self) -> bool:
        """Whether there is a result yet."""
        return bool(self.run_state.history.time_steps)

    @property
    def state(self) -> str:
        """What is done with the frames: "REC", "ARMED" ..."""
        if self.recording:
            return Message("REC")
        if self._recording is not None:
            return Message("NOT RECORDING") if self._has_recorded else Message("ARMED")
        return Message("not recorded")

    def command(self, kind: EventKind, note: str = "") -> str:
        """Carry out a command of the operator, but for a tare; raises ControlRefused where that is not possible."""
        if kind in (EventKind.PAUSE, EventKind.RESUME):
            self._pause(kind is EventKind.PAUSE)
        elif kind is EventKind.NEW_REFERENCE:
            self.emit(kind, Message("a new reference is taken from the next frames"))
            self._stream.publish(ReferenceWanted(), self.name)
        elif kind is EventKind.NOTE:
            self.emit(kind, note)
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
        if wanted is self._incoming.paused:
            raise ControlRefused(
                Message("measuring is paused already") if wanted else Message("measuring is not paused")
            )
        kind = EventKind.PAUSE if wanted else EventKind.RESUME
        self.emit(kind, Message("measuring is paused") if wanted else Message("measuring goes on"))
        self._incoming.paused = self.run_state.health.paused = wanted
        self.run_state.health.since_t = time.monotonic()

    def _silence(self) -> None:
        names = self.run_state.alarms.silence() + self.run_state.faults.silence()
        if not names:
            raise ControlRefused("no alarm is on")
        self.emit(EventKind.ALARM, Message("silenced: {listed}", ", ".join(names)))

    def emit(self, kind: EventKind, text: str) -> None:
        """An event of the operator."""
        self.run_state.event_log.emit(kind, "operator", text)

    # -- between two bursts -------------------------------------------------------------------

    def take(self, record: Record) -> None:
        """Renew the status line; end a timed run whose camera gives no frames."""
        if isinstance(record.body, Waiting):
            self._idle(record.body.words)
        else:
            self._show()

    def _idle(self, words: str) -> None:
        now = time.monotonic()
        silent = not now - self.run_state.health.frame_t < _SILENT_S
        if words or self.paused:
            self._show(words if silent or not self.has_measured else "")
        if words == TAKING:
            self._hint_once()
        over = now - self.source.begun_t > self._seconds
        if silent and over and self.live and not self._own_time_is_over:
            self._own_time_is_over = True
            self.rig.camera.stop()

    def _hint_once(self) -> None:
        """A reference needs frames without a gap: warn once where frames are lost again and again."""
        n, counts = self._prepared.bursts[0], self.run_state.frame_counts
        if self._hinted or self.has_measured or not counts.lost or counts.grabbed < _HINT_AFTER * n:
            return
        self._hinted = True
        text = Message(
            "no {n} frames in a row for the reference, {lost} were lost: lower the rate of the camera, or take "
            "--reference-burst smaller",
            n,
            counts.lost,
        )
        self.run_state.event_log.emit(EventKind.MEASUREMENT, "reference", text, "warning")

    def _show(self, words: str = "") -> None:
        self.run_state.health.state = self.state
        if self._screen.is_due:
            self._screen.snapshot(self.run_state.snapshot(time.monotonic()), words)

    # -- the run ------------------------------------------------------------------------------

    def begin(self) -> None:
        """The test begins; camera and load cell have been entered."""
        self.run_state.health.began_t = time.monotonic()
        self.run_state.health.state = self.state
        waits = "" if self.recording or self._recording is None else _ARMED
        self.run_state.event_log.emit(EventKind.START, "phasedic", Message("the test begins{waits}", waits))
        self._keeper.begin()

    def stop_frames(self) -> None:
        """End the camera; no figure gets old by that. The samples of a load cell that is away are counted."""
        self.run_state.health.ended = True
        self.rig.camera.stop()
        self._keeper.end()

    def drain(self) -> None:
        """Wait for the end of source and measurement, and count what was not measured."""
        self._incoming.close()
        self.source.join()
        self.measurer.end()
        self._incoming.count_skipped()

    def close(self) -> None:
        """End consumers, then the recording, with all events."""
        self.run_state.loads.close()
        self.rig.camera.close()
        self.outputs.end()
        if self._chosen is not None:
            self._chosen.end()
        own = TIME_IS_OVER if self._own_time_is_over or self.source.time_is_over else Message("camera ended")
        reason = self._stop.reason or own
        self.run_state.event_log.emit(EventKind.STOP, "phasedic", Message("the test ends: {reason}", reason))
        if self._recording is not None:
            self._recording.close({"stop_reason": reason})
        self.folder = self._held.end()

    @property
    def exit_code(self) -> int:
        """The exit code of the run, after it has ended."""
        error = self.source.error
        if error is not None:
            return exit_code_of(error)
        if failure := self._keeper.load_failure or self.measurer.failure:
            return failure
        if self._stop.reason == INTERRUPTED:
            return EXIT_INTERRUPTED
        frame_counts = self.run_state.frame_counts
        unwritten = self._recording is not None and self._recording.failed is not None
        lossy = frame_counts.loss or self.outputs.failed or unwritten
        lossy = lossy or self.run_state.health.without_force_s > OLD_S
        lossy = lossy or not frame_counts.adds_up or not self.run_state.history.ends_with_values
        return LOSS if lossy else 0

    def outcome(self) -> Outcome:
        """The result, after it has ended."""
        run, state, code = self._prepared, self.run_state, self.exit_code
        reference_N = reference_force(state.event_log.events())
        test = finished(self.folder, run.config, state, code, reference_N, run.start.monotonic)
        return Outcome(self.folder, run.config, state, self.outputs, run.rig, run.plan.grid, code, test)
