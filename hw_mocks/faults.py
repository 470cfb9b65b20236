"""Faults by name, at a time of the test: ``faults=drop@5,stall@8*1.5`` in a ``sim:`` address.

Each may carry an amount after a star; its meaning stands with the fault. ``FaultPlan`` reads and finds them for any
device; the simulated camera has its frames from here too: which come, and what happens to them.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from acquire.errors import ConfigError

# name: amount where none is given
CAMERA_FAULTS: Mapping[str, float] = {
    "drop": 3,  # so many frames are lost
    "damage": 1,  # so many frames come flagged as damaged, half black
    "stall": 1.0,  # no frames for so many seconds
    "disconnect": 2.0,  # gone for so many seconds, then back
    "gone": 0,  # gone for good
}
SERIAL_FAULTS: Mapping[str, float] = {
    "partial": 1,  # the next line begins in its middle
    "garbage": 40,  # so many random bytes between two lines
    "nul": 8,  # so many NUL bytes
    "split": 1,  # so many lines come in two writes, with a pause between
    "silence": 1.0,  # nothing for so many seconds; those lines are never sent
    "late": 1.0,  # nothing for so many seconds, then all its lines at once
    "backlog": 5.0,  # so many seconds of old lines at once, on top
    "unplug": 1.0,  # the port is gone for so many seconds; comes back under the same name
    "reset": 1.0,  # the device restarts: its banner, its clock from 0
    "overload": 1.0,  # overload for so many seconds
    "unstable": 1.0,  # readings are called unstable for so many seconds
    "unit": 1.0,  # another unit for so many seconds
    "comma": 1.0,  # decimal comma for so many seconds
    "cr": 1.0,  # lines end in CR alone for so many seconds
    "duplicate": 1,  # so many lines come twice
    "jump": 3600.0,  # the device's clock jumps by so many seconds
    "rate": 0.5,  # from here on this part of the promised rate
}


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that will go wrong.

    Attributes
    ----------
    name : str
    t : float, s
        Since the start of the test.
    amount : float
        Seconds, frames, lines or bytes: see the tables above.
    """

    name: str
    t: float
    amount: float


class FaultPlan:
    """The faults of one device, in order of time.

    Parameters
    ----------
    faults : sequence of Fault
    """

    def __init__(self, faults: tuple[Fault, ...] = ()) -> None:
        self._faults = sorted(faults, key=lambda fault: fault.t)
        self._begun: set[int] = set()

    def lasting(self, name: str, t: float) -> Fault | None:
        """The fault of this name in force at ``t``, its amount being seconds."""
        for fault in self._faults:
            if fault.name == name and fault.t <= t < fault.t + fault.amount:
                return fault
        return None

    def begun(self, name: str, t: float) -> Fault | None:
        """The fault of this name whose time has come, given once each."""
        for i, fault in enumerate(self._faults):
            if fault.name == name and fault.t <= t and i not in self._begun:
                self._begun.add(i)
                return fault
        return None


def parse_faults(text: str, allowed: Mapping[str, float], where: str) -> FaultPlan:
    """Read ``name@seconds[*amount],...``.

    Parameters
    ----------
    text : str
    allowed : mapping of name to the amount where none is given
    where : str
        The address, for messages.

    Raises
    ------
    ConfigError
        An unknown name or a malformed entry; lists the known names.
    """
    return FaultPlan(tuple(_parse(part.strip(), allowed, where) for part in text.split(",") if part.strip()))


def _parse(text: str, allowed: Mapping[str, float], where: str) -> Fault:
    name, at, rest = text.partition("@")
    time, star, amount = rest.partition("*")
    if name not in allowed:
        raise ConfigError(
            "{where}: unknown fault {name}; known: {listed}", where, repr(name), ", ".join(allowed)
        )
    try:
        fault = Fault(name, float(time), float(amount) if star else allowed[name])
    except ValueError:
        fault = Fault(name, -1.0, 0.0)
    if not at or not (0 <= fault.t < float("inf") and 0 <= fault.amount < float("inf")):
        raise ConfigError(
            "{where}: fault {text}; write name@seconds or name@seconds*amount", where, repr(text)
        )
    return fault


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
    for index in itertools.takewhile(lambda index: index <= duration_s * fps + 1e-9, itertools.count()):
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
