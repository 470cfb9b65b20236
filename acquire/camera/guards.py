"""Guards around drivers that hide their faults: repeated pictures, dead handles, lost frames.

Pure: told of pictures and times, they answer; they touch no device and read no clock.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


class RepeatGuard:
    """Finds a driver that hands out the same picture again and again.

    A sensor has noise: three pictures that agree in every bit are one picture.

    Parameters
    ----------
    limit : int
        Equal pictures in a row from which on they count as repeated.
    """

    def __init__(self, limit: int = 3) -> None:
        self._limit = limit
        self._last: NDArray[Any] | None = None
        self.run = 0

    def repeated(self, image: NDArray[Any]) -> bool:
        """Whether this picture is the last of ``limit`` or more equal ones."""
        same = self._last is not None and np.array_equal(self._last, image)
        self.run = self.run + 1 if same else 1
        self._last = image
        return self.run >= self._limit

    @property
    def just_found(self) -> bool:
        """Whether the last picture was the first to count as repeated (for one message a run)."""
        return self.run == self._limit


class FailureGuard:
    """Tells a read that failed at once (a dead handle) from one that waited in vain (a stall).

    Parameters
    ----------
    instant_s : float, s
        A failure faster than this waited for nothing.
    """

    def __init__(self, instant_s: float = 0.005) -> None:
        self._instant_s = instant_s

    def verdict(self, took_s: float) -> str:
        """Words for a failed read that took so long."""
        if took_s < self._instant_s:
            return "the device is gone or dead (its reads fail at once)"
        return f"no picture within {took_s:.1f} s"


def missing_between(earlier_t: float, later_t: float, fps: float | None) -> int:
    """How many frames a steady camera must have lost between two stamps, by their distance.

    Parameters
    ----------
    earlier_t, later_t : float, s
    fps : float or None, 1/s
        None or 0: nobody knows, 0 is the answer.
    """
    if not fps:
        return 0
    return max(0, round((later_t - earlier_t) * fps) - 1)
