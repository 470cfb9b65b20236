"""The bursts of a recorded session, which has all frames, every K-th frame, or bursts.

The index comes from the table of frames only, so that the frames before a part need not be read.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from acquire.burst import average_bursts, burst_of
from acquire.errors import ConfigError, DataError
from acquire.frame import Burst, Frame
from acquire.session import Session
from live.config.sections import DEFAULT_BURST


@dataclass(frozen=True, slots=True, eq=False)
class BurstIndex:
    """The bursts of a session in order.

    Attributes
    ----------
    n : int
        Frames in each; 0 where they were recorded as bursts.
    t : (B,) float64, s
        Their times, monotonic, bit-equal to those of the bursts.
    starts, stops : (B,) int64
        Rows to read for each: from the end of the burst before, so that frames lost before a burst are counted.
    """

    n: int
    t: NDArray[np.float64]
    starts: NDArray[np.int64]
    stops: NDArray[np.int64]

    def rows(self, numbers: range) -> tuple[int, int]:
        """First row of the bursts ``numbers``, which follow one another, and the row after the last."""
        if not numbers:
            return 0, 0
        return int(self.starts[numbers[0]]), int(self.stops[numbers[-1]])


def index_of_frames(session: Session, last: int, n: int) -> BurstIndex:
    """The bursts of n frames after sequence number ``last``, as ``BurstAccumulator`` makes them."""
    index, t = session.indices, session.times.tolist()
    begin = int(np.searchsorted(index, last, side="right"))
    stops = burst_ends(
        index[begin:].tolist(),
        session.frame_column("lost_before")[begin:].tolist(),
        session.frame_column("damaged")[begin:].tolist(),
        n,
    )
    ends = np.array(stops, np.int64) + begin
    starts = np.concatenate([[begin], ends[:-1]])[: len(ends)]
    times = [_middle(t[end - n : end]) for end in ends.tolist()]
    return BurstIndex(n, np.array(times, np.float64), starts, ends)


def burst_ends(index: Sequence[int], lost_before: Sequence[int], damaged: Sequence[int], n: int) -> list[int]:
    """The row after each burst of n frames without a gap; tests compare it with ``BurstAccumulator``."""
    ends, count, last = [], 0, 0
    for row, (number, lost, bad) in enumerate(zip(index, lost_before, damaged, strict=True)):
        if bad or (count and (lost > 0 or number != last + 1)):
            count = 0
        if bad:
            continue
        count, last = count + 1, number
        if count == n:
            ends.append(row + 1)
            count = 0
    return ends


def _middle(times: Sequence[float]) -> float:
    """The time of a burst of frames with these times."""
    if len(times) == 1:
        return times[0]
    start = times[0]
    return start + math.fsum(t - start for t in times) / len(times)


def index_of_bursts(session: Session, last: int) -> BurstIndex:
    """The bursts that were recorded as such after sequence number ``last``; rows are their numbers."""
    numbers = np.flatnonzero(session.burst_column("first_index") > last).astype(np.int64)
    return BurstIndex(0, session.burst_column("monotonic_s")[numbers], numbers, numbers + 1)


class BurstStore(Protocol):
    """The bursts of a session, for a replay."""

    def burst(self, data: Mapping[str, Any]) -> Burst:
        """The burst of an event with this data (first, last, n); DataError where it was not recorded whole."""
        ...

    def first_burst(self, n: int) -> tuple[Burst, int]:
        """The first n frames, and the sequence number of the last; DataError where there are none."""
        ...

    def index_after(self, last: int, n: int | None) -> BurstIndex:
        """All bursts of n frames after sequence number ``last``; None: as they were recorded."""
        ...

    def bursts_at(self, index: BurstIndex, numbers: range) -> Iterator[Burst]:
        """The bursts of ``index`` with these numbers, one after the other; nothing else is read."""
        ...


def open_store(session: Session, path: Path) -> BurstStore:
    """The bursts of ``session``; raises DataError where it has no pictures."""
    if session.mode.kind == "bursts":
        return _Bursts(session, path)
    if len(session) == 0:
        raise DataError("{path}: the session holds no frames; there is nothing to replay", path)
    return _Frames(session, path) if session.mode.every == 1 else _EveryKth(session, path)


class _Frames:
    """All frames were recorded."""

    def __init__(self, session: Session, path: Path) -> None:
        self._session, self._path = session, path
        self._indices = [int(i) for i in session.indices]

    def burst(self, data: Mapping[str, Any]) -> Burst:
        first, last, n = int(data["first"]), int(data["last"]), int(data["n"])
        frames = [frame for frame in self._between(first, last) if not frame.damaged]
        if len(frames) != n:
            raise DataError(
                "{path}: of the burst of frames {first} to {last} only {found} of {n} are recorded; replay without"
                " --as-measured measures what is there",
                self._path,
                first,
                last,
                len(frames),
                n,
            )
        return burst_of(frames)

    def first_burst(self, n: int) -> tuple[Burst, int]:
        for burst in average_bursts(self._session.frames(), n):
            return burst, burst.last_index
        raise DataError(
            "{path}: fewer than {n} frames without a gap; give a smaller --reference-burst", self._path, n
        )

    def index_after(self, last: int, n: int | None) -> BurstIndex:
        return index_of_frames(self._session, last, n or DEFAULT_BURST)

    def bursts_at(self, index: BurstIndex, numbers: range) -> Iterator[Burst]:
        return average_bursts(self._session.frames(*index.rows(numbers)), index.n)

    def _between(self, first: int, last: int) -> Iterator[Frame]:
        start, stop = bisect_left(self._indices, first), bisect_right(self._indices, last)
        return self._session.frames(start, stop)


class _EveryKth(_Frames):
    """Only every K-th frame was recorded: taken as a slower camera."""

    def burst(self, data: Mapping[str, Any]) -> Burst:
        """The recorded frames of a burst; without any, the next recorded frame."""
        first, last = int(data["first"]), int(data["last"])
        frames = [frame for frame in self._between(first, last) if not frame.damaged]
        frames = (
            frames or [frame for frame in self._between(first, self._indices[-1]) if not frame.damaged][:1]
        )
        if not frames:
            raise DataError(
                "{path}: of the frames {first} to {last}, and after them, none is recorded",
                self._path,
                first,
                last,
            )
        return _averaged(frames)

    def first_burst(self, n: int) -> tuple[Burst, int]:
        frames = [frame for frame in self._session.frames(0, n) if not frame.damaged]
        if len(frames) < n:
            raise DataError(
                "{path}: fewer than {n} whole frames; give a smaller --reference-burst", self._path, n
            )
        return _averaged(frames), frames[-1].index

    def index_after(self, last: int, n: int | None) -> BurstIndex:
        if n is not None and n > 1:
            raise ConfigError(
                "{path} holds only one frame in {every}, {n} of them are no burst; give --burst 1",
                self._path,
                self._session.mode.every,
                n,
            )
        return super().index_after(last, 1)


def _averaged(frames: Sequence[Frame]) -> Burst:
    """The mean of frames that are not consecutive, with the numbers of the source."""
    rows = [replace(frame, index=row, lost_before=0) for row, frame in enumerate(frames)]
    return replace(burst_of(rows), first_index=frames[0].index, last_index=frames[-1].index)


class _Bursts:
    """Bursts were recorded in place of frames."""

    def __init__(self, session: Session, path: Path) -> None:
        self._session, self._path = session, path
        ends = zip(
            session.burst_column("first_index").tolist(),
            session.burst_column("last_index").tolist(),
            strict=True,
        )
        self._numbers = {pair: number for number, pair in enumerate(ends)}
        if not self._numbers:
            raise DataError("{path}: the session holds no bursts; there is nothing to replay", path)

    def burst(self, data: Mapping[str, Any]) -> Burst:
        number = self._numbers.get((int(data["first"]), int(data["last"])))
        if number is None:
            raise DataError(
                "{path}: the burst of frames {first} to {last} was not recorded; replay without --as-measured measures"
                " what is there",
                self._path,
                data["first"],
                data["last"],
            )
        return self._session.burst(number)

    def first_burst(self, n: int) -> tuple[Burst, int]:
        raise ConfigError("{path} holds bursts, not frames; --reference-burst cannot be changed", self._path)

    def index_after(self, last: int, n: int | None) -> BurstIndex:
        index = index_of_bursts(self._session, last)
        lengths = self._session.burst_column("n")[index.starts]
        if n is not None and np.any(other := lengths != n):
            length = int(lengths[np.argmax(other)])
            raise ConfigError("{path} holds bursts of {n} frames; give --burst {n}", self._path, length)
        return index

    def bursts_at(self, index: BurstIndex, numbers: range) -> Iterator[Burst]:
        return map(self._session.burst, index.starts[numbers.start : numbers.stop].tolist())
