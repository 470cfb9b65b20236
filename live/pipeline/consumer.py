"""What takes what a test gives: frames, measurements, load samples and events.

Results, view, status card, strain out and report are all consumers. To write one, derive from
``Consumer`` and define the methods you want; ``examples/second_consumer.py`` is one in ten lines.
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
from live.config.loading import Config
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import RunState

if TYPE_CHECKING:
    from analysis import ZoiGrid


class Policy(Enum):
    """What becomes of measurements when a consumer falls behind by ``room`` of them.

    Frames: the newest wins, whatever the policy, since a camera waits for nobody. Load samples and
    events: all of them, up to ``MOST_SAMPLES`` and ``MOST_EVENTS``; then the oldest go and are counted.
    """

    WAIT = "the measurement waits, nothing is lost"
    NEWEST = "the oldest one waiting gives way, and is counted"
    BOUNDED = "the new one is refused, and is counted"


class Consumer:
    """One that takes what a test gives. Every method does nothing until it is defined anew.

    Only kinds whose method is defined are passed on. Where ``blocks`` is True the methods are
    called by a thread of the consumer's own, one at a time; else by whoever gives (the measuring
    thread for measurements), who is then held up. What a method raises ends this consumer alone,
    loudly; ``end`` is called all the same.

    Attributes
    ----------
    name : str
        For messages and the ledger.
    policy : Policy
    room : int
        Measurements that may wait.
    blocks : bool
        Whether a method may take longer than a few microseconds.
    vital : bool
        Whether its failure makes the test one that finished with loss (exit code 5).
    patience_s : float or None, s
        How long the end of a test waits for it; None: as long as it takes.
    """

    name: str = "consumer"
    policy: Policy = Policy.NEWEST
    room: int = 2
    blocks: bool = True
    vital: bool = False
    patience_s: float | None = None

    def begin(self) -> None:
        """Once, before anything else, on the consumer's thread."""

    def frame(self, frame: Frame) -> None:
        """A frame as it was grabbed."""

    def measurement(self, measurement: Measurement) -> None:
        """A measurement at once; its force may not be known yet."""

    def settled(self, measurement: Measurement) -> None:
        """A measurement whose force is final (``live.pipeline.measurement.ForceMatching``)."""

    def load(self, sample: LoadSample) -> None:
        """A load sample with its flags and unit."""

    def event(self, event: Event) -> None:
        """An event of any part of the test."""

    def idle(self) -> float:
        """Nothing waits to be taken (only where ``blocks``): time to do what was put off.

        Returns
        -------
        float, s
            When to be asked again, should nothing come until then; infinite for never.
        """
        return math.inf

    def end(self) -> str:
        """Close everything; a few words for the ledger, empty where there is nothing to say."""
        return ""


@dataclass(frozen=True, slots=True, eq=False)
class RunInfo:
    """What a consumer may read of a test before it begins.

    Attributes
    ----------
    config : Config
    folder : Path
        Of the files.
    camera : CameraInfo
    grid : ZoiGrid
    start : ClockPair
        Time zero of the files and curves.
    end : callable or None
        Ends a live run cleanly, for the reason it is given; None in a replay.
    aside : bool
        Nobody looks into ``folder`` before all is done, and it counts for nothing until then.
    """

    config: Config
    folder: Path
    camera: CameraInfo
    grid: ZoiGrid
    start: ClockPair
    end: Callable[[str], None] | None = None
    aside: bool = False


Compose = Callable[[RunInfo, RunState], Sequence[Consumer]]
"""Makes the consumers of a test, once its folder is there and before its first frame."""

KINDS = ("event", "load", "frame", "settled", "measurement")
"""Names of the methods that take something, in the order in which what waits is handed over."""


def wanted(consumer: Consumer) -> frozenset[str]:
    """The kinds whose method ``consumer`` defines."""
    return frozenset(k for k in KINDS if getattr(type(consumer), k) is not getattr(Consumer, k))


@dataclass(frozen=True, slots=True)
class ConsumerReport:
    """How a consumer fared, for the ledger.

    Attributes
    ----------
    name : str
    taken, passed_over : mapping of kind to count
    words : str
        Its own.
    failed : str
        Why it stopped early; empty where it did not.
    vital : bool
    """

    name: str
    taken: Mapping[str, int] = field(default_factory=dict)
    passed_over: Mapping[str, int] = field(default_factory=dict)
    words: str = ""
    failed: str = ""
    vital: bool = False

    def line(self) -> str:
        """One line for a person."""
        counts = [self._count(kind) for kind in ("measurement", "settled", "frame", "load", "event")]
        said = [*filter(None, counts), *filter(None, [self.words])]
        if self.failed:
            said.append(f"STOPPED: {self.failed}")
        return f"{self.name}: {'; '.join(said) or 'nothing came'}"

    def _count(self, kind: str) -> str:
        taken, over = self.taken.get(kind, 0), self.passed_over.get(kind, 0)
        plural = {"settled": "measurements", "load": "load samples"}.get(kind, f"{kind}s")
        return f"{taken} {plural}" + f", {over} passed over" * (over > 0) if taken or over else ""
