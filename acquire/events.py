"""What happens during a test, as data: device faults, losses, commands, measurements.

An event is shown on the screen, logged, drawn in the view and stored in the session;
a replay takes the commands and the list of measured bursts from there.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Literal

from acquire.text.message import word

Level = Literal["info", "warning", "error"]

SOURCES = (
    "alarm", "burst", "force", "gauges", "measurement", "operator", "pattern", "phasedic", "picture", "plates",
    "recorder", "reference", "region", "sharpness", "strain", "view",
)  # fmt: skip
"""Parts of the program that events come from; other sources are addresses and names."""


class EventKind(StrEnum):
    """The kinds of events; the values are what stands in files."""

    START = "start"  # the test begins; data: configuration summary
    STOP = "stop"  # the test ends; data: reason
    REFERENCE = "reference"  # data: first, last, n (frame indices), force_N, shift_px
    MEASURED = "measured"  # data: first, last, n (frame indices of the burst)
    NEW_REFERENCE = "new-reference"  # command
    TARE = "tare"  # command; data: offset_N
    PAUSE = "pause"  # command
    RESUME = "resume"  # command
    RECORD = "record"  # command: recording begins or ends; data: on
    ALARM = "alarm"  # an alarm comes, goes or is silenced; data: alarm, on
    NOTE = "note"  # the operator's own words
    LOST = "lost"  # data: count, where
    DEVICE = "device"  # a fault or recovery of a camera or load cell
    RECORDER = "recorder"  # disk space, write errors, counted gaps
    MEASUREMENT = "measurement"  # a trouble or remark of the measuring path
    VIEW = "view"  # a trouble of the view or another output


@dataclass(frozen=True, slots=True)
class Event:
    """One thing that happened.

    Attributes
    ----------
    t : float, s
        ``time.monotonic()``.
    kind : EventKind
    source : str
        Where it comes from: an address, "recorder", "operator", ...
    text : str
        One sentence for a person.
    level : "info" | "warning" | "error"
    data : mapping of str to JSON value
    """

    t: float
    kind: EventKind
    source: str
    text: str
    level: Level = "info"
    data: Mapping[str, Any] = field(default_factory=dict)


def named(source: str) -> str:
    """A source of events as it is shown: a part of the program by its word, which is translated."""
    return word(source) if source in SOURCES else source


EventSink = Callable[[Event], None]


def ignore_event(event: Event) -> None:
    """A sink that drops every event."""


def device_event(sink: EventSink, source: str, text: str, level: Level = "warning", **data: Any) -> None:
    """Send an event of a device to ``sink``, stamped now."""
    sink(Event(time.monotonic(), EventKind.DEVICE, source, text, level, data))


class RateLimiter:
    """Reports a fault that may come with every frame at once, then as a count per interval.

    Parameters
    ----------
    interval_s : float, s
    """

    def __init__(self, interval_s: float = 2.0) -> None:
        self._interval_s = interval_s
        self._last_t = float("-inf")
        self._count = 0

    def due(self, t: float) -> int:
        """How many to report at ``t``, this one included; 0: none yet."""
        self._count += 1
        if t - self._last_t < self._interval_s:
            return 0
        count, self._count, self._last_t = self._count, 0, t
        return count
