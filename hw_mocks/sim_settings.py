"""Settings and faults of simulated devices: ``sim:KIND?key=value&faults=drop@5,stall@8*1.5``.

A fault has a name and a time of the test, and may carry an amount after a star; its meaning stands with the fault.
``FaultPlan`` reads and finds them for any device; the simulated camera has its frames from here too: which come, and
what happens to them.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from acquire.bounds import number_of
from acquire.errors import ConfigError
from acquire.settings import FLAG, TEXT, choice, number, setting, settings_of, whole

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

BITS = (8, 10, 12, 16)

Fate = Literal["good", "damaged", "lost", "stalled", "disconnected", "gone"]


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


def _fps(word: str) -> float:
    """0 for auto."""
    return 0.0 if word == "auto" else number_of(word, 0.1, 10_000)


# fmt: off
@dataclass(frozen=True)
class SpecimenSettings:
    """Of ``sim:``: the specimen and its test."""

    width: int = setting(whole(32, 8192), 640, "of the pictures", "px")
    height: int = setting(whole(32, 8192), 512, "of the pictures", "px")
    E_GPa: float = setting(number(1e-3), 70.0, "Young's modulus", "GPa")
    nu: float = setting(number(0, 0.5), 0.33, "Poisson's ratio")
    yield_MPa: float | None = setting(number(1e-3), None, "yield stress; where not given 140, of halves 120", "MPa")
    yield2_MPa: float | None = setting(number(1e-3), None, "of the lower half of halves; where not given 160", "MPa")
    n: float | None = setting(
        number(0.01, 0.9), None,
        "hardening exponent of a sheet metal; with programme=cyclic: cycles, from 1, default 10",
    )
    r: float | None = setting(
        number(0.05, 10), None,
        "anisotropy of a sheet metal; with programme=cyclic: lowest over highest force, default 0.1",
    )
    programme: str = setting(choice("pull", "cyclic"), "pull", "of the load")
    seconds: float = setting(number(0.1), 20.0, "of the test", "s")
    hold: float | None = setting(number(0), None, "at first; where not given 0.1 of seconds, at most 2", "s")
    end: float | None = setting(number(0), None, "at the end; where not given 0.05 of seconds, at most 1", "s")
    max_strain: float = setting(number(0, 0.5), 8e-3, "largest strain")
    section_mm2: float = setting(number(1e-3), 40.0, "section", "mm2")
    px_per_mm: float = setting(number(1e-3), 20.0, "scale", "px/mm")
    axis: str = setting(choice("y", "x"), "y", "of the load")
    hole: float = setting(number(4), 60.0, "radius of the hole", "px")
    cell: float = setting(number(8), 96.0, "side of a cell of woven", "px")
    overstrain: float = setting(number(0, 0.95), 0.6, "of woven: variation of the strain over its mean")
    neck: float = setting(number(4, 8192), 0.0, "width of the neck of a sheet metal; 0: none", "px")
    drift_x: float = setting(number(), 0.0, "of the specimen", "px")
    drift_y: float = setting(number(), 0.0, "of the specimen", "px")
    rotation_deg: float = setting(number(-45, 45), 0.0, "of the specimen", "deg")
    lockstep: bool = setting(FLAG, False, "frames wait for their reader, on nominal time")
    waits: bool = setting(FLAG, False, "the pull begins when it is told to")
    machine: int | None = setting(whole(0, 65535), None, "port over which another program drives the machine")


@dataclass(frozen=True)
class CycleSettings:
    """The cycles of ``programme=cyclic``."""

    hz: float = setting(number(1e-4, 1000), 1.0, "cycles a second, of programme=cyclic", "1/s")
    fall: float = setting(number(0, 0.9), 0.0, "share of the stiffness that is lost at last, of programme=cyclic")


@dataclass(frozen=True)
class CyclicSettings(SpecimenSettings, CycleSettings):
    """Of a specimen under ``programme=cyclic``: some settings mean another thing there."""

    n: float = setting(whole(1), 10, "cycles")
    r: float = setting(number(-10, 0.99), 0.1, "lowest over highest force")
    seconds: float = setting(number(0.1), 0.1, "of the test, at least", "s")
    hold: float = setting(number(0.1), 2.0, "without load at first", "s")
    end: float | None = setting(number(0), None, "after the cycles; where not given that of a cycle", "s")
    max_strain: float = setting(number(0, 0.5), 1e-3, "largest strain")


@dataclass(frozen=True)
class ViewSettings:
    """Of ``sim:``: how the camera looks at the specimen."""

    stand_off_mm: float | None = setting(number(1), None, "from pupil to specimen; where not given telecentric", "mm")
    distortion: float = setting(number(-10, 10), 0.0, "radial, at the corner", "%")
    tilt_x_deg: float = setting(number(-30, 30), 0.0, "of the specimen about x", "deg")
    tilt_y_deg: float = setting(number(-30, 30), 0.0, "of the specimen about y", "deg")
    settle_mm: float = setting(number(), 0.0, "motion towards the camera at the largest load", "mm")
    settle_x_deg: float = setting(number(-30, 30), 0.0, "turn about x at the largest load", "deg")
    settle_y_deg: float = setting(number(-30, 30), 0.0, "turn about y at the largest load", "deg")
    plates: str = setting(TEXT, "", "x,y,width,height of each plate, with a semicolon between two", "px")
    plate_strain: float = setting(number(-1, 2), 0.0, "strain of the plates over that of the specimen")
    readout_ms: float = setting(number(0, 1000), 0.0, "of a rolling shutter", "ms")
    flicker: float = setting(number(0, 50), 0.0, "amplitude of the light over its mean", "%")
    lamp_hz: float = setting(number(1, 1e5), 100.0, "of the flicker", "Hz")
    side: str = setting(choice("front", "back"), "front", "of the specimen that is seen")
    bending: float = setting(number(-100, 100), 0.0, "strain of the front over the mean of both sides, less 1", "%")


@dataclass(frozen=True)
class SensorSettings:
    """Of ``sim:``: the sensor."""

    bits: str = setting(choice(*map(str, BITS)), "12", "of a sample")
    noise: float = setting(number(0, 20), 0.5, "of full scale, at mid-grey", "%")
    fpn: float = setting(number(0, 20), 0.0, "fixed pattern, of full scale", "%")
    brightness: float = setting(number(0.01, 10), 1.0, "of the light")


@dataclass(frozen=True)
class PictureSettings:
    """Of ``sim:``: the camera."""

    fps: float = setting(_fps, 60.0, "frames a second; auto: what this machine renders with ease", "1/s")
    exposure_us: float | None = setting(
        number(0), None, "exposure; where not given 2000, at most half of the time of a frame", "us"
    )
    radius: float = setting(number(0.7, 64), 2.0, "of the speckles", "px")
    contrast: float = setting(number(1, 20), 18.0, "standard deviation of the pattern, of full scale", "%")
    seed: int = setting(whole(0), 0, "of pattern and noise")
    buffers: int = setting(whole(1, 1000), 4, "of the ring")
    offset: float = setting(number(0), 0.0, "time of the first frame, in lock step", "s")
    faults: str = setting(TEXT, "", "faults and their times, such as drop@5,stall@8*1.5")

@dataclass(frozen=True)
class SimSettings(PictureSettings, SensorSettings, ViewSettings, CycleSettings, SpecimenSettings):
    """All settings of ``sim:KIND``."""
# fmt: on


SPECIMEN_KEYS = frozenset(one.key for one in settings_of(CyclicSettings))
