"""What is asked of a replay, and what it works on.

Reading ahead of the kernel: the next bursts are read and averaged while one is measured.
"""

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
from live.pipeline.measure import NewReference


@dataclass(frozen=True, slots=True)
class ReplayRequest:
    """What is asked for.

    Attributes
    ----------
    source : str
        Path of a session, or an address of pictures (``files:shots/*.tif``, ``video:...``).
    as_measured : bool
    start_s, end_s : float or None, s
        Part of the session, in seconds since its start.
    reference : str or None
        An image file as the reference, in place of the first pictures.
    forces : Path or None
        A CSV with the forces (``live.replay.forces``).
    config_file : Path or None
    overrides : mapping of "section.key" to value
    numbers : range or None
        Of the bursts within that part those from this number on, up to that one, by their order; of a session alone.
    parts : sequence of Path
        What ``measure_part`` has stored of all of it, in order: told, and not measured again.
    settled : Path or None
        Where the folder of the results will lie in the end, if that is not where they are written.
    """

    source: str
    as_measured: bool
    start_s: float | None
    end_s: float | None
    reference: str | None
    config_file: Path | None
    overrides: Mapping[str, Any]
    forces: Path | None = None
    numbers: range | None = None
    parts: Sequence[Path] = ()
    settled: Path | None = None


Work = Burst | NewReference


class PictureCount:
    """Counts the pictures that pass.

    Attributes
    ----------
    pictures, left_out, reference : int
        All of them; those that cannot be read or are not like the first; those of the reference.
    """

    def __init__(self) -> None:
        self.pictures = self.left_out = self.reference = 0

    def passing(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """The same frames."""
        for frame in frames:
            self.pictures += 1
            self.left_out += frame.damaged
            yield frame


@dataclass(frozen=True, slots=True, eq=False)
class ReplaySource:
    """A source taken apart: what the reference is, and the bursts to measure.

    Attributes
    ----------
    expected : int or None
        How many bursts there will be at most, where that is known.
    times : (B,) float64 or None, s
        Of the bursts, where they are known before they are read.
    seen : PictureCount or None
        The pictures so far; None for a session, whose bursts say what was lost.
    """

    camera: CameraInfo
    reference: Burst
    bursts: Iterable[Work]
    loads: LoadLog
    start: ClockPair
    events: tuple[Event, ...] = ()
    samples: tuple[LoadSample, ...] = ()
    expected: int | None = None
    times: NDArray[np.float64] | None = None
    seen: PictureCount | None = None


def check_window(request: ReplayRequest) -> None:
    """Raises ConfigError where --from and --to leave nothing, whatever the source."""
    for name, value in (("from", request.start_s), ("to", request.end_s)):
        if value is not None and not (math.isfinite(value) and value >= 0):
            raise ConfigError(f"--{name} {value} is not possible; allowed: seconds since the start, from 0")
    if request.start_s is not None and request.end_s is not None and request.start_s >= request.end_s:
        raise ConfigError(f"--from {request.start_s} must be before --to {request.end_s}")


@dataclass(frozen=True, slots=True)
class Window:
    """The part of a source that is measured, monotonic s; ``origin`` is its start."""

    low: float
    high: float
    origin: float

    @classmethod
    def of(cls, request: ReplayRequest, origin: float) -> Window:
        """As ``request`` says."""
        low = -math.inf if request.start_s is None else origin + request.start_s
        high = math.inf if request.end_s is None else origin + request.end_s
        return cls(low, high, origin)

    def holds(self, t: float) -> bool:
        """Whether a burst of that time is measured."""
        return self.low <= t <= self.high

    def numbers(self, times: NDArray[np.float64]) -> range:
        """Of bursts in order, those to be read: within; where none is, the last one, for ``part`` to tell of."""
        inside = np.flatnonzero((times >= self.low) & (times <= self.high))
        if not inside.size:
            return range(max(0, len(times) - 1), len(times))
        return range(int(inside[0]), int(inside[-1]) + 1)

    def part(self, bursts: Iterable[Work]) -> Iterator[Work]:
        """Those within; raises DataError at the end where there was a burst, but none within."""
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
                f"no burst lies between --from and --to; the last one is at {last - self.origin:.3f} s"
            )


Item = TypeVar("Item")
_LOOK_S = 0.1


@dataclass(frozen=True, slots=True)
class _End:
    """Nothing follows; ``error`` is what ended it early."""

    error: BaseException | None = None


class _Reader(Generic[Item]):
    """A thread that takes items and puts them in a queue with bounded room."""

    def __init__(self, items: Iterable[Item], room: int) -> None:
        self._items = items
        self.queue: queue.Queue[Item | _End] = queue.Queue(room)
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._read, name="read ahead", daemon=True)
        self._thread.start()

    def _read(self) -> None:
        end = _End()
        try:
            for item in self._items:
                if not self._put(item):
                    return
        except BaseException as error:  # raised again where the items are taken
            end = _End(error)
        self._put(end)

    def _put(self, item: Item | _End) -> bool:
        """Whether there was room before the end."""
        while not self._stopped.is_set():
            with contextlib.suppress(queue.Full):
                self.queue.put(item, timeout=_LOOK_S)
                return True
        return False

    def close(self) -> None:
        """Take nothing more, and let go of the source."""
        self._stopped.set()
        self._thread.join()


def ahead(items: Iterable[Item], room: int = 1) -> Generator[Item]:
    """The same items in the same order, taken ahead by a thread of their own: ``room`` wait, and it has one at hand.

    What ``items`` raises is raised here, after those that came before. Closing the iterator ends the thread.
    """
    reader = _Reader(items, room)
    try:
        while not isinstance(item := reader.queue.get(), _End):
            yield item
        if item.error is not None:
            raise item.error
    finally:
        reader.close()
