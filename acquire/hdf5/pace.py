"""When a file that is written is flushed: often enough for a kill to lose little, seldom enough to cost little."""

from __future__ import annotations

import math
import time
from collections.abc import Callable


class Pace:
    """Says when the next flush is due.

    Parameters
    ----------
    every_s : float, s
        What was written waits no longer for a flush, and flushes are no closer to each other.
    now : callable
        Gives seconds.
    """

    def __init__(self, every_s: float, now: Callable[[], float] = time.monotonic) -> None:
        self._every_s, self._now = every_s, now
        self._last = -math.inf
        self._waits = False

    def wrote(self) -> None:
        """Something waits."""
        self._waits = True

    def began(self) -> None:
        """A flush begins."""
        self._last = self._now()

    def done(self) -> None:
        """It is done: nothing waits."""
        self._waits = False

    def left_s(self) -> float:
        """Time until the next flush is due, s; 0 where it is now, infinite where nothing waits."""
        return max(0.0, self._last + self._every_s - self._now()) if self._waits else math.inf
