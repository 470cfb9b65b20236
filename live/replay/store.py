"""The bursts of a recorded session, whatever it holds: all frames, every K-th frame, or bursts."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from acquire.burst import average_bursts, burst_of
from acquire.errors import ConfigError, DataError
from acquire.frame import Burst, Frame
from acquire.session import Session
from live.replay.places import Places, places_of_bursts, places_of_frames

DEFAULT_BURST = 4  # of a session whose configuration says nothing


class Store(Protocol):
    """What a replay asks of a session."""

    def burst(self, told: Mapping[str, Any]) -> Burst:
        """The burst that an event tells of (first, last, n); DataError where it was not recorded whole."""
        ...

    def first_burst(self, n: int) -> tuple[Burst, int]:
        """The first n frames, and the sequence number of the last; DataError where there are none."""
        ...

    def places_after(self, last: int, n: int | None) -> Places:
        """All bursts of n frames after sequence number ``last``; None: as they were recorded."""
        ...

    def bursts_at(self, places: Places, numbers: range) -> Iterator[Burst]:
        """Those of ``places`` with these numbers, one after the other; nothing else is read."""
        ...


def open_store(session: Session, path: Path) -> Store:
    """How to find the bursts of ``session``; raises DataError where it holds no pictures."""
    if session.mode.kind == "bursts":
        return _Bursts(session, path)
    if len(session) == 0:
        raise DataError(f"{path}: the session holds no frames; there is nothing to replay")
    return _Frames(session, path) if session.mode.every == 1 else _EveryKth(session, path)


class _Frames:
    """All frames were recorded."""

    def __init__(self, session: Session, path: Path) -> None:
        self._session, self._path = session, path
        self._indices = [int(i) for i in session.indices]

    def burst(self, told: Mapping[str, Any]) -> Burst:
        first, last, n = int(told["first"]), int(told["last"]), int(told["n"])
        frames = [frame for frame in self._between(first, last) if not frame.damaged]
        if len(frames) != n:
            raise DataError(
                f"{self._path}: of the burst of frames {first} to {last} only {len(frames)} of {n} are"
                " recorded; replay without --as-measured measures what is there"
            )
        return burst_of(frames)

    def first_burst(self, n: int) -> tuple[Burst, int]:
        for burst in average_bursts(self._session.frames(), n):
            return burst, burst.last_index
        raise DataError(
            f"{self._path}: fewer than {n} frames without a gap; give a smaller --reference-burst"
        )

    def places_after(self, last: int, n: int | None) -> Places:
        return places_of_frames(self._session, last, n or DEFAULT_BURST)

    def bursts_at(self, places: Places, numbers: range) -> Iterator[Burst]:
        return average_bursts(self._session.frames(*places.rows(numbers)), places.n)

    def _between(self, first: int, last: int) -> Iterator[Frame]:
        start, stop = bisect_left(self._indices, first), bisect_right(self._indices, last)
        return self._session.frames(start, stop)


class _EveryKth(_Frames):
    """Only every K-th frame was recorded: what is left is taken as a slower camera."""

    def burst(self, told: Mapping[str, Any]) -> Burst:
        """What was recorded of a burst; where that is nothing, the recorded frame next to it."""
        first, last = int(told["first"]), int(told["last"])
        frames = [frame for frame in self._between(first, last) if not frame.damaged]
        frames = (
            frames or [frame for frame in self._between(first, self._indices[-1]) if not frame.damaged][:1]
        )
        if not frames:
            raise DataError(
                f"{self._path}: of the frames {first} to {last}, and after them, none is recorded"
            )
        return _averaged(frames)

    def first_burst(self, n: int) -> tuple[Burst, int]:
        frames = [frame for frame in self._session.frames(0, n) if not frame.damaged]
        if len(frames) < n:
            raise DataError(f"{self._path}: fewer than {n} whole frames; give a smaller --reference-burst")
        return _averaged(frames), frames[-1].index

    def places_after(self, last: int, n: int | None) -> Places:
        if n is not None and n > 1:
            raise ConfigError(
                f"{self._path} holds only one frame in {self._session.mode.every}, {n} of them are no burst;"
                " give --burst 1"
            )
        return super().places_after(last, 1)


def _averaged(frames: Sequence[Frame]) -> Burst:
    """The mean of frames that do not follow one another; numbered as they are at the source."""
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
            raise DataError(f"{path}: the session holds no bursts; there is nothing to replay")

    def burst(self, told: Mapping[str, Any]) -> Burst:
        number = self._numbers.get((int(told["first"]), int(told["last"])))
        if number is None:
            raise DataError(
                f"{self._path}: the burst of frames {told['first']} to {told['last']} was not recorded;"
                " replay without --as-measured measures what is there"
            )
        return self._session.burst(number)

    def first_burst(self, n: int) -> tuple[Burst, int]:
        raise ConfigError(f"{self._path} holds bursts, not frames; --reference-burst cannot be changed")

    def places_after(self, last: int, n: int | None) -> Places:
        places = places_of_bursts(self._session, last)
        lengths = self._session.burst_column("n")[places.starts]
        if n is not None and np.any(other := lengths != n):
            length = int(lengths[np.argmax(other)])
            raise ConfigError(f"{self._path} holds bursts of {length} frames; give --burst {length}")
        return places

    def bursts_at(self, places: Places, numbers: range) -> Iterator[Burst]:
        return map(self._session.burst, places.starts[numbers.start : numbers.stop].tolist())
