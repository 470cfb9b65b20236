"""Consumers at work: each with its thread and queues, and ``Outputs``, which passes the data of a test to all."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from typing import Any

from acquire.errors import PhasedicError
from acquire.events import Event, EventKind
from acquire.frame import Frame
from acquire.load_cell import LoadLog
from acquire.load_sample import LoadSample
from acquire.system import lower_priority
from live.pipeline.consumer import KINDS, Consumer, ConsumerReport, Policy, kinds_taken
from live.pipeline.event_log import EventLog
from live.pipeline.history import History
from live.pipeline.latency import OUTPUT
from live.pipeline.measurement import ForceMatching, Measurement, TimeStep

log = logging.getLogger(__name__)

MAX_SAMPLES, MAX_EVENTS = 20_000, 1000
_LOAD_POLL_S = 0.1  # load samples do not wake the thread

OnFailure = Callable[[str, str, bool], None]
"""Called with the consumer's name, what went wrong, and whether the consumer is critical."""


class ConsumerThread:
    """Passes data on to one consumer according to its policy, and never raises.

    Parameters
    ----------
    consumer : Consumer
    on_failure : callable
        Called once if the consumer fails.
    """

    def __init__(self, consumer: Consumer, on_failure: OnFailure) -> None:
        self._consumer, self._on_failure = consumer, on_failure
        self._kinds = kinds_taken(consumer)
        self._waiting: dict[str, deque[Any]] = {kind: deque() for kind in KINDS}
        self._max = {"event": MAX_EVENTS, "load": MAX_SAMPLES, "frame": 1}
        self._taken: Counter[str] = Counter()
        self._dropped: Counter[str] = Counter()
        self._failed = self._summary = ""
        self._changed = threading.Condition()
        self._ending = False
        self._idle_s = math.inf
        self._thread = threading.Thread(target=self._work, name=consumer.name, daemon=True)

    def start(self) -> None:
        """Begin to take data."""
        if self._consumer.blocks:
            self._thread.start()
        else:
            self._guarded(self._consumer.begin)

    def wants(self, kind: str) -> bool:
        """Whether data of this kind is still taken."""
        return kind in self._kinds and not self._failed and not self._ending

    def give(self, kind: str, item: Any) -> None:
        """Deliver or queue ``item``; blocks only with ``Policy.WAIT``."""
        if not self.wants(kind):
            return
        if not self._consumer.blocks:
            self._deliver(kind, item)
            return
        with self._changed:
            if self._make_room(kind):
                self._waiting[kind].append(item)
            if kind != "load":
                self._changed.notify_all()

    def _make_room(self, kind: str) -> bool:
        """Apply the policy to a full queue; False where the new item is refused."""
        queue, limit = self._waiting[kind], self._max.get(kind, self._consumer.queue_size)
        if len(queue) < limit:
            return True
        if kind not in self._max and self._consumer.policy is Policy.WAIT:
            self._changed.wait_for(lambda: len(queue) < limit or bool(self._failed) or self._ending)
            return True
        self._dropped[kind] += 1
        if kind not in self._max and self._consumer.policy is Policy.BOUNDED:
            return False
        queue.popleft()
        return True

    def end(self) -> ConsumerReport:
        """Deliver what is queued, end the consumer, and return its report."""
        if self._consumer.blocks:
            with self._changed:
                self._ending = True
                self._changed.notify_all()
            self._thread.join(self._consumer.timeout_s)
            if self._thread.is_alive():
                self._fail("did not take its data in time and was left behind")
        elif not self._ending:
            self._ending = True
            self._close()
        return ConsumerReport(
            self._consumer.name, dict(self._taken), dict(self._dropped), self._summary, self._failed,
            self._consumer.critical,
        )  # fmt: skip

    @property
    def critical(self) -> bool:
        """Whether a failure of the consumer is a loss."""
        return self._consumer.critical

    @property
    def failed(self) -> str:
        """Why the consumer stopped early; empty while all is well."""
        return self._failed

    def _work(self) -> None:
        lower_priority(OUTPUT)
        self._guarded(self._consumer.begin)
        while (batch := self._next()) is not None:
            while batch:
                self._deliver(*batch.popleft())  # and drop the reference: a measurement has pictures
            self._guarded(self._idle)
        self._close()

    def _idle(self) -> None:
        self._idle_s = math.inf
        if not self._failed:
            self._idle_s = self._consumer.idle()

    def _next(self) -> deque[tuple[str, Any]] | None:
        """What is queued, kind by kind; nothing where the consumer's idle time is over; None at the end."""
        with self._changed:
            until = time.monotonic() + self._idle_s
            while not any(self._waiting.values()) and not self._ending:
                left = min(until - time.monotonic(), _LOAD_POLL_S if "load" in self._kinds else math.inf)
                if left <= 0:
                    return deque()
                self._changed.wait(left if left < math.inf else None)
            batch = deque((kind, item) for kind in KINDS for item in self._waiting[kind])
            for queue in self._waiting.values():
                queue.clear()
            self._changed.notify_all()
            return batch if batch or not self._ending else None

    def _deliver(self, kind: str, item: Any) -> None:
        if not self._failed and self._guarded(lambda: getattr(self._consumer, kind)(item)):
            self._taken[kind] += 1

    def _close(self) -> None:
        def close() -> None:
            self._summary = self._consumer.end()

        self._guarded(close)

    def _guarded(self, step: Callable[[], None]) -> bool:
        """One step of the consumer; the first one that fails ends this consumer only, and is reported."""
        try:
            step()
        except PhasedicError as error:
            self._fail(str(error))
        except BaseException as error:  # a panic inside a library is not an Exception
            log.exception("%s failed", self._consumer.name)
            self._fail(f"by a defect: {error!r}")
        else:
            return True
        return False

    def _fail(self, why: str) -> None:
        if self._failed:
            return
        with self._changed:
            self._failed = why
            self._changed.notify_all()
        self._on_failure(self._consumer.name, why, self._consumer.critical)


