"""A live run: devices, threads and outputs joined.

Threads: grab (``Grabber``), load (here), record (``Recorder``), the view's publisher, and this one,
which measures. Bursts reach it through a one-place mailbox, so that it always has the newest.
"""

from __future__ import annotations

import datetime
import json
import logging
import math
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from acquire.burst import LIMIT_PX
from acquire.clock import ClockPair
from acquire.errors import ConfigError, PhasedicError
from acquire.events import Event, EventKind
from acquire.frame import Burst, Frame
from acquire.load_cell import LoadLog
from acquire.record_mode import RecordMode
from acquire.session import SessionInfo
from live.measure import Correction, Instant, Measurement, SmearGuard, measure, unchanged, usable
from live.outputs import Outputs, make_outputs, open_view
from live.run.feed import Feed
from live.run.grabber import Grabber
from live.run.outcome import Outcome
from live.run.recorder import Recorder, open_writer, tell_room
from live.run.reference_step import ReferenceStep
from live.setup import (
    DEFAULT_BURST,
    DEFAULT_REFERENCE_BURST,
    Config,
    Rig,
    correction,
    grid_for,
    kernel_settings,
    make_folder,
    open_rig,
    read_mask,
    versions,
    with_flat_field,
    with_mask,
)
from live.tell import Journal, Ledger, Screen

if TYPE_CHECKING:
    from analysis import KernelSettings, PhaseKernel, ZoiGrid

log = logging.getLogger(__name__)
_GRACE_S = 5.0  # a timed run without frames ends this much later


