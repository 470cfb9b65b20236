"""Camera and load cell as sources of the stream, each with a thread that publishes what the device gives.

That of a camera publishes each frame and the bursts that it averages them to. It does nothing else, so that the camera
never waits. The reference is taken from the first frames, and again on demand; all frames after it become bursts. The
samples of the load cell are those of every camera.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from dataclasses import dataclass, replace

import numpy as np

from acquire.burst import PictureMemory, SumAccumulator, nothing_clipped, sum_kind
from acquire.camera import Camera, missing_at_end
from acquire.errors import PhasedicError
from acquire.events import EventKind, RateLimiter
from acquire.frame import Burst, CameraInfo, Frame, frozen
from acquire.load_cell import LoadCell
from acquire.system import lower_priority
from acquire.text import Message
from acquire.text.message import counted
from live.config.loading import Config
from live.pipeline.latency import LOAD
from live.pipeline.reference import ReferenceTaker
from live.pipeline.run_state import RunState
from live.stream.stream import CameraEnded, LoadEnded, Record, ReferenceWanted, Role, Stream, Subscriber

log = logging.getLogger(__name__)

HELD_BYTES, HELD_S, A_MEGAPIXEL_S, LATE_S = 512_000_000, 1.0, 0.25, 0.25
"""Limits of the bursts that wait: bytes; s while the first is prepared, longer for a large reference; s later."""
_AT_WORK, _MEASURED, _OF_REFERENCE = 2, 3, 3
"""Bursts beside those that wait: summed, taken; measured, the one before, and shown; a reference with its halves."""


class LoadSource:
    """Reads ``cell`` in its own thread; a failure there never ends the images.

    Parameters
    ----------
    cell : LoadCell
    stream : Stream
        Takes each LoadSample, and LoadEnded at the end.
    """

    def __init__(self, cell: LoadCell, stream: Stream) -> None:
        self._cell, self._stream = cell, stream
        self._thread = threading.Thread(target=self._work, name="load", daemon=True)

    def start(self) -> None:
        """Begin; the load cell must have been entered."""
        self._thread.start()

    def stop(self) -> None:
        """End it."""
        self._cell.stop()

    def join(self) -> None:
        """Wait for the end, where it was started."""
        if self._thread.ident is not None:
            self._thread.join()

    def _work(self) -> None:
        lower_priority(LOAD)
        error: Exception | None = None
        try:
            for sample in self._cell:
                self._stream.publish(sample)
        except Exception as found:
            if not isinstance(found, PhasedicError):
                log.exception("the load thread failed")
            error = found
        finally:
            self._stream.publish(LoadEnded(error))


@dataclass(frozen=True, slots=True)
class GrabPlan:
    """How frames become bursts.

    Attributes
    ----------
    burst, reference_burst : int
        Frames in each.
    seconds : float, s
        The run ends after this time of frames.
    """

    burst: int
    reference_burst: int
    seconds: float = math.inf

    @classmethod
    def of(cls, config: Config, bursts: tuple[int, int]) -> GrabPlan:
        """The plan of a configuration; ``bursts`` are the frames in the reference and in a measured burst."""
        reference, burst = bursts
        seconds = math.inf if config.output.seconds is None else config.output.seconds
        return cls(burst, reference, seconds)


def held_at_first(camera: CameraInfo, plan: GrabPlan) -> int:
    """Bursts that may wait while the reference is prepared, for about as long as that takes."""
    return held_bursts(camera, plan, max(HELD_S, A_MEGAPIXEL_S * camera.width * camera.height / 1e6))


def held_bursts(camera: CameraInfo, plan: GrabPlan, seconds: float) -> int:
    """Bursts of ``seconds`` that may wait: the sum of each, and the bits of clipped pixels."""
    bound = int(HELD_BYTES / (_bytes_a_pixel(camera, plan) * camera.width * camera.height))
    return max(1, min(bound, math.ceil(seconds * (camera.fps or 0) / plan.burst)))


def _bytes_a_pixel(camera: CameraInfo, plan: GrabPlan) -> float:
    """What a burst that waits takes at most; one of a single frame is the frame."""
    if plan.burst == 1:
        return 1 + (camera.bits > 8)
    return sum_kind(camera.bits, plan.burst).itemsize + 1 / 8


def _memory_for(camera: CameraInfo, plan: GrabPlan) -> PictureMemory:
    """Memory of the bursts that may wait, so that the first ones take no longer to average than all others."""
    memory, shape = PictureMemory(), (camera.height, camera.width)
    if plan.burst > 1:
        bursts = _AT_WORK + held_at_first(camera, plan)
        memory.prepare(bursts, shape, sum_kind(camera.bits, plan.burst))
    for kind in (np.bool_, np.float32, np.uint32):
        memory.prepare(_OF_REFERENCE, shape, kind)
    return memory


def memory_of_measured(camera: CameraInfo, plan: GrabPlan) -> PictureMemory:
    """Memory of the bursts that are measured and shown, of the measuring thread; see ``_memory_for``."""
    memory, shape = PictureMemory(), (camera.height, camera.width)
    nothing_clipped(shape).any()
    if camera.live:
        memory.prepare(_MEASURED, shape, np.bool_)
        memory.prepare(_MEASURED * (plan.burst > 1), shape, np.float32)
    return memory


def _of_size(frame: Frame, camera: CameraInfo) -> Frame:
    """The frame; a black one that is marked as damaged where its picture is not of the camera's size."""
    if frame.image.shape == (camera.height, camera.width):
        return frame
    black = frozen(np.zeros((camera.height, camera.width), frame.image.dtype))
    return replace(frame, image=black, damaged=True)


