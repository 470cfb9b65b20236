"""What is asked of a replay, and what it works on."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from acquire.clock import ClockPair
from acquire.errors import ConfigError
from acquire.events import Event
from acquire.frame import Burst, CameraInfo
from acquire.load_cell import LoadLog
from acquire.load_sample import LoadSample
from live.measure import NewReference


@dataclass(frozen=True, slots=True)
class ReplayRequest:
    """What is asked for.

    Attributes
    ----------
    source : str
        Path of a session, or an address of pictures (``files:shots/*.tif``, ``video:...``).
    as_measured : bool
    start_s, end_s : float or None, s
        Part of the session, in seconds since its start.
    reference : str or None
        An image file as the reference, where the source is a folder of pictures.
    config_file : Path or None
    overrides : mapping of "section.key" to value
    """

    source: str
    as_measured: bool
    start_s: float | None
    end_s: float | None
    reference: str | None
    config_file: Path | None
    overrides: Mapping[str, Any]


@dataclass(frozen=True, slots=True, eq=False)
class Material:
    """A source taken apart: what the reference is, and the bursts to measure."""

    camera: CameraInfo
    reference: Burst
    bursts: Iterable[Burst | NewReference]
    loads: LoadLog
    start: ClockPair
    events: tuple[Event, ...] = ()
    samples: tuple[LoadSample, ...] = ()


def window_of(request: ReplayRequest, origin: float) -> tuple[float, float]:
    low = -math.inf if request.start_s is None else origin + request.start_s
    high = math.inf if request.end_s is None else origin + request.end_s
    if low >= high:
        raise ConfigError("--from must be before --to")
    return low, high


def within(bursts: Iterable[Burst], window: tuple[float, float]) -> Iterator[Burst]:
    return (burst for burst in bursts if window[0] <= burst.t <= window[1])
