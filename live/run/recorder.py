"""The recording: a byte-bounded buffer and one thread that writes the session.

When the buffer or the disk is full, the recorder counts what it cannot write and emits an event; the
measurement goes on.
"""

from __future__ import annotations

import dataclasses
import logging
import math
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from acquire.clock import Clock, ClockPair
from acquire.errors import DataError
from acquire.events import Event, EventKind
from acquire.frame import Burst, CameraInfo, Frame
from acquire.hdf5 import forecast, network_share
from acquire.load_sample import LoadSample
from acquire.record_mode import RecordMode
from acquire.session import RotatingWriter, SessionInfo, SessionWriter
from acquire.text import Message
from live.pipeline.consumer import Screen
from live.pipeline.event_log import EventLog
from live.pipeline.queues import BoundedQueue
from live.pipeline.run_state import FrameCounts, RunState
from live.pipeline.timed.figure import TimedFigure
from live.pipeline.timed.health import DISK_EVERY_S, Health
from live.results.folder import versions
from live.run.outcome import StopSignal
from live.run.pre_trigger import PreTrigger, PreTriggerBuffer
from live.run.prepared_run import PreparedRun

log = logging.getLogger(__name__)
_SMALL = 512  # bytes counted for a sample or an event
TELL_S = 5.0  # between two words on what is still to be written
_MAX_WAIT_S = 0.5
_CLOCK_EVERY_S = 60.0
_DISK_WARN_S = 180.0

Item = Frame | Burst | LoadSample | Event


def open_recording(
    prepared: PreparedRun, run_state: RunState, screen: Screen, stop: StopSignal
) -> PreTriggerBuffer | None:
    """The configured recording, in the folder of the run; None where recording is off.

    Raises
    ------
    DataError
        The file exists, or cannot be made.
    """
    record, camera = prepared.config.record, prepared.rig.camera.info
    if not record.enabled:
        return None
    path, mode = prepared.folder / "session.h5", RecordMode.parse(record.mode)
    writer = _open_writer(path, prepared, mode)
    run_state.health.room(time.monotonic(), _announce_disk(path, camera, mode, screen))
    recorder = Recorder(
        writer,
        run_state.frame_counts,
        run_state.event_log,
        int(record.buffer_MB * 1e6),
        mode=mode,
        waits=not camera.live,
        stop=stop if record.when_full == "stop" else None,
        health=run_state.health,
    )
    settings = PreTrigger(
        record.keep_s, int(record.buffer_MB * 5e5), record.start_above_N or math.inf, mode.kind == "bursts"
    )

    def force() -> TimedFigure:
        return run_state.force(time.monotonic())

    return PreTriggerBuffer(
        recorder, run_state.frame_counts, run_state.event_log, settings, on=not record.armed, force=force
    )


def _open_writer(path: Path, prepared: PreparedRun, mode: RecordMode) -> SessionWriter | RotatingWriter:
    """A new session file, or a set of files with a new file at a given size."""
    config, rotate_MB = prepared.config, prepared.config.record.rotate_MB
    info = SessionInfo(
        camera=prepared.rig.camera.info,
        load=prepared.rig.load.info,
        start=prepared.start,
        config=config.as_dict(),
        metadata=dict(config.metadata),
        versions=versions(),
        mode=dataclasses.replace(mode, cycles=0),  # the file has bursts, whichever were chosen
    )
    if rotate_MB is None:
        return SessionWriter(path, info)
    return RotatingWriter(path, info, int(rotate_MB * 1e6))


def _announce_disk(path: Path, camera: CameraInfo, mode: RecordMode, screen: Screen) -> float:
    """Show how long the disk lasts, and warn of a network share; the time, s."""
    rate = camera.width * camera.height * (2 if camera.bits > 8 else 1) * (camera.fps or 30.0) / mode.every
    minutes = forecast(path, rate) / 60
    where = Message(
        "recording about {rate:.0f} MB/s at most, room for {minutes:.0f} minutes", rate / 1e6, minutes
    )
    screen.print(Message("warning: {where}", where) if minutes < 30 else where)
    if share := network_share(path):
        screen.print(
            Message(
                "warning: {parent} is on a network share ({share}); a local disk is safer", path.parent, share
            )
        )
    return minutes * 60


