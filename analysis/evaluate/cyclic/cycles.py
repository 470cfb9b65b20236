"""The cycles of a test, counted as readings and bursts come in: a table of one row each.

A peak counts when the load has fallen from it by a tenth of the whole range of the test so far, and by ``_SURE``
standard deviations of its noise; so has a valley (``reversals``). A cycle lies about the middle between the crossings
of its mean level beside the peak, which the noise of a flat peak does not move, and is as long as the distance from the
middle before, after a pause as that to the next. Without a load the strain itself is what turns.

Noise and drift turn at random: cycles are there from ``MIN_CYCLES`` on, most of which must be as long and as high as
the one before, within a factor (``is_cyclic``). Memory is bounded: what lies before the last whole cycle is forgotten,
a cycle of more than ``_KEPT`` readings is thinned.
"""

from __future__ import annotations

import itertools
import math
from array import array
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.evaluate.curve import noise
from analysis.evaluate.cyclic.loop import BurstStrains, Loops, Waves
from analysis.evaluate.lag import Track
from analysis.evaluate.programme import reversals

Floats = NDArray[np.float64]
MIN_CYCLES = 4
"""Fewer are none."""
# Standard deviations of the noise, and share of the whole range: what a cycle exceeds
_SURE, _LEAST = 12.0, 0.1
_SHARE, _FACTOR = 0.8, 1.2  # of the cycles that must be like the one before, and how like
# Of blocks: so many of both durations and ranges a cycle are alike, and so many more
_FIGURES, _CERTAIN = 1.3, 5
_PAUSE = 1.5  # of the distance to the next cycle
_KEPT = 16_384  # readings, of a cycle that goes on
_BLOCK = 32_768  # readings and bursts that are taken at once, of a test that is over
_WAIT = 16  # of the readings that are kept, as a share of 1: so many new ones are looked at together
_LACKING = 1 / 16  # of a cycle: what may lack at the end of the test, and since when a load falls no longer


class Cycle(NamedTuple):
    """One cycle; NaN where a figure is not known.

    A mean is the middle of peak and valley (ASTM E1823), a ``sigma_`` a standard uncertainty.
    Loads are in Pa or N, as given; ``t`` is the beginning. Figures of the strain and of the loop are as of ``Loops``.
    """

    number: int
    t: float
    duration: float
    bursts: float
    peak_load: float
    valley_load: float
    mean_load: float
    range_load: float
    sigma_range_load: float
    peak_strain: float
    valley_strain: float
    mean_strain: float
    range_strain: float
    sigma_range_strain: float
    modulus: float
    sigma_modulus: float
    area: float
    sigma_area: float
    phase: float
    sigma_phase: float
    why: str


