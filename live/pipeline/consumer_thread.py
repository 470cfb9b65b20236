"""One consumer with its thread, its queues and its guard.

What is done with all that a test gives, live or in a replay: every consumer gets its share.
"""

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
from live.pipeline.consumer import KINDS, Consumer, ConsumerReport, Policy, wanted
from live.pipeline.event_log import EventLog
from live.pipeline.history import History
from live.pipeline.latency import OUTPUT, yield_to_others
from live.pipeline.measurement import ForceMatching, Measurement, TimeStep

log = logging.getLogger(__name__)

MOST_SAMPLES, MOST_EVENTS = 20_000, 1000
_NAP_S = 0.1  # load samples wake nobody

Tell = Callable[[str, str, bool], None]
"""Called with the consumer's name, what went wrong, and whether the consumer is vital."""


class ConsumerThread:
    """Passes things on to one consumer, as its policy says, and never raises.

    Parameters
    ----------
    consumer : Consumer
    tell : callable
        Told once where the consumer fails.
    """

    def __init__(self, consumer: Consumer, tell: Tell) -> None:
        self._consumer, self._tell = consumer, tell
        self._wanted = wanted(consumer)
        self._waiting: dict[str, deque[Any]] = {kind: deque() for kind in KINDS}
        self._most = {"event": MOST_EVENTS, "load": MOST_SAMPLES, "frame": 1}
        self._taken: Counter[str] = Counter()
        self._over: Counter[str] = Counter()
        self._failed = self._words = ""
        self._changed = threading.Condition()
        self._ending = False
        self._patience_s = math.inf
        self._thread = threading.Thread(target=self._work, name=consumer.name, daemon=True)

    def start(self) -> None:
        """Begin; from now on things are taken."""
        if self._consumer.blocks:
            self._thread.start()
        else:
            self._guarded(self._consumer.begin)

    def wants(self, kind: str) -> bool:
        """Whether things of this kind are taken, still."""
        return kind in self._wanted and not self._failed and not self._ending

    def give(self, kind: str, item: Any) -> None:
        """Pass ``item`` on, or let it wait; waits itself only where the policy says so."""
        if not self.wants(kind):
            return
        if not self._consumer.blocks:
            self._hand_over(kind, item)
            return
        with self._changed:
            if self._has_room(kind):
                self._waiting[kind].append(item)
            if kind != "load":
                self._changed.notify_all()

    def _has_room(self, kind: str) -> bool:
        """Make room as the policy says; False where the new one is refused."""
        queue, most = self._waiting[kind], self._most.get(kind, self._consumer.room)
        if len(queue) < most:
            return True
        if kind not in self._most and self._consumer.policy is Policy.WAIT:
            self._changed.wait_for(lambda: len(queue) < most or bool(self._failed) or self._ending)
            return True
        self._over[kind] += 1
        if kind not in self._most and self._consumer.policy is Policy.BOUNDED:
            return False
        queue.popleft()
        return True

    def end(self) -> ConsumerReport:
        """Hand over what waits, end the consumer, and say how it fared."""
        if self._consumer.blocks:
            with self._changed:
                self._ending = True
                self._changed.notify_all()
            self._thread.join(self._consumer.patience_s)
            if self._thread.is_alive():
                self._fail("did not take its data in time and was left behind")
        elif not self._ending:
            self._ending = True
            self._close()
        return ConsumerReport(
            self._consumer.name, dict(self._taken), dict(self._over), self._words, self._failed,
            self._consumer.vital,
        )  # fmt: skip

    @property
    def vital(self) -> bool:
        """Whether a failure of the consumer is a loss."""
        return self._consumer.vital

    @property
    def failed(self) -> str:
        """Why the consumer stopped early; empty while all is well."""
        return self._failed

    def _work(self) -> None:
        yield_to_others(OUTPUT)
        self._guarded(self._consumer.begin)
        while (batch := self._next()) is not None:
            while batch:
                self._hand_over(*batch.popleft())  # and let go of: a measurement has pictures
            self._guarded(self._idle)
        self._close()

    def _idle(self) -> None:
        self._patience_s = math.inf
        if not self._failed:
            self._patience_s = self._consumer.idle()

    def _next(self) -> deque[tuple[str, Any]] | None:
        """What waits, kind by kind; nothing where the consumer has something to do meanwhile; None at the end."""
        with self._changed:
            until = time.monotonic() + self._patience_s
            while not any(self._waiting.values()) and not self._ending:
                left = min(until - time.monotonic(), _NAP_S if "load" in self._wanted else math.inf)
                if left <= 0:
                    return deque()
                self._changed.wait(left if left < math.inf else None)
            batch = deque((kind, item) for kind in KINDS for item in self._waiting[kind])
            for queue in self._waiting.values():
                queue.clear()
            self._changed.notify_all()
            return batch if batch or not self._ending else None

    def _hand_over(self, kind: str, item: Any) -> None:
        if not self._failed and self._guarded(lambda: getattr(self._consumer, kind)(item)):
            self._taken[kind] += 1

    def _close(self) -> None:
        def close() -> None:
            self._words = self._consumer.end()

        self._guarded(close)

    def _guarded(self, step: Callable[[], None]) -> bool:
        """One step of the consumer; the first that fails ends it, loudly, and nothing else."""
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
        self._tell(self._consumer.name, why, self._consumer.vital)


