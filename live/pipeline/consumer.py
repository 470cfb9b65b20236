"""The contract of a consumer: it takes the frames, measurements, load samples and events of a test.

Results, view, status card and strain output are consumers. To write one, derive from ``Consumer``
and define the methods you want; ``examples/second_consumer.py`` is one in ten lines.

A ``Screen`` is what every part of the program may print for a person.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

from acquire.clock import ClockPair
from acquire.events import Event
from acquire.frame import CameraInfo, Frame
from acquire.load_sample import LoadSample
from acquire.text import Message, about, joined
from acquire.text.message import counted
from live.config.loading import Config
from live.pipeline.measurement import Measurement, TimeStep
from live.pipeline.run_state import RunState
from live.pipeline.snapshot import Snapshot

if TYPE_CHECKING:
    from analysis import ZoiGrid


class Screen:
    """Permanent lines, and one status line that is renewed. Every method does nothing until it is overridden.

    ``live.ui.terminal.screen.TerminalScreen`` prints to a terminal or a log.
    """

    @property
    def is_due(self) -> bool:
        """Whether the status line may be renewed now."""
        return False

    @property
    def width(self) -> int:
        """Letters that a status line may have."""
        return 0

    def print(self, text: str = "") -> None:
        """Print a permanent line."""

    def bell(self) -> None:
        """Ring the bell of the terminal."""

    def status(self, text: str) -> None:
        """Renew the status line, where it is due."""

    def snapshot(self, snapshot: Snapshot, words: str = "") -> None:
        """The status line of a live run; ``words`` name what it waits for."""

    def progress(self, i: TimeStep, done: int, expected: int | None, elapsed_s: float) -> None:
        """The status line of a replay: ``done`` bursts of the ``expected`` after ``elapsed_s``, ``i`` the last."""

    def prompt(self, text: str | None) -> None:
        """Show what the operator types, in place of the status line; None ends it."""


class Policy(Enum):
    """What happens to measurements when a consumer falls behind by ``queue_size`` of them.

    Frames: the newest replaces the one before, whatever the policy, since a camera cannot wait. Load
    samples and events: up to ``MAX_SAMPLES`` and ``MAX_EVENTS`` wait; then the oldest are dropped and counted.
    """

    WAIT = "the measurement waits, nothing is lost"
    NEWEST = "the oldest measurement in the queue is dropped and counted"
    BOUNDED = "the new measurement is refused and counted"


class Consumer:
    """Takes the data of a test. Every method does nothing until a subclass overrides it.

    Only kinds whose method is overridden are passed on. Where ``blocks`` is True a thread of the
    consumer calls the methods, one at a time; else the caller's thread does (the measuring thread for
    measurements), and waits for the return. An exception of a method ends only this consumer and is
    reported; ``end`` is called in any case.

    Attributes
    ----------
    name : str
        For messages and the consumer's report.
    policy : Policy
    queue_size : int
        Measurements that may wait.
    blocks : bool
        Whether a method may take longer than a few microseconds.
    critical : bool
        Whether its failure makes the test one that finished with loss (exit code 5).
    timeout_s : float or None, s
        How long the end of a test waits for it; None: as long as it takes.
    lost : bool
        Something that it gives did not arrive; set by the consumer.
    """

    name: str = "consumer"
    policy: Policy = Policy.NEWEST
    queue_size: int = 2
    blocks: bool = True
    critical: bool = False
    timeout_s: float | None = None
    lost: bool = False

    def begin(self) -> None:
        """Once, before anything else, on the consumer's thread."""

    def frame(self, frame: Frame) -> None:
        """A frame as it was grabbed."""

    def measurement(self, measurement: Measurement) -> None:
        """A measurement as soon as it is made; its force may not be known yet."""

    def matched(self, measurement: Measurement) -> None:
        """A measurement whose force is final (``live.pipeline.measurement.ForceMatching``)."""

    def load(self, sample: LoadSample) -> None:
        """A load sample with its flags and unit."""

    def event(self, event: Event) -> None:
        """An event from any part of the test."""

    def idle(self) -> float:
        """Called when the queue is empty (only where ``blocks``): time for deferred work.

        Returns
        -------
        float, s
            Time until the next call if nothing arrives; infinite for no call.
        """
        return math.inf

    def end(self) -> str:
        """Close everything; a few words for the consumer's report, or an empty text."""
        return ""


@dataclass(frozen=True, slots=True, eq=False)
class RunInfo:
    """The description of a test that its consumers are made from.

    Attributes
    ----------
    config : Config
    folder : Path
        Folder of the run's files.
    camera : CameraInfo
    grid : ZoiGrid
    start : ClockPair
        Time zero of the files and curves.
    end : callable or None
        Takes a reason and ends a live run cleanly; None in a replay.
    deferred : bool
        Nothing reads the files in ``folder`` before the test has ended, so they need not be flushed often.
    """

    config: Config
    folder: Path
    camera: CameraInfo
    grid: ZoiGrid
    start: ClockPair
    end: Callable[[str], None] | None = None
    deferred: bool = False


Compose = Callable[[RunInfo, RunState], Sequence[Consumer]]
"""Makes the consumers of a test, when its folder exists and before its first frame."""

KINDS = ("event", "load", "frame", "matched", "measurement")
"""Names of the methods that take data, in the order in which queued data is delivered."""


def kinds_taken(consumer: Consumer) -> frozenset[str]:
    """The kinds whose method ``consumer`` overrides."""
    return frozenset(k for k in KINDS if getattr(type(consumer), k) is not getattr(Consumer, k))


@dataclass(frozen=True, slots=True)
class ConsumerReport:
    """What a consumer took, and whether it stopped early.

    Attributes
    ----------
    name : str
    taken, dropped : mapping of kind to count
    summary : str
        What ``Consumer.end`` returned.
    failed : str
        Why it stopped early; empty where it did not.
    critical, lost : bool
        As of ``Consumer``.
    """

    name: str
    taken: Mapping[str, int] = field(default_factory=dict)
    dropped: Mapping[str, int] = field(default_factory=dict)
    summary: str = ""
    failed: str = ""
    critical: bool = False
    lost: bool = False

    def line(self) -> str:
        """One line for a person."""
        counts = [self._count(kind) for kind in ("measurement", "matched", "frame", "load", "event")]
        parts = [*filter(None, counts), *filter(None, [self.summary])]
        if self.failed:
            parts.append(Message("STOPPED: {why}", self.failed))
        return about(self.name, joined("; ", parts) or Message("nothing came"))

    def _count(self, kind: str) -> str:
        taken, dropped = self.taken.get(kind, 0), self.dropped.get(kind, 0)
        noun = {"matched": "measurement", "load": "load sample"}.get(kind, kind)
        lost = Message(", {dropped} dropped", dropped) * (dropped > 0)
        return counted(taken, noun) + lost if taken or dropped else ""
