"""Consumers at work: ``Adapted`` runs one in a thread of its own, ``Outputs`` are all those of a camera."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from acquire.errors import PhasedicError
from acquire.events import Event, EventKind
from acquire.frame import Frame
from acquire.load_cell import LoadLog
from acquire.load_sample import LoadSample
from acquire.system import lower_priority
from acquire.text import Message
from live.pipeline.consumer import KINDS, Consumer, ConsumerReport, Policy, kinds_taken
from live.pipeline.event_log import EventLog
from live.pipeline.latency import OUTPUT
from live.pipeline.measurement import ForceMatching, Measurement
from live.stream.stream import ALL, Matched, Record, Stream, Subscriber

log = logging.getLogger(__name__)

MAX_SAMPLES, MAX_EVENTS = 20_000, 1000
_LOAD_POLL_S = 0.1  # load samples do not wake the thread

_BODIES: Mapping[str, type] = {
    "event": Event,
    "load": LoadSample,
    "frame": Frame,
    "matched": Matched,
    "measurement": Measurement,
}
"""Method of a consumer -> kind of body that it takes."""
_METHODS = {body: method for method, body in _BODIES.items()}

OnFailure = Callable[[str, str, bool], None]
"""Called with the consumer's name, what went wrong, and whether the consumer is critical."""


class Adapted(Subscriber):
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
        self.takes = [_BODIES[kind] for kind in self._kinds]
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
            with self._guarded():
                self._consumer.begin()

    def take(self, record: Record) -> None:
        """Deliver or queue its body; blocks only with ``Policy.WAIT``."""
        if self._failed or self._ending:
            return
        kind = _METHODS[type(record.body)]
        item = record.body.measurement if isinstance(record.body, Matched) else record.body
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
                self._fail(Message("did not take its data in time and was left behind"))
        elif not self._ending:
            self._ending = True
            self._close()
        return ConsumerReport(
            self._consumer.name, dict(self._taken), dict(self._dropped), self._summary, self._failed,
            self._consumer.critical, self._consumer.lost,
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
        with self._guarded():
            self._consumer.begin()
        while (batch := self._next()) is not None:
            while batch:
                self._deliver(*batch.popleft())  # and drop the reference: a measurement has pictures
            self._idle_s = math.inf
            if not self._failed:
                with self._guarded():
                    self._idle_s = self._consumer.idle()
        self._close()

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
        if not self._failed:
            with self._guarded():
                getattr(self._consumer, kind)(item)
                self._taken[kind] += 1

    def _close(self) -> None:
        with self._guarded():
            self._summary = self._consumer.end()

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        """Around a step of the consumer; the first one that fails ends this consumer only, and is reported."""
        try:
            yield
        except PhasedicError as error:
            self._fail(error.text)
        except BaseException as error:  # a panic inside a library is not an Exception
            log.exception("%s failed", self._consumer.name)
            self._fail(Message("by a defect: {error}", repr(error)))

    def _fail(self, why: str) -> None:
        if self._failed:
            return
        with self._changed:
            self._failed = why
            self._changed.notify_all()
        self._on_failure(self._consumer.name, why, self._consumer.critical)


class Matcher(Subscriber):
    """Publishes each measurement once more, when its force is final (``live.pipeline.measurement.ForceMatching``)."""

    takes = (Measurement,)

    def __init__(self, loads: LoadLog, stream: Stream, camera: str) -> None:
        self._matching, self._stream, self._camera = ForceMatching(loads), stream, camera

    def take(self, record: Record) -> None:
        """Take a measurement."""
        assert isinstance(record.body, Measurement)
        for matched in self._matching.add(record.body):
            self._stream.publish(Matched(matched), self._camera)

    def end(self) -> None:
        """Publish those that still wait for their force."""
        for matched in self._matching.flush():
            self._stream.publish(Matched(matched), self._camera)


class Outputs:
    """The consumers of a camera's run, adapted to the stream; a failure of one of them stops only that one.

    Parameters
    ----------
    consumers : sequence of Consumer
    loads : LoadLog
        Decides when the force of a measurement is final.
    event_log : EventLog
        Takes an event when a consumer fails.
    stream : Stream
    camera : str
        Whose records they take.
    """

    def __init__(
        self,
        consumers: Sequence[Consumer],
        loads: LoadLog,
        event_log: EventLog,
        stream: Stream,
        camera: str = ALL,
    ) -> None:
        self._event_log = event_log
        self._reports: Sequence[ConsumerReport] = ()
        self._adapted = [Adapted(consumer, self._report_failure) for consumer in consumers]
        self._matcher = Matcher(loads, stream, camera)
        for adapted in self._adapted:
            adapted.start()
            stream.add(adapted, camera)
        stream.add(self._matcher, camera)

    @property
    def reports(self) -> Sequence[ConsumerReport]:
        """One of each consumer, once they have ended."""
        return self._reports

    @property
    def failed(self) -> bool:
        """Whether a critical consumer has stopped early."""
        return any(adapted.failed and adapted.critical for adapted in self._adapted)

    def end(self) -> None:
        """Match what still waits for its force, and end all consumers."""
        self._matcher.end()
        self._reports = [adapted.end() for adapted in self._adapted]

    def _report_failure(self, name: str, why: str, critical: bool) -> None:
        text = Message("{name} stopped, all else goes on: {why}", name, why)
        self._event_log.emit(EventKind.VIEW, name, text, "error" if critical else "warning")