class Outputs:
    """Passes all data on to all consumers; a failure of one of them stops only that one.

    Parameters
    ----------
    consumers : sequence of Consumer
    loads : LoadLog
        Decides when the force of a measurement is final.
    event_log : EventLog
        Takes an event when a consumer fails; its events go to the consumers.
    history : History
        Takes the means of every measurement.

    Attributes
    ----------
    history : History
    """

    def __init__(
        self, consumers: Sequence[Consumer], loads: LoadLog, event_log: EventLog, history: History
    ) -> None:
        self.history, self._event_log = history, event_log
        self._matching = ForceMatching(loads)
        self._reports: Sequence[ConsumerReport] = ()
        self._threads = [ConsumerThread(consumer, self._report_failure) for consumer in consumers]
        for thread in self._threads:
            thread.start()
        event_log.add_listener(self.event)

    def add(self, measurement: Measurement) -> TimeStep:
        """Take one measurement."""
        self.history.add(measurement.time_step)
        self._give("measurement", measurement)
        for matched in self._matching.add(measurement):
            self._give("matched", matched)
        return measurement.time_step

    def frame(self, frame: Frame) -> None:
        """Take a frame; never waits."""
        self._give("frame", frame)

    @property
    def wants_frames(self) -> bool:
        """Whether any consumer takes frames."""
        return any(thread.wants("frame") for thread in self._threads)

    def load(self, sample: LoadSample) -> None:
        """Take a load sample; never waits."""
        self._give("load", sample)

    def event(self, event: Event) -> None:
        """Take an event; never waits."""
        self._give("event", event)

    @property
    def reports(self) -> Sequence[ConsumerReport]:
        """One of each consumer, once they have ended."""
        return self._reports

    @property
    def failed(self) -> bool:
        """Whether a critical consumer has stopped early."""
        return any(thread.failed and thread.critical for thread in self._threads)

    def end(self) -> None:
        """Match what still waits for its force, and end all consumers."""
        for matched in self._matching.flush():
            self._give("matched", matched)
        self._reports = [thread.end() for thread in self._threads]

    def _give(self, kind: str, item: object) -> None:
        for thread in self._threads:
            thread.give(kind, item)

    def _report_failure(self, name: str, why: str, critical: bool) -> None:
        text = f"{name} stopped, all else goes on: {why}"
        self._event_log.emit(EventKind.VIEW, name, text, "error" if critical else "warning")
