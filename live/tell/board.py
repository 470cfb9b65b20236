"""The alarms that are on, and the vital signs of the machine: for whoever shows or asks."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass

from live.measure import peak_force


@dataclass(slots=True)
class Vitals:
    """Written by whoever knows, in one assignment.

    Attributes
    ----------
    began_t, frame_t, load_t : float, s
        When the test began, and the last frame and the last load sample came, monotonic; NaN before.
    fps : float, 1/s
        As frames come.
    disk_s : float, s
        Until the disk is full; infinite where nothing is written.
    peak_N : float, N
        The force of largest magnitude so far, with its sign; NaN before the first.
    latency_p95_s : float, s
        Of the last seconds (``live.pace``).
    state : str
        What a live run does with its frames; empty in a replay.
    view_port : int or None
        Where viewers connect; None while they cannot.
    """

    began_t: float = math.nan
    frame_t: float = math.nan
    fps: float = 0.0
    load_t: float = math.nan
    disk_s: float = math.inf
    peak_N: float = math.nan
    latency_p95_s: float = math.nan
    state: str = ""
    view_port: int | None = None

    def loaded(self, t: float, force_N: float) -> None:
        """A load sample came at ``t`` (s, monotonic)."""
        self.load_t = t
        self.peak_N = peak_force(self.peak_N, force_N)

    def channels(self, now: float) -> dict[str, float]:
        """The channels of the machine (``live.channels``) at ``now``, monotonic s."""
        return {
            "silent_s": now - self.frame_t,
            "load_silent_s": now - self.load_t,
            "disk_min": self.disk_s / 60,
        }


class AlarmBoard:
    """The alarms that are on, with their words, until they go or are silenced; for any thread."""

    def __init__(self) -> None:
        self._on: dict[str, str] = {}
        self._lock = threading.Lock()

    def put(self, name: str, text: str) -> None:
        """An alarm comes, or has new words."""
        with self._lock:
            self._on[name] = text

    def take_off(self, name: str) -> None:
        """An alarm goes."""
        with self._lock:
            self._on.pop(name, None)

    def silence(self) -> tuple[str, ...]:
        """Take all off; their names. Each comes again only when it has gone in between."""
        with self._lock:
            names, self._on = tuple(self._on), {}
            return names

    @property
    def texts(self) -> tuple[str, ...]:
        """The words of the alarms that are on, the oldest first."""
        with self._lock:
            return tuple(self._on.values())