class Recorder:
    """Writes frames, load samples and events in its own thread.

    Parameters
    ----------
    writer : SessionWriter or RotatingWriter
        Used from the recorder's thread only, and closed by it.
    mode : RecordMode
        Which frames are written, or bursts in their place.
    frame_counts : FrameCounts
    event_log : EventLog
        Takes events on gaps and on a full disk.
    limit : int, bytes
        Size of the buffer.
    waits : bool
        Wait for free space instead of leaving a gap (sources that wait for their reader).
    stop : StopSignal, optional
        Requested when nothing more can be written.
    health : Health, optional
        Takes the time until the disk is full.
    now : callable
        The clock, s.
    """

    def __init__(
        self,
        writer: SessionWriter | RotatingWriter,
        frame_counts: FrameCounts,
        event_log: EventLog,
        limit: int,
        *,
        mode: RecordMode | None = None,
        waits: bool = False,
        stop: StopSignal | None = None,
        health: Health | None = None,
        now: Clock = time.monotonic,
    ) -> None:
        self._writer, self._frame_counts, self._event_log = writer, frame_counts, event_log
        self._buffer: BoundedQueue[Item] = BoundedQueue(limit, waits=waits)
        self._limit, self._stop = limit, stop
        self._mode = mode or RecordMode()
        self._number = self._gap = 0
        self._health, self._now = health or Health(), now
        self._began = now()
        self._next_clock = self._began + _CLOCK_EVERY_S
        self._next_disk = self._began + DISK_EVERY_S
        self._disk_warned = False
        self._wait_s = _MAX_WAIT_S
        self.failed: str | None = None
        self._thread = threading.Thread(target=self._work, name="record", daemon=True)
        self._thread.start()

    def frame(self, frame: Frame) -> None:
        """Queue a frame, where the mode keeps it; one that does not fit is part of a counted gap."""
        self._number += 1
        if not self._mode.keeps(self._number - 1):
            self._frame_counts.add(thinned=1)
        elif not self._queued(frame, frame.image.nbytes, 1, frame.index):
            self._frame_counts.add(unrecorded=1)

    def burst(self, burst: Burst) -> None:
        """Queue a burst, where bursts are what is recorded; its frames then count as recorded."""
        if self._mode.kind == "bursts" and not self._queued(
            burst, burst.mean.nbytes, burst.n, burst.first_index
        ):
            self._frame_counts.add(unrecorded=burst.n, thinned=-burst.n)

    def _queued(self, item: Frame | Burst, size: int, n: int, index: int) -> bool:
        if self.failed is None and self._buffer.put(item, size):
            self._end_gap()
            return True
        if self._gap == 0 and self.failed is None:
            text = Message("the disk is too slow, frames are not recorded; measuring goes on")
            self._event_log.emit(EventKind.RECORDER, "recorder", text, "error", {"from": index})
        self._gap += n
        return False

    def _end_gap(self) -> None:
        if not self._gap:
            return
        text = Message("recording again after {gap} frames that are not in the session", self._gap)
        self._event_log.emit(EventKind.RECORDER, "recorder", text, "warning", {"count": self._gap})
        self._gap = 0

    def sample(self, sample: LoadSample) -> None:
        """Queue a load sample."""
        self._buffer.put(sample, _SMALL + len(sample.raw), always=True)

    def event(self, event: Event) -> None:
        """Queue an event."""
        self._buffer.put(event, _SMALL, always=True)

    @property
    def backlog(self) -> float:
        """Share of the buffer that waits for the disk."""
        return self._buffer.waiting_bytes / self._limit

    @property
    def waiting_bytes(self) -> int:
        """Bytes that wait for the disk."""
        return self._buffer.waiting_bytes

    def close(self, frame_counts: dict[str, Any]) -> None:
        """Write what is queued, then the frame counts, and close the file."""
        self._buffer.close()
        self._thread.join(TELL_S)
        while self._thread.is_alive():
            waiting = self.waiting_bytes
            self._thread.join(TELL_S)
            rate = (waiting - self.waiting_bytes) / TELL_S
            log.info(
                Message(
                    "{left:.0f} MB still wait for the disk, written at {rate:.2g} MB/s; wait for the end",
                    self.waiting_bytes / 1e6,
                    rate / 1e6,
                )
            )
        if self.failed is None:
            with self._guarded():
                self._writer.write_ledger(frame_counts | self._frame_counts.as_dict())
            with self._guarded():
                self._writer.write_clock(ClockPair.now())
        with self._guarded():
            self._writer.close()

    def _work(self) -> None:
        with self._guarded():
            self._writer.write_clock(ClockPair.now())
        while not self._buffer.finished:
            item = self._buffer.get(self._wait_s)
            if item is not None:
                self._write(item)
            if self.failed is None:
                with self._guarded():  # by time too: the last item must not wait for another one
                    self._wait_s = min(_MAX_WAIT_S, self._writer.flush_when_due())
                self._do_periodic(self._now())

    def _do_periodic(self, now: float) -> None:
        if now > self._next_clock:
            self._next_clock += _CLOCK_EVERY_S
            with self._guarded():
                self._writer.write_clock(ClockPair.now())
        if now > self._next_disk:
            self._next_disk = now + DISK_EVERY_S
            with self._guarded():  # a file that is gone is noticed where nothing is written, too
                self._writer.flush()
            self._check_disk(now - self._began)

    def _check_disk(self, elapsed_s: float) -> None:
        rate = self._writer.bytes_written / elapsed_s
        left = forecast(self._writer.path, rate)
        self._health.room(self._now(), left)
        if left < _DISK_WARN_S and not self._disk_warned:
            text = Message(
                "the disk is full in {left:.0f} s at this rate; free some space, the recording goes on", left
            )
            self._event_log.emit(
                EventKind.RECORDER, str(self._writer.path), text, "warning", {"seconds": left}
            )
        self._disk_warned = left < _DISK_WARN_S

    def _write(self, item: Item) -> None:
        written = False
        if self.failed is None:
            with self._guarded():
                self._put(item)
                written = True
        if isinstance(item, Frame):
            self._frame_counts.add(**{"recorded" if written else "unrecorded": 1})
        elif isinstance(item, Burst):
            self._frame_counts.add(**{"recorded" if written else "unrecorded": item.n, "thinned": -item.n})

    def _put(self, item: Item) -> None:
        if isinstance(item, Frame):
            self._writer.write_frame(item)
        elif isinstance(item, Burst):
            self._writer.write_burst(item)
        elif isinstance(item, LoadSample):
            self._writer.write_load(item)
        else:
            self._writer.write_event(item)

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        """Around one write; the first one that fails ends only the recording, and is reported."""
        try:
            yield
        except DataError as error:
            self._fail(error.text)
        except Exception as error:
            log.exception("the recorder failed")
            self._fail(Message("a defect of the recorder: {error}", repr(error)))

    def _fail(self, why: str) -> None:
        if self.failed is not None:
            return
        self.failed = why
        lost = self._writer.unflushed_frames  # written, and gone with the file
        self._frame_counts.add(recorded=-lost, unrecorded=lost)
        text = Message("recording has stopped, measuring goes on: {why}", why)
        self._event_log.emit(EventKind.RECORDER, "recorder", text, "error")
        if self._stop is not None:
            self._stop.request(Message("recording failed"))
