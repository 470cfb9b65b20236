"""What a load cell gives: samples in newtons, with what the line adds to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Flag, auto
from typing import Any

from acquire.frame import ClockKind


class LoadFlag(Flag):
    """What a line adds to its value; overload and underload go with a force of NaN."""

    NONE = 0
    OVERLOAD = auto()
    UNDERLOAD = auto()
    UNSTABLE = auto()
    ERROR = auto()
    STALE = auto()
    NET = auto()
    PEAK = auto()
    OUT_OF_RANGE = auto()  # beyond the capacity given in the address
    STEP = auto()  # an implausible jump from one sample to the next


@dataclass(frozen=True, slots=True)
class LoadSample:
    """One reading.

    Attributes
    ----------
    t : float, s
        When the read returned, less the transmission time of what came with it.
    force : float, N
        Tension positive; NaN where the line gives no valid value.
    unit : str
        As it stood on the line, or as the user gives it.
    stable : bool or None
        None where the protocol has no such mark.
    flags : LoadFlag
    raw : bytes
        The line as it came, without its end.
    device_ms : float or None, ms
        The device's own time, where it sends one.
    """

    t: float
    force: float
    unit: str = "N"
    stable: bool | None = None
    flags: LoadFlag = LoadFlag.NONE
    raw: bytes = b""
    device_ms: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LoadCellInfo:
    """What is known of a load cell once it is open.

    Attributes
    ----------
    address, name, protocol : str
    clock : "device" | "host" | "nominal"
    sign : int
        What the line's value is multiplied with so that tension is positive.
    capacity_N : float or None, N
    settings : mapping of str to JSON value
    warnings : tuple of str
    """

    address: str
    name: str
    protocol: str
    clock: ClockKind = "host"
    sign: int = 1
    capacity_N: float | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
