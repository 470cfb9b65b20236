"""A reference burst, whole and as two halves."""

from __future__ import annotations

import logging
from dataclasses import dataclass

from acquire.burst import BurstAccumulator
from acquire.frame import Burst, Frame

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """A reference burst, and its two halves for the check that nothing moved (none for n < 4)."""

    burst: Burst
    halves: tuple[Burst, Burst] | None


class ReferenceTaker:
    """Accumulates n frames as a whole and as two halves."""

    def __init__(self, n: int) -> None:
        self._n = n
        self._whole = BurstAccumulator(n)
        self._half: BurstAccumulator | None = None
        self._halves: list[Burst] = []
        self._begin_half()

    def _begin_half(self) -> None:
        self._half = BurstAccumulator(self._n // 2) if self._n >= 4 else None

    def add(self, frame: Frame) -> Reference | None:
        """Take a frame; the reference when it is complete."""
        if self._half is not None and (half := self._half.add(frame)) is not None:
            self._halves = [*self._halves[-1:], half]
        whole = self._whole.add(frame)
        if whole is None:
            return None
        pair = (self._halves[0], self._halves[1]) if len(self._halves) == 2 else None
        return Reference(whole, pair)
