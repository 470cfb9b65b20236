"""Where the bursts of recorded frames lie, told by the table alone: what comes before a part need not be read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquire.session import Session


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """The bursts of a session in order.

    Attributes
    ----------
    n : int
        Frames in each; 0 where they were recorded as bursts.
    t : (B,) float64, s
        Their times, monotonic, to the last bit those that the bursts have.
    starts, stops : (B,) int64
        Rows to be read for each: from the end of the burst before, so that a burst knows what was lost before it.
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


def places_of_frames(session: Session, last: int, n: int) -> Places:
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
    return Places(n, np.array(times, np.float64), starts, ends)


def burst_ends(index: Sequence[int], lost_before: Sequence[int], damaged: Sequence[int], n: int) -> list[int]:
    """The row after each burst of n frames without a gap; tests hold it to ``BurstAccumulator``."""
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
    """Of a burst of these frames."""
    if len(times) == 1:
        return times[0]
    start = times[0]
    return start + math.fsum(t - start for t in times) / len(times)


def places_of_bursts(session: Session, last: int) -> Places:
    """The bursts that were recorded as such after sequence number ``last``; rows are their numbers."""
    numbers = np.flatnonzero(session.burst_column("first_index") > last).astype(np.int64)
    return Places(0, session.burst_column("monotonic_s")[numbers], numbers, numbers + 1)