class LiveRun:
    """One run from opening the devices to closing the files; ``stop`` ends it from anywhere."""

    def __init__(self, config: Config, screen: Screen) -> None:
        self.config, self.screen = config, screen
        self.journal = Journal()
        self.ledger = Ledger()
        self.loads = LoadLog(config.load.max_gap_s)
        self._stop_reason: str | None = None
        self._stopping = threading.Event()
        self._watchers: list[Callable[[Measurement], None]] = []
        self._failure: int = 0
        self._correct: Correction = unchanged
        self._deadline = math.inf
        self.grabber: Grabber | None = None
        self.rig: Rig | None = None

    def watch(self, watcher: Callable[[Measurement], None]) -> None:
        """Show every measurement to ``watcher`` too, in the measuring thread."""
        self._watchers.append(watcher)

    # -- what may be called from other threads ------------------------------------------------

    def stop(self, reason: str) -> None:
        """End the run cleanly, soon."""
        if self._stop_reason is None:
            self._stop_reason = reason
        self._stopping.set()
        if self.rig is not None:
            self.rig.camera.stop()

    def command(self, kind: EventKind, note: str = "") -> None:
        """Carry out a command of the operator and write it down."""
        texts = {
            EventKind.TARE: "tare",
            EventKind.PAUSE: "measuring is paused, recording goes on",
            EventKind.RESUME: "measuring goes on",
            EventKind.NEW_REFERENCE: "a new reference is taken from the next frames",
        }
        self.journal.tell(kind, "operator", texts.get(kind, note))
        if kind is EventKind.TARE and self.rig is not None:
            self.rig.load.tare()
        elif kind in (EventKind.PAUSE, EventKind.RESUME) and self.grabber is not None:
            self.feed.paused = kind is EventKind.PAUSE
        elif kind is EventKind.NEW_REFERENCE and self.grabber is not None:
            self.grabber.take_reference()

    # -- the run ------------------------------------------------------------------------------

    def run(self) -> Outcome:
        """Do it all.

        Raises
        ------
        ConfigError, DeviceError, DataError
            The start failed; whatever was recorded by then is closed and readable.
        """
        config = self.config
        if not config.camera.address:
            raise ConfigError(
                "no camera is given; use --camera ADDRESS (phasedic devices lists what is there)"
            )
        self.screen.say(f"opening {config.camera.address}")
        self.rig = rig = open_rig(
            config.camera.address, config.load.address, self.journal, crop=config.camera.crop
        )
        try:
            mask = self._mask(rig)
            grid = grid_for(config, rig.camera.info.width, rig.camera.info.height, mask)
            settings = kernel_settings(config)
            self._correct = correction(config, rig.camera.info)
            self._rehearse(rig, grid, settings)
            folder = make_folder(config.output.dir, datetime.datetime.now(datetime.UTC))
            self.config = config = with_flat_field(with_mask(config, mask, folder), folder)
            start = self._time_zero(rig)
            outputs = make_outputs(
                config,
                folder,
                rig.camera.info,
                grid,
                self.loads,
                self.journal,
                self.ledger,
                (start.monotonic, start.utc),
            )
            return self._with_files(rig, grid, settings, folder, start, outputs)
        finally:
            rig.close()

    def _mask(self, rig: Rig) -> NDArray[np.bool_] | None:
        """The mask that was given; a simulated specimen knows its own."""
        path = self.config.measure.mask
        if path is None and rig.specimen is not None:
            mask = RecordMode(crop=self.config.camera.crop).cut(rig.specimen.mask())
            return None if mask.all() else mask
        return read_mask(path, rig.camera.info.width, rig.camera.info.height)

    def _time_zero(self, rig: Rig) -> ClockPair:
        """Time zero of all files; pictures with nominal times begin at 0 whatever the clock says."""
        now = ClockPair.now()
        if rig.camera.info.clock != "nominal":
            return now
        self.journal.origin = now.monotonic
        return ClockPair(0.0, now.utc)

    def _rehearse(self, rig: Rig, grid: ZoiGrid, settings: KernelSettings) -> None:
        from live.run.rehearsal import rehearse

        began = time.perf_counter()
        try:
            rehearse(rig.camera.info, grid, settings, self._burst_lengths(rig))
        except ValueError as error:
            raise usable(error, "measure") from error
        if (took := time.perf_counter() - began) > 3:
            self.screen.say(f"everything is compiled ({took:.0f} s)")

    def _burst_lengths(self, rig: Rig) -> tuple[int, int]:
        """Frames in the reference and in a measured burst."""
        m, live = self.config.measure, rig.camera.info.live
        return m.reference_burst or (DEFAULT_REFERENCE_BURST if live else 1), m.burst or (
            DEFAULT_BURST if live else 1
        )

    def _with_files(
        self,
        rig: Rig,
        grid: ZoiGrid,
        settings: KernelSettings,
        folder: Path,
        start: ClockPair,
        outputs: Outputs,
    ) -> Outcome:
        self.screen.announce(rig, folder)
        open_view(outputs, self.config, self.screen)
        (folder / "config.json").write_text(json.dumps(self.config.as_dict(), indent=1), encoding="utf-8")
        recorder: Recorder | None = None
        try:
            recorder = self._recorder(rig, folder, start)
            with rig.camera, rig.load:
                if self._stopping.is_set():  # asked to stop before there was a camera to tell
                    rig.camera.stop()
                self._threads(rig, outputs, recorder)
                self._measure_all(rig, grid, settings, outputs)
        finally:
            self._close(rig, outputs, recorder)
        return Outcome(
            folder, self.ledger, outputs, self.loads, rig, grid, self._exit_code(recorder, outputs)
        )

    def _recorder(self, rig: Rig, folder: Path, start: ClockPair) -> Recorder | None:
        r = self.config.record
        if not r.enabled:
            return None
        path, mode = folder / "session.h5", RecordMode.parse(r.mode)
        info = SessionInfo(
            camera=rig.camera.info,
            load=rig.load.info,
            start=start,
            config=self.config.as_dict(),
            metadata=dict(self.config.metadata),
            versions=versions(),
            mode=mode,
        )
        writer = open_writer(path, r.rotate_MB, info)
        tell_room(path, rig.camera.info, mode, self.screen)
        recorder = Recorder(
            writer,
            self.ledger,
            self.journal,
            int(r.buffer_MB * 1e6),
            mode=mode,
            waits=not rig.camera.info.live,
            on_failure=lambda: self.stop("recording failed") if r.when_full == "stop" else None,
        )
        self.journal.add_listener(recorder.event)
        return recorder

    def _threads(self, rig: Rig, outputs: Outputs, recorder: Recorder | None) -> None:
        reference_burst, burst = self._burst_lengths(rig)

        def on_frame(frame: Frame) -> None:
            if recorder is not None:
                recorder.frame(frame)
            outputs.picture(frame)

        grabber = Grabber(
            rig.camera,
            self.journal,
            self.ledger,
            burst=burst,
            reference_burst=reference_burst,
            seconds=self.config.output.seconds,
            shorten_above_px=LIMIT_PX if self.config.measure.shorten_bursts else None,
            on_frame=on_frame,
            on_burst=recorder.burst if recorder is not None else lambda burst: None,
        )
        self.feed = Feed(grabber, self.ledger, self._idle)
        self.grabber = grabber
        self._load_thread = threading.Thread(
            target=self._drain_load, args=(rig, outputs, recorder), name="load", daemon=True
        )
        if self.config.output.seconds is not None:
            self._deadline = time.monotonic() + self.config.output.seconds + _GRACE_S
        self.journal.tell(EventKind.START, "phasedic", "the test begins")
        self._load_thread.start()
        grabber.start()

    def _drain_load(self, rig: Rig, outputs: Outputs, recorder: Recorder | None) -> None:
        try:
            for sample in rig.load:
                self.loads.append(sample)
                self.ledger.add(load_samples=1)
                if recorder is not None:
                    recorder.sample(sample)
                outputs.load(sample.t, sample.force)
        except Exception as error:
            if not isinstance(error, PhasedicError):
                log.exception("the load thread failed")
            text = f"the load is lost, images go on: {error}"
            self._failure = self._failure or getattr(error, "exit_code", 1)
            self.journal.tell(EventKind.DEVICE, rig.load.info.address, text, "error")
        finally:
            self.loads.close()

    def _measure_all(self, rig: Rig, grid: ZoiGrid, settings: KernelSettings, outputs: Outputs) -> None:
        """Measure until the camera ends; a trouble here never ends the recording."""
        assert self.grabber is not None
        step = ReferenceStep(
            self.feed,
            self.grabber,
            self.journal,
            self.ledger,
            self.loads,
            self.config,
            grid,
            settings,
            self._correct,
        )
        try:
            prepared = step.take()
            if prepared is not None:
                self._measure(*prepared, outputs)
        except PhasedicError:
            self.stop("the start failed")
            raise
        except Exception as error:
            log.exception("the measurement failed")
            self._failure = 1
            text = f"measuring has stopped by a defect, recording goes on: {error!r}"
            self.journal.tell(EventKind.MEASUREMENT, "measurement", text, "error")
            self.feed.let_pass()

    def _measure(self, kernel: PhaseKernel, noise_GL: float | None, outputs: Outputs) -> None:
        guard = SmearGuard(self.journal.record)
        for m in measure(
            self.feed.bursts(),
            kernel,
            self.loads,
            noise_GL=noise_GL,
            correct=self._correct,
            renew_at=self.config.measure.renew_at,
            on_event=self.journal.record,
            timer=time.perf_counter,
        ):
            self.ledger.add(measured=m.burst.n)
            self._told_measured(m.burst)
            self._show(outputs.add(m))
            guard.look(m.burst)
            for watcher in self._watchers:
                watcher(m)

    def _told_measured(self, burst: Burst) -> None:
        data = {"first": burst.first_index, "last": burst.last_index, "n": burst.n}
        text = f"frames {burst.first_index} to {burst.last_index}"
        self.journal.record(Event(burst.t, EventKind.MEASURED, "measurement", text, "info", data))

    def _idle(self, words: str) -> None:
        """Between bursts; a camera that gives nothing must not keep a timed run alive for ever."""
        if words:
            self.screen.waiting(self.ledger, words)
        if time.monotonic() > self._deadline and not self._stopping.is_set():
            self.stop("the time is over")

    def _show(self, instant: Instant) -> None:
        assert self.grabber is not None
        self.screen.instant(instant, self.ledger, self.grabber.fps)

    def _close(self, rig: Rig, outputs: Outputs, recorder: Recorder | None) -> None:
        """Close everything, whatever happened before; the recording last, so that it knows all."""
        self._stopping.set()
        rig.camera.stop()
        rig.load.stop()
        if self.grabber is not None:
            self.grabber.bursts.close()
            self.grabber.join()
            self.feed.count_skipped()
            self._load_thread.join()
        self.loads.close()
        outputs.close()
        self.journal.tell(EventKind.STOP, "phasedic", f"the test ends: {self._stop_reason or 'camera ended'}")
        if recorder is not None:
            recorder.close({"stop_reason": self._stop_reason or "camera ended"})

    def _exit_code(self, recorder: Recorder | None, outputs: Outputs) -> int:
        error = self.grabber.error if self.grabber else None
        if error is not None:
            return error.exit_code if isinstance(error, PhasedicError) else 1
        if self._failure:
            return self._failure
        if self._stop_reason == "interrupted":
            return 130
        lossy = self.ledger.loss or outputs.failed or (recorder is not None and recorder.failed is not None)
        return 5 if lossy or not self.ledger.adds_up else 0
