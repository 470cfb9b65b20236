"""Tare as an order: at once without load or before the test, by two orders within 3 s under load in mid-test.

A tare in mid-test moves the zero of every force after it: modulus, stress and yield point are then
those of two different zeros. So one key pressed by mistake must not do it, and what was done can be undone.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

from acquire.events import EventKind, Level
from acquire.load_sample import LoadCellInfo, LoadSample
from live.operate.refusal import OrderRefused

FORCED, UNDO = "force", "undo"
"""What an order of ``EventKind.TARE`` may say besides nothing."""
CONFIRM_S = 3.0
LITTLE = 1e-3  # of the capacity: no load

Tell = Callable[[EventKind, str, str, Level], None]  # kind, source, sentence, level


class Tared(Protocol):
    """What is used of a load cell."""

    @property
    def info(self) -> LoadCellInfo: ...

    def tare(self, *, force: bool = False) -> None: ...

    def undo_tare(self) -> None: ...


class TareOrders:
    """Carries out orders to tare.

    Parameters
    ----------
    cell : LoadCell
    measured : callable
        Whether anything has been measured yet; before that a tare falsifies nothing.
    latest : callable giving LoadSample or None
        The newest sample.
    tell : callable taking kind, source, text and level
    clock : callable giving monotonic seconds
    """

    def __init__(
        self,
        cell: Tared,
        measured: Callable[[], bool],
        latest: Callable[[], LoadSample | None],
        tell: Tell,
        clock: Callable[[], float],
    ) -> None:
        self._cell, self._measured, self._latest = cell, measured, latest
        self._tell, self._clock = tell, clock
        self._asked = -math.inf  # when a confirmation was asked for

    def order(self, how: str = "") -> None:
        """Tare; FORCED: whatever the load does; UNDO: let zero be where it was before the last tare.

        Raises
        ------
        OrderRefused
            There is nothing to tare, or it has to be ordered again.
        """
        if self._cell.info.protocol == "none":
            raise OrderRefused("there is no load cell")
        asked, self._asked = self._asked, -math.inf
        risk = "" if how else self._risk()
        if how == UNDO:
            self._tell(EventKind.TARE, "operator", "undo the last tare", "info")
            self._cell.undo_tare()
        elif risk and self._clock() - asked > CONFIRM_S:
            self._asked = self._clock()
            text = (
                f"{risk}: forces before and after a tare have different zeros, and so have modulus and stress"
            )
            raise OrderRefused(f"{text}; order it again within {CONFIRM_S:g} s to do it")
        else:
            self._tell(EventKind.TARE, "operator", "tare" + (", forced" if how else ""), "info")
            self._cell.tare(force=how == FORCED)

    def _risk(self) -> str:
        """Why a tare now would falsify what was measured; "" where it would not."""
        sample, capacity = self._latest(), self._cell.info.capacity_N
        if sample is None or not self._measured() or abs(sample.force) <= LITTLE * (capacity or 0.0):
            return ""
        load = "an unknown load" if math.isnan(sample.force) else f"{sample.force:.6g} N"
        return f"not tared yet: {load} in mid-test"
