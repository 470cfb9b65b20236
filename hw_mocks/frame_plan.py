"""Which frames of a test the simulated camera gives, and what happens to them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from hw_mocks.faults import FaultPlan

Fate = Literal["good", "damaged", "lost", "stalled", "disconnected", "gone"]


@dataclass(frozen=True, slots=True)
class Planned:
    """One frame period.

    Attributes
    ----------
    index : int
    t : float, s
        Mid-exposure, since the start of the test.
    fate : str
    """

    index: int
    t: float
    fate: Fate


def plan_frames(duration_s: float, fps: float, faults: FaultPlan) -> Iterator[Planned]:
    """Every frame period of a test of ``duration_s`` seconds, in order; ends after "gone"."""
    left: dict[str, float] = {"drop": 0.0, "damage": 0.0}
    for index in range(int(duration_s * fps + 1e-9) + 1):
        t = index / fps
        for name in left:
            while fault := faults.begun(name, t):
                left[name] += fault.amount
        fate = _fate(faults, t, left)
        yield Planned(index, t, fate)
        if fate == "gone":
            return


def _fate(faults: FaultPlan, t: float, left: dict[str, float]) -> Fate:
    if faults.begun("gone", t):
        return "gone"
    if faults.lasting("disconnect", t):
        return "disconnected"
    if faults.lasting("stall", t):
        return "stalled"
    fates: tuple[tuple[str, Fate], ...] = (("drop", "lost"), ("damage", "damaged"))
    for name, fate in fates:
        if left[name] >= 1:
            left[name] -= 1
            return fate
    return "good"