class CycleCounter:
    """Counts cycles of what comes in pieces.

    Parameters
    ----------
    loaded : bool
        There is a load; else the strain is what turns.

    Attributes
    ----------
    count : int
        Cycles so far.
    """

    def __init__(self, *, loaded: bool) -> None:
        self._loaded = loaded
        self._load, self._bursts = Track.joined(()), BurstStrains(*np.empty((3, 0)))
        self._low, self._high, self._middle = math.inf, -math.inf, math.nan
        self._last: tuple[float, float, float] | None = None  # duration, range seen, and range at least
        self._alike = self._figures = self.count = 0
        self._waiting: list[tuple[Track, BurstStrains]] = []

    @property
    def is_cyclic(self) -> bool:
        """Whether what was counted are cycles, and not noise that turns at random."""
        steps = self.count - 1
        return self.count >= MIN_CYCLES and (
            self._alike >= _SHARE * steps or self._figures >= _FIGURES * steps + _CERTAIN
        )

    def add(self, load: Track, bursts: BurstStrains, *, ended: bool = False) -> list[Cycle]:
        """The cycles that are complete with these; one of number 1 says that those before were none.

        ``ended``: nothing follows. Both have increasing times, and follow those before.
        """
        bursts = bursts.part(np.isfinite(bursts.strain))
        load = (load if self._loaded else Track(bursts.t, bursts.strain)).known()
        self._waiting.append((load, bursts))
        if not ended and sum(len(one.t) for one, _ in self._waiting) * _WAIT < len(self._load.t):
            return []
        self._take()
        found = self._complete(ended)
        self._forget()
        return found

    def _take(self) -> None:
        loads, bursts = zip(*self._waiting, strict=True)
        self._waiting.clear()
        self._bursts = BurstStrains(
            *(np.concatenate(pair) for pair in zip(self._bursts, *bursts, strict=True))
        )
        t = np.concatenate([self._load.t, *(one.t for one in loads)])
        y = np.concatenate([self._load.values, *(one.values for one in loads)])
        kept = ~_lone(y, _LEAST / 2 * float(np.ptp(y))) if len(y) else np.ones(0, np.bool_)
        self._load = Track(t[kept], y[kept])
        self._low = min(self._low, self._load.values.min(initial=math.inf))
        self._high = max(self._high, self._load.values.max(initial=-math.inf))

    def _complete(self, ended: bool) -> list[Cycle]:
        if not len(self._load.t) or not len(self._bursts.t):
            return []
        until = float(self._load.t[-1] if ended else min(self._load.t[-1], self._bursts.t[-1]))
        sigma = noise(self._load.values, 4)
        middle, least, lowest = np.array(self._middles(sigma)).reshape(-1, 3).T
        if not len(middle) or (len(middle) < 2 and math.isnan(self._middle)):
            return []
        before = 2 * middle[0] - middle[1] if math.isnan(self._middle) else self._middle
        duration, after = np.diff(middle, prepend=before), np.append(np.diff(middle), math.inf)
        duration = np.where(duration > _PAUSE * after, after, duration)  # a pause is no part of a cycle
        over = middle + duration * (0.5 - _LACKING * ended) <= until
        over &= ended | (lowest + duration * _LACKING <= self._load.t[-1])  # it falls no longer
        n = int(np.count_nonzero(np.cumprod(over)))
        middle, duration = middle[:n], duration[:n]
        if not n:
            return []
        self._middle = float(middle[-1])
        return list(self._counted(Waves(self._load, middle, duration, sigma, least[:n])))

    def _middles(self, sigma: float) -> list[tuple[float, float, float]]:
        """Middles of the upper halves with a fall on either side (s), the smaller fall, and when the load is lowest."""
        t, y = self._load.t, self._load.values
        least = max(_LEAST * (self._high - self._low), _SURE * sigma)
        turns = reversals(y, least) if least > 0 else []
        falls = len(turns) > 0 and y[turns[0]] > y[turns[0] : turns[1] + 1 if len(turns) > 1 else None].min()
        peaks = turns[0 if falls else 1 :: 2]
        found = list[tuple[float, float, float]]()
        for before, k, after in zip([0, *peaks], peaks, [*peaks[1:], len(y)], strict=False):
            low = max(y[before : k + 1].min(), y[k:after].min())
            level = (y[k] + low) / 2
            up, down = np.flatnonzero(y[before:k] < level), np.flatnonzero(y[k:after] < level)
            if len(up) and len(down):
                rise, fall = before + int(up[-1]), k + int(down[0]) - 1
                middle = (_crossing(t, y, rise, level) + _crossing(t, y, fall, level)) / 2
                found.append((middle, float(y[k] - low), float(t[k + y[k:after].argmin()])))
        return found

    def _counted(self, waves: Waves) -> Iterator[Cycle]:
        whole, load = self._high - self._low, np.array([waves.peak, waves.valley, waves.sigma_range])
        loops = Loops.of(waves, self._bursts) if self._loaded else Loops.of_strain(waves)
        swings = [
            (high, low, (high + low) / 2, high - low, sigma)
            for high, low, sigma in (load if self._loaded else np.full(load.shape, np.nan), loops.figures[:3])
        ]
        start = waves.middle - waves.duration / 2
        rows = np.array([start, waves.duration, loops.bursts, *swings[0], *swings[1], *loops.figures[3:]]).T
        sizes = zip(waves.size.tolist(), waves.least.tolist(), strict=True)
        for row, (size, least), why in zip(rows.tolist(), sizes, loops.why, strict=True):
            if self._last is not None and self._last[2] < _LEAST * whole:
                self.count, self._alike, self._figures, self._last = 0, 0, 0, None
            steps = () if self._last is None else (row[1] / self._last[0], size / self._last[1])
            alike = [1 / _FACTOR < step < _FACTOR for step in steps]
            self._alike, self._figures = self._alike + (alike == [True, True]), self._figures + sum(alike)
            self.count, self._last = self.count + 1, (row[1], size, least)
            yield Cycle._make((self.count, *row, why))

    def _forget(self) -> None:
        """What lies before the middle of the last cycle, and every second one of many."""
        load, bursts = _kept(self._load.t, self._middle), _kept(self._bursts.t, self._middle)
        self._load = Track(self._load.t[load], self._load.values[load])
        self._bursts = self._bursts.part(bursts)


