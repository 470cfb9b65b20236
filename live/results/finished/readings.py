"""The readings of a load cell by the piece: 24 h at 1 kHz are 86 million, more than memory holds.

A figure goes through all of them. A curve of more than ``MOST`` is thinned: of each of equally many readings in a row
it has the first, the lowest, the highest, and the first without a value. The lag is looked for in the ``MOST``
readings from the first picture on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from acquire.load_cell import LoadLog
from analysis.evaluate import Figure, Track, find_lag

MOST = 1 << 21
"""Readings that are held at once: 35 minutes at 1 kHz."""
_BEFORE_S = 2.0  # of readings that come before the first picture: a lag may be as large


class Readings:
    """Times (s) and forces (N).

    Parameters
    ----------
    pieces : callable
        Gives an iterator of them in order of time.
    """

    def __init__(self, pieces: Callable[[], Iterator[Track]]) -> None:
        self.pieces = pieces

    @classmethod
    def of(cls, t: NDArray[np.float64], values: NDArray[np.float64]) -> Readings:
        """In one piece."""
        return cls(lambda: iter([Track(t, values)]))

    @classmethod
    def of_log(cls, loads: LoadLog, *, zero_of: float | None = None, late_s: float = 0.0) -> Readings:
        """Those of a log, ``late_s`` earlier and as if the zero of the time ``zero_of`` had held."""
        return cls(lambda: (Track(t - late_s, force) for t, force in loads.pieces(zero_of)))

    @cached_property
    def count(self) -> int:
        """How many there are."""
        return sum(len(piece.t) for piece in self.pieces())

    @cached_property
    def curve(self) -> Track:
        """All, or those of a curve of at most about ``MOST``."""
        return self.thinned(MOST)

    def thinned(self, most: int) -> Track:
        """At most about so many; all where there are no more."""
        each = math.ceil(3 * self.count / most) if self.count > most else 1
        return Track.joined([_thinned(piece, each) for piece in self.pieces()])

    def first(self, since: float = -math.inf) -> Track:
        """All, or the first ``MOST`` from the time ``since`` on."""
        if self.count <= MOST:
            return self.curve
        found, left = list[Track](), MOST
        for piece in self.pieces():
            begin = int(np.searchsorted(piece.t, since))
            found.append(Track(piece.t[begin : begin + left], piece.values[begin : begin + left]))
            left -= len(found[-1].t)
            if not left:
                break
        return Track.joined(found)

    def lag_behind(self, strain: Track) -> Figure:
        """By how much they are stamped later than the strain that they belong to, s."""
        if self.count <= MOST or not len(strain.t):
            return find_lag(strain, self.curve)
        force = self.first(float(strain.t[0]) - _BEFORE_S)
        stop = int(np.searchsorted(strain.t, force.t[-1])) if len(force.t) else 0
        return find_lag(Track(strain.t[:stop], strain.values[:stop]), force)


def _thinned(piece: Track, each: int) -> Track:
    if each == 1:
        return piece
    n, unknown = len(piece.t), np.isnan(piece.values)
    rows = np.append(piece.values, np.full(-n % each, math.nan)).reshape(-1, each)
    lowest, highest = (
        one(np.where(np.isnan(rows), unlike, rows), axis=1)
        for one, unlike in ((np.argmin, math.inf), (np.argmax, -math.inf))
    )
    starts = np.arange(0, n, each)
    firsts = np.append(unknown, np.zeros(-n % each, bool)).reshape(-1, each).argmax(axis=1)
    chosen: NDArray[np.intp] = np.unique(
        [starts, starts + lowest, starts + highest, starts + firsts, 0 * starts + n - 1]
    )
    return Track(piece.t[chosen], piece.values[chosen])