class CameraSource(Subscriber):
    """Runs a camera in its own thread.

    Parameters
    ----------
    camera : Camera
        Entered before ``start``.
    plan : GrabPlan
    run_state : RunState
        Takes counts and events.
    stream : Stream
        Takes Frame, SummedBurst and ReferenceBurst, Burst where someone takes means, and CameraEnded at the end.
    name : str
        Of the camera in the stream.

    Attributes
    ----------
    error : Exception or None
        The error that ended the camera.
    begun_t, arrived_t : float, s
        When the first and the last frame arrived, monotonic; before the first when it was started.
    time_is_over : bool
        The frames of ``plan.seconds`` have come.
    """

    takes = (ReferenceWanted,)

    def __init__(
        self, camera: Camera, plan: GrabPlan, run_state: RunState, stream: Stream, name: str = ""
    ) -> None:
        self._camera, self._plan, self._stream, self._name = camera, plan, stream, name
        self._event_log, self._frame_counts = run_state.event_log, run_state.frame_counts
        self._health = run_state.health
        self._health.recorded = not camera.info.live
        if camera.info.fps:  # the usual intervals until they are known
            self._health.frames.usual_s = 1 / camera.info.fps
            run_state.history.arrivals.usual_s = plan.burst / camera.info.fps
        self._memory = _memory_for(camera.info, plan) if camera.info.live else PictureMemory()
        self.error: Exception | None = None
        self._taker: ReferenceTaker | None = ReferenceTaker(plan.reference_burst, self._memory)
        self._accumulator = SumAccumulator(plan.burst, memory=self._memory)
        self._unassigned, self.time_is_over = 0, False
        self._limiter, self._unreported = RateLimiter(), 0
        self._damage_limiter, self._damaged, self._damage_told = RateLimiter(), 0, False
        self.begun_t = self.arrived_t = math.nan
        self._first_t: float | None = None
        self._retake = threading.Event()
        self._thread = threading.Thread(target=self._work, name="grab", daemon=True)
        stream.add(self, name)

    def start(self) -> None:
        """Begin to take frames from the camera, which must have been entered."""
        self.begun_t = self.arrived_t = time.monotonic()
        self._thread.start()

    def take(self, record: Record) -> None:
        """Make the next frames a reference burst."""
        self._retake.set()

    def join(self) -> None:
        """Wait for the end, where it was started."""
        if self._thread.ident is not None:
            self._thread.join()

    @property
    def running(self) -> bool:
        """Whether frames may still arrive."""
        return self._thread.is_alive()

    def _work(self) -> None:
        try:
            for frame in self._camera:
                self._take(frame)
                self._first_t = frame.t if self._first_t is None else self._first_t
                self.time_is_over = frame.t - self._first_t >= self._plan.seconds
                if self.time_is_over:
                    break
        except PhasedicError as error:
            self._ended_by(error, error.text)
        except Exception as error:
            log.exception("the grab thread failed")
            self._ended_by(error, Message("a defect in the grab thread: {error}", repr(error)))
        finally:
            self._health.camera_ended = True
            self._count_open_gap(time.monotonic() - self.arrived_t)
            self._frame_counts.add(left_out=self._unassigned)
            self._stream.publish(CameraEnded(), self._name)

    def _ended_by(self, error: Exception, text: str) -> None:
        self.error, self._health.camera_failed = error, True
        self._event_log.emit(EventKind.DEVICE, self._camera.info.address, text, "error")

    def _count_open_gap(self, silent_s: float) -> None:
        """Count the frames of a camera that is away, or has stalled, when the test ends."""
        missing = missing_at_end(self._camera.info, silent_s)
        if missing:
            self._frame_counts.add(lost=missing)
            text = Message(
                "{counted} lost at the end: none came for the last {silent_s:.1f} s",
                counted(missing, "frame"),
                silent_s,
            )
            data = {"count": missing, "where": "end"}
            self._event_log.emit(EventKind.LOST, self._camera.info.address, text, "warning", data)

    def _take(self, frame: Frame) -> None:
        self.arrived_t = time.monotonic()
        if self._first_t is None:
            self.begun_t = self.arrived_t
        frame = _of_size(frame, self._camera.info)
        self._frame_counts.add(grabbed=1, lost=frame.lost_before + frame.damaged)
        if frame.lost_before:
            self._report_loss(frame)
        self._report_damage(frame)
        if self._retake.is_set():
            self._retake.clear()
            self._taker = ReferenceTaker(self._plan.reference_burst, self._memory)
        # Decided here, once: who records the frame and who averages it must not see different answers.
        role: Role = "plain" if self._taker is None else "reference"
        self._stream.publish(frame, self._name, role)
        self._unassigned += 1
        if self._taker is not None:
            self._feed_reference(self._taker, frame)
        elif (burst := self._accumulator.add(frame)) is not None:
            self._used(burst.n)
            if self._stream.wants(Burst, self._name):
                self._stream.publish(burst.burst(self._memory), self._name)
            self._stream.publish(burst, self._name)

    def _report_loss(self, frame: Frame) -> None:
        """Emit the lost frames at most every two seconds; the session has every gap."""
        self._unreported += frame.lost_before
        if not self._limiter.due(frame.t):
            return
        text = Message(
            "{counted} lost, the last before frame {index}", counted(self._unreported, "frame"), frame.index
        )
        data = {"count": self._unreported, "before": frame.index}
        self._event_log.emit(EventKind.LOST, self._camera.info.address, text, "warning", data)
        self._unreported = 0

    def _report_damage(self, frame: Frame) -> None:
        """Emit that damaged pictures begin, at most every two seconds, and then that they have ended."""
        if frame.damaged:
            self._damaged += 1
            if not self._damage_told and self._damage_limiter.due(frame.t):
                self._damage_told = True
                self._emit_damage(
                    Message("pictures come damaged from frame {index} on; they count as lost", frame.index),
                    1,
                    frame,
                )
        elif self._damage_told:
            text = Message(
                "whole pictures again from frame {index} on, {counted} came damaged",
                frame.index,
                counted(self._damaged, "frame"),
            )
            self._emit_damage(text, self._damaged, frame)
            self._damaged, self._damage_told = 0, False

    def _emit_damage(self, text: str, count: int, frame: Frame) -> None:
        data = {"count": count, "before": frame.index, "damaged": True}
        self._event_log.emit(EventKind.LOST, self._camera.info.address, text, "warning", data)

    def _feed_reference(self, taker: ReferenceTaker, frame: Frame) -> None:
        reference = taker.add(frame)
        if reference is None:
            return
        self._used(reference.burst.n)
        self._frame_counts.add(reference=reference.burst.n)
        self._taker, self._accumulator = None, SumAccumulator(self._plan.burst, memory=self._memory)
        self._stream.publish(reference.burst, self._name, "reference")
        self._stream.publish(reference, self._name)

    def _used(self, n: int) -> None:
        self._frame_counts.add(left_out=self._unassigned - n)
        self._unassigned = 0