class Outputs:
    """Passes everything on to all consumers; a trouble in one of them stops that one alone.

    Parameters
    ----------
    consumers : sequence of Consumer
    loads : LoadLog
        Says when the force of a measurement is final.
    event_log : EventLog
        Told where a consumer fails; its events go to the consumers.
    history : History
        Gets the means of every measurement.

    Attributes
    ----------
    history : History
    """

    def __init__(
        self, consumers: Sequence[Consumer], loads: LoadLog, event_log: EventLog, history: History
    ) -> None:
        self.history, self._event_log = history, event_log
        self._settling = ForceMatching(loads)
        self._reports: Sequence[ConsumerReport] = ()
        self._workers = [ConsumerThread(consumer, self._failure) for consumer in consumers]
        for worker in self._workers:
            worker.start()
        event_log.add_listener(self.event)

    def add(self, measurement: Measurement) -> TimeStep:
        """Take one measurement."""
        self.history.add(measurement.time_step)
        self._give("measurement", measurement)
        for settled in self._settling.add(measurement):
            self._give("settled", settled)
        return measurement.time_step

    def frame(self, frame: Frame) -> None:
        """Take a frame; never waits."""
        self._give("frame", frame)

    @property
    def wants_frames(self) -> bool:
        """Whether a frame is of use to anybody."""
        return any(worker.wants("frame") for worker in self._workers)

    def load(self, sample: LoadSample) -> None:
        """Take a load sample; never waits."""
        self._give("load", sample)

    def event(self, event: Event) -> None:
        """Take an event; never waits."""
        self._give("event", event)

    @property
    def reports(self) -> Sequence[ConsumerReport]:
        """How the consumers fared, once they have ended."""
        return self._reports

    @property
    def failed(self) -> bool:
        """Whether a consumer that matters has stopped early."""
        return any(worker.failed and worker.vital for worker in self._workers)

    def end(self) -> None:
        """Settle what still waits for its force, and end all consumers."""
        for settled in self._settling.rest():
            self._give("settled", settled)
        self._reports = [worker.end() for worker in self._workers]

    def _give(self, kind: str, item: object) -> None:
        for worker in self._workers:
            worker.give(kind, item)

    def _failure(self, name: str, why: str, vital: bool) -> None:
        text = f"{name} stopped, all else goes on: {why}"
        self._event_log.tell(EventKind.VIEW, name, text, "error" if vital else "warning")
