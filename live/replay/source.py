"""The request and the source of a replay, the window of time, and the prefetch of bursts while one is measured."""

from __future__ import annotations

import contextlib
import math
import queue
import threading
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from acquire.clock import ClockPair
from acquire.errors import ConfigError, DataError
from acquire.events import Event
from acquire.frame import Burst, CameraInfo, Frame
from acquire.load_cell import LoadLog
from acquire.load_sample import LoadSample
from acquire.text import Message, counts
from analysis.compiled.interruption import Abandoned, abandoned_when
from live.pipeline.measure import NewReference

Work = Burst | NewReference

Item = TypeVar("Item")
_POLL_S = 0.1


@dataclass(frozen=True, slots=True)
class ReplayRequest:
    """The settings of one replay.

    Attributes
    ----------
    source : str
        Path of a session, or an address of pictures (``files:shots/*.tif``, ``video:...``).
    forces : Path or None
        A file with the forces (``live.replay.forces``).
    config_file : Path or None
    overrides : mapping of "section.key" to value
    as_measured : bool
    start_s, end_s : float or None, s
        Part of the session, in seconds since its start.
    reference : str or None
        An image file as the reference, or the name of one of the pictures, in place of the first.
    numbers : range or None
        Numbers of the bursts to measure, in the order within that part; only of a session.
    parts : sequence of Path
        Files of ``measure_part`` for the whole session, in order: joined, and not measured again.
    final_folder : Path or None
        The later folder of the results, where it is not the one they are written to.
    """

    source: str
    config_file: Path | None
    overrides: Mapping[str, Any]
    as_measured: bool = False
    start_s: float | None = None
    end_s: float | None = None
    reference: str | None = None
    forces: Path | None = None
    numbers: range | None = None
    parts: Sequence[Path] = ()
    final_folder: Path | None = None


class PictureCount:
    """Counts the pictures that pass.

    Attributes
    ----------
    pictures, left_out, reference : int
        All; those that cannot be read or differ from the first in format; those of the reference.
    repeated, first_repeated : int
        Pictures that are the one before in every bit, as noise never makes them, and the number of the first, from 1.
    """

    def __init__(self) -> None:
        self.pictures = self.left_out = self.reference = self.repeated = self.first_repeated = 0

    def passing(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """The same frames, counted."""
        last: Frame | None = None
        for frame in frames:
            self.pictures += 1
            self.left_out += frame.damaged
            if last and not frame.damaged and np.array_equal(last.image, frame.image) and np.ptp(frame.image):
                self.repeated += 1
                self.first_repeated = self.first_repeated or self.pictures
            last = frame
            yield frame

    @property
    def repeats(self) -> list[str]:
        """A line on the repeated pictures; nothing where there are none."""
        words = Message(
            "{n} of {all} pictures equal the one before in every bit, the first is number {first}: the camera or its"
            " program repeats them, and their strain is that of before",
            *counts(self.repeated),
            *counts(self.pictures),
            self.first_repeated,
        )
        return [words] * (self.repeated > 0)


@dataclass(frozen=True, slots=True, eq=False)
class ReplaySource:
    """A source: its reference, the bursts to measure, and the recorded loads and events.

    Attributes
    ----------
    expected : int or None
        The largest number of bursts, where it is known.
    times : (B,) float64 or None, s
        Times of the bursts, where they are known before the bursts are read.
    count : PictureCount or None
        The pictures so far; None for a session, whose bursts have the number of lost frames.
    doubts : tuple of str
        What makes the result incomplete.
    words : str
        Which picture is the reference, which the last, and how many there are.
    """

    camera: CameraInfo
    reference: Burst
    bursts: Iterable[Work]
    loads: LoadLog
    start: ClockPair
    events: tuple[Event, ...] = ()
    samples: Iterable[LoadSample] = ()
    expected: int | None = None
    times: NDArray[np.float64] | None = None
    count: PictureCount | None = None
    doubts: tuple[str, ...] = ()
    words: str = ""


def check_window(request: ReplayRequest) -> None:
    """Raises ConfigError where --from and --to leave nothing, whatever the source."""
    if request.start_s is not None and request.end_s is not None and request.start_s >= request.end_s:
        raise ConfigError("--from {start} must be before --to {end}", request.start_s, request.end_s)


@dataclass(frozen=True, slots=True)
class Window:
    """The part of a source that is measured, monotonic s; ``origin`` is its start."""

    low: float
    high: float
    origin: float

    @classmethod
    def of(cls, request: ReplayRequest, origin: float) -> Window:
        """The window of ``request``."""
        low = -math.inf if request.start_s is None else origin + request.start_s
        high = math.inf if request.end_s is None else origin + request.end_s
        return cls(low, high, origin)

    def holds(self, t: float) -> bool:
        """Whether a burst at ``t`` is measured."""
        return self.low <= t <= self.high

    def numbers(self, times: NDArray[np.float64]) -> range:
        """Numbers of the bursts to read: those within, or the last where none is, for the message of ``part``."""
        inside = np.flatnonzero((times >= self.low) & (times <= self.high))
        if not inside.size:
            return range(max(0, len(times) - 1), len(times))
        return range(int(inside[0]), int(inside[-1]) + 1)

    def part(self, bursts: Iterable[Work]) -> Iterator[Work]:
        """The bursts within; raises DataError at the end where there are bursts, but none within."""
        last, found = math.nan, False
        for item in bursts:
            if isinstance(item, NewReference):
                yield item
                continue
            last = item.t
            if self.holds(last):
                found = True
                yield item
        if not found and not math.isnan(last):
            raise DataError(
                "no burst lies between --from and --to; the last one is at {last:.3f} s", last - self.origin
            )


@dataclass(frozen=True, slots=True)
class _End:
    """The end of the items; ``error`` is what ended them early."""

    error: BaseException | None = None


class _Prefetcher(Generic[Item]):
    """A thread that puts items into a bounded queue."""

    def __init__(self, items: Iterable[Item], queue_size: int) -> None:
        self._items = items
        self.queue: queue.Queue[Item | _End] = queue.Queue(queue_size)
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._read, name="read ahead", daemon=True)
        self._thread.start()

    def _read(self) -> None:
        end = _End()
        try:
            for item in self._items:
                if not self._put(item):
                    return
        except BaseException as error:  # raised again in the thread that takes the items
            end = _End(error)
        self._put(end)

    def _put(self, item: Item | _End) -> bool:
        """Whether the item was queued before the end."""
        while not self._stopped.is_set():
            with contextlib.suppress(queue.Full):
                self.queue.put(item, timeout=_POLL_S)
                return True
        return False

    def close(self) -> None:
        """Stop reading, and wait for the thread."""
        self._stopped.set()
        self._thread.join()


def prefetch(items: Iterable[Item], queue_size: int = 1) -> Generator[Item]:
    """The same items in order, read ahead by a thread: ``queue_size`` wait, and the thread holds one more.

    An error of ``items`` is raised here, after the items before it. Closing the iterator ends the thread.
    """
    reader = _Prefetcher(items, queue_size)
    try:
        while not isinstance(item := reader.queue.get(), _End):
            yield item
        if item.error is not None:
            raise item.error
    finally:
        reader.close()


def until_stopped(measured: Iterable[Item], stopping: threading.Event) -> Iterator[Item]:
    """The same items in order until ``stopping`` is set; the one that is being made then is abandoned."""
    rest = iter(measured)
    while not stopping.is_set():
        try:
            with abandoned_when(stopping.is_set):
                item = next(rest)
        except (StopIteration, Abandoned):
            return
        yield item
        del item  # frees it before the next one is made
