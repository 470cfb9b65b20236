"""The load against time: filled by one thread while others ask for the force at an instant.

Interpolates, and refuses to where it would invent: outside the log, across a gap, beside an
overload. Lines that gave no reading at all (garbage, flag ERROR), and values that waited somewhere
so that their time is unknown (flag STALE), leave no mark of their own: they are neither a
force at a known time nor a hole, and the gap rule decides. An overload that waited, like lines that were
never read, may have been at any time since the last value: the force is unknown from there on.
"""

from __future__ import annotations

import math
import threading
from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from acquire.events import Event, EventKind
from acquire.files.block_file import BlockFile
from acquire.load_sample import LoadFlag, LoadSample
from acquire.text import Message

PIECE = 1 << 16
"""Readings that ``LoadLog.pieces`` gives at once."""
_BEYOND = LoadFlag.OVERLOAD | LoadFlag.UNDERLOAD
ROWS = 1 << 13
"""Readings of a block, which is read at once."""
Block = NDArray[np.float64]


class StoredReadings:
    """Times, which do not fall, and forces: the newest in memory, those before in a temporary file.

    One thread at a time may use it.
    """

    def __init__(self) -> None:
        self._file = BlockFile()
        self._filed: list[Block | int] = []
        self._starts = array("d")  # first time of each block that is filed
        self._times, self._forces = array("d"), array("d")  # of the block that is not full yet
        # Number and content of the block that was used last.
        self._used: tuple[int, Block] = -1, np.empty((2, 0))

    def append(self, t: float, force: float) -> None:
        """Add the newest."""
        self._times.append(t)
        self._forces.append(force)
        if len(self._times) == ROWS:
            block = np.array([self._times, self._forces])
            self._used = len(self._filed), block
            self._starts.append(self._times[0])
            self._filed.append(self._file.put(block))
            self._times, self._forces = array("d"), array("d")

    def __len__(self) -> int:
        return len(self._filed) * ROWS + len(self._times)

    @property
    def last_t(self) -> float:
        """Time of the newest of one or more, s."""
        return self._times[-1] if self._times else float(self._block(len(self._filed) - 1)[0, -1])

    def before(self, t: float) -> int:
        """The number of readings before ``t``."""
        if self._times and self._times[0] < t:
            return len(self._filed) * ROWS + bisect_left(self._times, t)
        k = bisect_left(self._starts, t) - 1
        return 0 if k < 0 else k * ROWS + int(np.searchsorted(self._block(k)[0], t))

    def until(self, t: float) -> int:
        """The number of readings before ``t`` and at it."""
        if self._times and self._times[0] <= t:
            return len(self._filed) * ROWS + bisect_right(self._times, t)
        k = bisect_right(self._starts, t) - 1
        return 0 if k < 0 else k * ROWS + int(np.searchsorted(self._block(k)[0], t, side="right"))

    def at(self, i: int) -> tuple[float, float]:
        """Time (s) and force (N) of one."""
        k, row = divmod(i, ROWS)
        if k == len(self._filed):
            return self._times[row], self._forces[row]
        t, force = self._block(k)[:, row].tolist()
        return t, force

    def part(self, first: int, stop: int) -> Block:
        """Times and forces from ``first`` up to, not including, ``stop``, (2, N)."""
        numbers = range(first // ROWS, -(-stop // ROWS) if stop > first else 0)
        parts = [self._block(k)[:, max(first - k * ROWS, 0) : stop - k * ROWS] for k in numbers]
        return np.concatenate([np.empty((2, 0)), *parts], axis=1)

    def _block(self, k: int) -> Block:
        if k == len(self._filed):
            return np.array([self._times, self._forces])
        if self._used[0] != k:
            stored = self._filed[k]
            numbers = (
                self._file.get(stored, "d", 2 * ROWS).reshape(2, ROWS) if isinstance(stored, int) else stored
            )
            self._used = k, numbers
        return self._used[1]


class LoadLog:
    """All samples so far; every method may be called from any thread.

    Parameters
    ----------
    max_gap_s : float, s
        Between samples further apart than this the force is not known.
    lag_s : float, s
        By which samples are stamped later than the load they show; taken off by ``force_at``.
    by_name : bool
        Each force was given for a frame: there are no times that could lag.
    """

    def __init__(self, max_gap_s: float = 0.25, lag_s: float = 0.0, *, by_name: bool = False) -> None:
        self._max_gap_s, self.lag_s, self.by_name = max_gap_s, lag_s, by_name
        self._stored = StoredReadings()
        self._zeros: list[tuple[float, float]] = []
        self._latest: LoadSample | None = None
        self._telling: LoadSample | None = None
        self._count = 0
        self._closed = False
        self._lock = threading.Lock()

    def append(self, sample: LoadSample) -> None:
        """Add a sample; a time before the last one counts as the last one's."""
        with self._lock:
            self._latest = sample
            self._count += 1
            none, stale = math.isnan(sample.force), LoadFlag.STALE in sample.flags
            if sample.flags & _BEYOND or not (none or stale):
                self._telling = sample
            if (stale and not none) or (none and LoadFlag.ERROR in sample.flags):
                return
            if stale and len(self._stored):
                self._stored.append(self._stored.last_t, math.nan)
            self._add(sample.t, sample.force)

    def extend(self, times: NDArray[np.float64], forces: NDArray[np.float64]) -> None:
        """Add many samples at once, (N,) s and N; their times rise, and follow those before."""
        with self._lock:
            for t, force in zip(times.tolist(), forces.tolist(), strict=True):
                self._stored.append(t, force)
            self._count += len(times)
            if len(times):
                self._latest = LoadSample(float(times[-1]), float(forces[-1]))

    def _add(self, t: float, force: float) -> None:
        self._stored.append(max(t, self._stored.last_t) if len(self._stored) else t, force)

    def take_event(self, event: Event) -> None:
        """Note a tare with the amount by which forces fall (``step_N``); other events are ignored."""
        step = event.data.get("step_N")
        if event.kind is EventKind.TARE and isinstance(step, int | float) and math.isfinite(step):
            with self._lock:
                self._zeros.append((event.t, float(step)))

    def zero_at(self, t: float) -> float:
        """What the tares before ``t`` have taken off the force, N: added to it, one zero holds for all."""
        with self._lock:
            return math.fsum(step for since, step in self._zeros if since <= t)

    def close(self) -> None:
        """No more samples will come."""
        with self._lock:
            self._closed = True

    def covers(self, t: float) -> bool:
        """Whether waiting longer cannot change ``force_at(t)``."""
        with self._lock:
            if self._closed or not len(self._stored):
                return self._closed
            return self._stored.last_t >= t + max(self.lag_s, 0.0)

    def force_at(self, t: float) -> float:
        """The force at an instant, N.

        Parameters
        ----------
        t : float, s
            Monotonic.

        Returns
        -------
        float, N
            Linear between the samples before and after; NaN before the first and after the
            last sample, across a gap longer than ``max_gap_s`` and beside a NaN sample.
        """
        return self._at(t + self.lag_s)

    def forces_one_zero(self, times: Iterable[float]) -> NDArray[np.float64]:
        """``force_at`` each of ``times``, (N,) N, as if the zero of the first had held: a tare is no unloading."""
        times = list(times)
        zero = self.zero_at(times[0]) if times else 0.0
        return np.array([self.force_at(t) + self.zero_at(t) - zero for t in times], np.float64)

    def raw_force_at(self, t: float) -> float:
        """The same with the samples as they are stamped; NaN where no lag is taken off."""
        return self._at(t) if self.lag_s else math.nan

    def _at(self, t: float) -> float:
        with self._lock:
            after = self._stored.before(t)
            if after == len(self._stored):
                return math.nan
            later, force = self._stored.at(after)
            if later == t:
                return force
            if after == 0:
                return math.nan
            before, force_before = self._stored.at(after - 1)
        gap = later - before
        if gap > self._max_gap_s:
            return math.nan
        return force_before + (t - before) / gap * (force - force_before)

    def why_none_at(self, t: float) -> str:
        """Why ``force_at`` knows no force at ``t``, and what can be done."""
        with self._lock:
            after = self._stored.before(t + self.lag_s)
            if after in (0, len(self._stored)):
                return (
                    Message("no reading of the load cell came before it")
                    if not after
                    else Message("no reading came after it")
                )
            gap = self._stored.at(after)[0] - self._stored.at(after - 1)[0]
        if gap <= self._max_gap_s:
            return Message("the readings beside it have no value (overload, tare, lines lost)")
        return Message(
            "readings of the load cell with a time are {gap:.2g} s apart, load.max_gap_s is {max_gap_s:g} "
            "s; let it send more often, or set load.max_gap_s",
            gap,
            self._max_gap_s,
        )

    def mean(self, t0: float, t1: float) -> tuple[float, int]:
        """The mean force of the samples with t0 <= t <= t1, N, and their number.

        NaN where there is none, or where one of them is NaN (an overload is not averaged away).
        """
        with self._lock:
            chosen = self._stored.part(self._stored.before(t0), self._stored.until(t1))[1]
        return (math.fsum(chosen) / len(chosen) if len(chosen) else math.nan), len(chosen)

    @property
    def latest(self) -> LoadSample | None:
        """The newest sample, valid or not."""
        return self._latest

    @property
    def telling(self) -> LoadSample | None:
        """The newest sample that tells the force at a known time, or that it is beyond the range of the cell."""
        return self._telling

    def __len__(self) -> int:
        """Samples appended, lines without a reading included."""
        return self._count

    def arrays(
        self, first: int = 0, until: float = math.inf, zero_of: float | None = None, most: int | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times (N,) in monotonic s and forces (N,) in N, as they are interpolated.

        Parameters
        ----------
        first : int
            Without as many before.
        until : float, s
            Not later.
        zero_of : float, s, optional
            As if the zero of this time had held: a tare is no unloading.
        most : int, optional
            Not more than so many.
        """
        with self._lock:
            stop = len(self._stored) if until == math.inf else self._stored.until(until)
            t, force = self._stored.part(first, stop if most is None else min(first + most, stop))
            if zero_of is not None:
                for since, step in self._zeros:
                    force += step * ((t >= since).astype(float) - (zero_of >= since))
        return t, force

    def pieces(
        self, zero_of: float | None = None
    ) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """The same by the piece, none of which is empty: a day of readings is larger than memory."""
        first = 0
        while len((piece := self.arrays(first, zero_of=zero_of, most=PIECE))[0]):
            yield piece
            first += PIECE
