"""The measurer of a camera: its thread takes a reference without motion, then measures burst after burst."""

from __future__ import annotations

import itertools
import logging
import math
import threading
import time

from acquire.burst import LIMIT_PX
from acquire.errors import DEFECT, PhasedicError, TooLittleMemory
from acquire.events import Event, EventKind, EventSink, Level
from acquire.frame import Burst
from acquire.system import lower_priority
from acquire.text import Message
from live.pipeline.latency import MEASURE, LatencyMonitor, LatencySample
from live.pipeline.measure import NewReference
from live.pipeline.measurement import Measurement
from live.pipeline.reference import ReferenceBurst, ReferenceMotion, blank_text, held_memory, motion_between
from live.pipeline.run_state import RunState
from live.results.folder import BurstFailures
from live.run.incoming_bursts import IncomingBursts
from live.run.outcome import StopSignal
from live.run.prepared_run import PreparedRun
from live.setup.prepared import PreparedKernel
from live.stream.stream import Stream

log = logging.getLogger(__name__)
TRIES, NOT_MEASURED = 3, Message("fast motion, glare, no focus?")


class ReferenceSelector:
    """Takes references until one is still.

    Parameters
    ----------
    prepared : PreparedRun
    run_state : RunState
    incoming : IncomingBursts
    """

    def __init__(self, prepared: PreparedRun, run_state: RunState, incoming: IncomingBursts) -> None:
        self._prepared, self._run_state, self._incoming = prepared, run_state, incoming
        plan = prepared.plan
        self._held = held_memory(plan.width * plan.height, plan.kernel_grid.n_active)

    def take(self) -> PreparedKernel | None:
        """The kernel on it; None where the run ended before there was a reference.

        Raises
        ------
        DataError
            There is no pattern.
        ConfigError
            The grid does not fit.
        """
        reference = self._incoming.next_reference()
        self._held = None
        if reference is None:
            text = Message(
                "the camera ended before the reference was complete ({grabbed} frames)",
                self._run_state.frame_counts.grabbed,
            )
            self._run_state.event_log.emit(EventKind.MEASUREMENT, "reference", text, "error")
            return None
        what = Message("the reference from {address}", self._prepared.config.camera.address)
        for attempt in itertools.count(1):
            blank = blank_text(reference.burst)
            ready = None if blank else self._prepared.plan.on(reference.burst, what)
            motion = ReferenceMotion(math.nan) if ready is None else _motion(ready, reference)
            if motion.px <= self._prepared.config.measure.reference_shift_px:
                if motion.pulled:  # the test has begun: the next one would be under more load
                    self._moved(motion)
                break
            again = self._another(motion, attempt, blank)
            if again is None and math.isnan(motion.px):
                text = Message(
                    "no reference could be measured; keep the specimen still, look at light and focus"
                )
                self._run_state.event_log.emit(EventKind.MEASUREMENT, "reference", text, "error")
                return None
            if again is None:
                self._moved(motion)
                break
            self._run_state.frame_counts.add(reference=-reference.burst.n, left_out=reference.burst.n)
            reference = again
        self._report(reference.burst, motion)
        return ready

    def _another(self, motion: ReferenceMotion, attempt: int, blank: str) -> ReferenceBurst | None:
        """The next reference; None where the run ends, or where one that moved must be used.

        A reference that cannot be measured is never used: the next one is tried until one is good.
        """
        if attempt >= TRIES and not math.isnan(motion.px):
            return None
        what = Message("the picture moved by {amount} px during the reference burst", motion.amount)
        if math.isnan(motion.px):
            what = Message("the reference burst cannot be measured ({why})", blank or NOT_MEASURED)
        if attempt < TRIES:
            self._run_state.event_log.emit(
                EventKind.MEASUREMENT, "reference", Message("{what}; taking another", what), "warning"
            )
        elif attempt == TRIES:
            text = Message("{what}; tried again until the picture is still", what)
            self._run_state.event_log.emit(EventKind.MEASUREMENT, "reference", text, "error")
        return self._incoming.retake_reference()

    def _moved(self, motion: ReferenceMotion) -> None:
        text = Message(
            "the specimen moved by {amount} px while the reference was taken: keep it still for these frames",
            motion.amount,
        )
        self._run_state.event_log.emit(EventKind.MEASUREMENT, "reference", text, "warning")

    def _report(self, burst: Burst, motion: ReferenceMotion) -> None:
        force, n = self._run_state.loads.mean(burst.t - burst.duration / 2, burst.t + burst.duration / 2)
        data = {
            "first": burst.first_index,
            "last": burst.last_index,
            "n": burst.n,
            "noise_GL": _or_none(burst.noise),
            "force_N": _or_none(force),
            "shift_px": _or_none(motion.px),
        }
        noise = (
            Message(", noise of one {noise:.2f} GL, motion {px:.4f} px", burst.noise, motion.px)
            if burst.n > 1
            else ""
        )
        text = Message("reference: {n} frames{noise}", burst.n, noise) + (
            Message(", force {force:.2f} N", force) if n else ""
        )
        self._run_state.event_log.record(
            Event(burst.t, EventKind.REFERENCE, "measurement", text, "info", data)
        )


def _motion(ready: PreparedKernel, reference: ReferenceBurst) -> ReferenceMotion:
    """The motion within the burst; NaN where it cannot be measured, and then it is not still."""
    if reference.halves is None:
        return ReferenceMotion(0.0)
    return motion_between(ready.kernel, *reference.halves, ready.plan.correct)


def _or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None