def _lone(y: Floats, least: float) -> NDArray[np.bool_]:
    """Which readings are off their four neighbours by ``least`` and four times what those differ by: no peaks, (N,)."""
    lone, far = np.zeros(len(y), np.bool_), np.abs(np.diff(y)) > 0.75 * least  # from a neighbour as well
    k = np.flatnonzero(far[1:-2] & far[2:-1]) + 2
    around = y[k[:, None] + np.array([-2, -1, 1, 2])]
    off = np.abs(y[k] - np.median(around, axis=1))
    lone[k] = (off > least) & (off > 4 * np.ptp(around, axis=1))
    return lone


def _kept(t: Floats, since: float) -> slice:
    first = 0 if math.isnan(since) else int(np.searchsorted(t, since))
    return slice(first, None, 2 if len(t) - first > _KEPT else 1)


def _crossing(t: Floats, y: Floats, i: int, level: float) -> float:
    """When ``y`` is at ``level`` between two readings."""
    return float(t[i] + (t[i + 1] - t[i]) * (level - y[i]) / (y[i + 1] - y[i]))


def _side_by_side(load: Iterable[Track], bursts: BurstStrains) -> Iterator[tuple[Track, BurstStrains, bool]]:
    """Load and bursts of the same times, at most ``_BLOCK`` of each, and whether nothing follows."""
    waiting, first, done = Track.joined(()), 0, -math.inf
    for block in itertools.chain(_blocks(load), [None]):
        until = math.inf if block is None else float(block.t[0])
        if len(waiting.t) or block is None:
            for done in sorted(t for t in {*bursts.t[_BLOCK::_BLOCK].tolist(), until} if done < t <= until):
                n, last = (int(np.searchsorted(t, done)) for t in (waiting.t, bursts.t))
                yield (
                    Track(waiting.t[:n], waiting.values[:n]),
                    bursts.part(slice(first, last)),
                    done == math.inf,
                )
                waiting, first = Track(waiting.t[n:], waiting.values[n:]), last
        waiting = waiting if block is None else Track.joined((waiting, block))


def _blocks(pieces: Iterable[Track]) -> Iterator[Track]:
    """The same in blocks of ``_BLOCK``; the last has fewer."""
    rest = Track.joined(())
    for piece in pieces:
        rest = Track.joined((rest, piece))
        whole = len(rest.t) - len(rest.t) % _BLOCK
        for k in range(0, whole, _BLOCK):
            yield Track(rest.t[k : k + _BLOCK], rest.values[k : k + _BLOCK])
        rest = Track(rest.t[whole:], rest.values[whole:])
    if len(rest.t):
        yield rest


class CycleTable:
    """The cycles of a test, by column.

    Attributes
    ----------
    values : (N, 20) float64
        The numbers of ``Cycle``, in its order.
    why : tuple of str
        Why figures of the strain or of the loop are not known; empty where they are.
    """

    def __init__(self, values: Floats, why: tuple[str, ...]) -> None:
        self.values, self.why = values, why

    @classmethod
    def none(cls) -> CycleTable:
        """No cycle."""
        return cls(np.empty((0, len(Cycle._fields) - 1)), ())

    @classmethod
    def of(cls, load: Iterable[Track] | None, bursts: BurstStrains, start_t: float = 0.0) -> CycleTable:
        """Cycles of a finished test; without a ``load``, which comes by the piece, by the strain.

        Both have increasing times, s; ``start_t`` is the zero of those of the table.
        """
        counter = CycleCounter(loaded=load is not None)
        numbers, why = array("d"), list[str]()
        for piece, part, ended in _side_by_side(load or (), bursts):
            for cycle in counter.add(piece, part, ended=ended):
                if cycle.number == 1:
                    del numbers[:], why[:]
                numbers.extend(cycle._replace(t=cycle.t - start_t)[:-1])
                why.append(cycle.why)
        if not counter.is_cyclic:
            del numbers[:], why[:]
        return cls(np.array(numbers).reshape(len(why), len(Cycle._fields) - 1), tuple(why))

    def __len__(self) -> int:
        return len(self.why)

    def column(self, name: str) -> Floats:
        """One of ``Cycle``, (N,)."""
        return self.values[:, Cycle._fields.index(name)]