class SmearWatch:
    """Checks the motion during each measured burst; an event when smear begins and when it ends.

    A motion v during T multiplies the contrast at wave number k by |sinc(k v T / 2)|: negligible up to
    0.05 px. The motion is estimated with each burst (``acquire.burst.accumulate``).

    Parameters
    ----------
    on_event : callable taking an Event
    limit_px : float, px
    """

    def __init__(self, on_event: EventSink, limit_px: float = LIMIT_PX) -> None:
        self._on_event, self._limit = on_event, limit_px
        self._smeared = False

    def check(self, burst: Burst) -> None:
        """Check a burst; one whose motion is not known changes nothing."""
        smeared = burst.motion_px > self._limit
        # Hysteresis: a motion near the limit does not repeat the events.
        calm = burst.motion_px < 0.8 * self._limit
        if smeared and not self._smeared:
            text = Message(
                "the picture moves {motion_px:.2f} px during a burst of {n}; take shorter bursts",
                burst.motion_px,
                burst.n,
            )
            self._emit(burst, text, "warning")
        elif calm and self._smeared:
            self._emit(burst, Message("the picture stands still enough again during a burst"), "info")
        self._smeared = smeared or (self._smeared and not calm)

    def _emit(self, burst: Burst, text: str, level: Level) -> None:
        data = {"motion_px": burst.motion_px, "n": burst.n}
        self._on_event(Event(burst.t, EventKind.MEASUREMENT, "burst", text, level, data))


class Measurer:
    """Measures the bursts of the queue; a failure here never ends the recording.

    Parameters
    ----------
    prepared : PreparedRun
    run_state : RunState
    incoming : IncomingBursts
    latency : LatencyMonitor
    stream : Stream
        Takes each Measurement.
    stop : StopSignal
        Ends the test where the reference cannot be used: the start has failed.
    name : str
        Of the camera in the stream.

    Attributes
    ----------
    failure : int
        1 where a defect ended the measurement, else 0.
    """

    def __init__(
        self,
        prepared: PreparedRun,
        run_state: RunState,
        incoming: IncomingBursts,
        latency: LatencyMonitor,
        stream: Stream,
        stop: StopSignal,
        name: str = "",
    ) -> None:
        self._prepared, self._run_state, self._incoming = prepared, run_state, incoming
        self._latency, self._stream, self._stop, self._name = latency, stream, stop, name
        self.failure = 0
        self._refused: PhasedicError | None = None
        self._thread = threading.Thread(target=self._work, name="measure", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def join(self) -> None:
        """Wait for the end of the camera.

        Raises
        ------
        PhasedicError
            The reference cannot be used: the start has failed.
        """
        self.end()
        if self._refused is not None:
            raise self._refused

    def end(self) -> None:
        """Wait until nothing more is measured, where it was started."""
        if self._thread.ident is not None:
            self._thread.join()

    def _work(self) -> None:
        lower_priority(MEASURE)
        try:
            ready = ReferenceSelector(self._prepared, self._run_state, self._incoming).take()
            if ready is None:
                self._incoming.skip_rest()
            else:
                self._measure(ready)
        except TooLittleMemory as error:
            self.failure = DEFECT
            text = Message("nothing is measured, recording goes on: {error}", error)
            self._run_state.event_log.emit(EventKind.MEASUREMENT, "measurement", text, "error")
            self._incoming.skip_rest()
        except PhasedicError as error:
            self._refused = error
            self._stop.request(Message("the start failed"))
        except Exception as error:
            log.exception("the measurement failed")
            self.failure = DEFECT
            text = Message("measuring has stopped by a defect, recording goes on: {error}", repr(error))
            self._run_state.event_log.emit(EventKind.MEASUREMENT, "measurement", text, "error")
            self._incoming.skip_rest()

    def _measure(self, ready: PreparedKernel) -> None:
        event_log = self._run_state.event_log
        guard = SmearWatch(event_log.record)
        failures = BurstFailures(self._run_state, self._prepared.folder)

        def failed(number: int, item: Burst | NewReference, error: Exception) -> None:
            failures(number, item, error)
            if isinstance(item, Burst):
                event_log.record(
                    _measured(item)
                )  # replay --as-measured tries it too, and is as far as this run

        bursts, loads = self._incoming.bursts(), self._run_state.loads
        for m in ready.measurements(bursts, loads, event_log.record, failed):
            self._run_state.frame_counts.add(measured=m.burst.n)
            event_log.record(_measured(m.burst))
            m = self._timed(m)
            self._stream.publish(m, self._name)
            guard.check(m.burst)
            self._check_latency(m)

    def _timed(self, m: Measurement) -> Measurement:
        """With its latency, where the frames were stamped by a clock of this machine."""
        if m.burst.clock == "nominal":
            return m
        return m.with_latency(time.monotonic() - (m.t + m.burst.duration / 2))

    def _check_latency(self, m: Measurement) -> None:
        if math.isnan(m.time_step.latency_s):
            return
        sample = LatencySample(m.t, m.time_step.latency_s, m.time_step.measure_s)
        period_s = m.burst.n / max(self._run_state.health.fps, 1e-3)
        warning = self._latency.check(sample, period_s, newest_only=self._incoming.newest_only)
        self._run_state.health.latency_p95_s = self._latency.p95_s
        if warning:
            event = Event(m.t, EventKind.MEASUREMENT, "measurement", warning, "warning")
            self._run_state.event_log.record(event)


def _measured(burst: Burst) -> Event:
    data = {"first": burst.first_index, "last": burst.last_index, "n": burst.n, "lost": burst.lost}
    text = Message("frames {first_index} to {last_index}", burst.first_index, burst.last_index)
    return Event(burst.t, EventKind.MEASURED, "measurement", text, "info", data)
