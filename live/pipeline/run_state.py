"""What is kept of a test while it runs.

The alarms that are on, and the vital signs of the machine: for whoever shows or asks.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass, field

from acquire.load_cell import LoadLog
from live.config.sections import SpecimenConfig
from live.pipeline.event_log import EventLog
from live.pipeline.frame_counts import FrameCounts
from live.pipeline.history import History
from live.pipeline.measurement import TimeStep, strains_along
from live.pipeline.snapshot import Snapshot, peak_force


@dataclass(slots=True)
class Health:
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
        Of the last seconds (``live.pipeline``).
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
        """The channels of the machine (``live.pipeline``) at ``now``, monotonic s."""
        return {
            "silent_s": now - self.frame_t,
            "load_silent_s": now - self.load_t,
            "disk_min": self.disk_s / 60,
        }


class ActiveAlarms:
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


@dataclass(frozen=True, slots=True, eq=False)
class RunState:
    """Events, counts of frames, loads and means, each filled by whoever knows.

    Attributes
    ----------
    journal : EventLog
    ledger : FrameCounts
    loads : LoadLog
    history : History
    alarms : ActiveAlarms
    vitals : Health
    specimen : SpecimenConfig
    """

    journal: EventLog
    ledger: FrameCounts
    loads: LoadLog
    history: History
    alarms: ActiveAlarms = field(default_factory=ActiveAlarms)
    vitals: Health = field(default_factory=Health)
    specimen: SpecimenConfig = field(default_factory=SpecimenConfig)

    @classmethod
    def new(cls, max_gap_s: float, lag_s: float = 0.0, specimen: SpecimenConfig | None = None) -> RunState:
        """Empty ones; ``max_gap_s`` and ``lag_s`` (s) as for ``LoadLog``."""
        specimen = specimen or SpecimenConfig()
        loads, history = LoadLog(max_gap_s, lag_s), History(specimen.axis)
        return cls(EventLog(), FrameCounts(), loads, history, specimen=specimen)

    def snapshot(self, t: float, instant: TimeStep | None = None) -> Snapshot:
        """Where the test stands at ``t`` (s, monotonic), with ``instant`` or else the last that was measured.

        The force is the newest of the load cell; in a replay, and before the first sample, that of the instant.
        """
        if instant is None and self.history.instants:
            instant = self.history.instants[-1]
        vitals, area, axis = self.vitals, self.specimen.area_m2, self.history.axis_by_now
        sample = self.loads.latest if vitals.state else None
        force = math.nan if instant is None else instant.force
        if sample is not None:
            force = sample.force
        axial, sigma = instant.axial(axis) if instant else (math.nan, math.nan)
        return Snapshot(
            t=t,
            state=vitals.state or "REPLAY",
            elapsed_s=t - vitals.began_t,
            fps=vitals.fps,
            force_N=force,
            stress_Pa=force / area if area else math.nan,
            peak_N=vitals.peak_N,
            axial_name=strains_along(instant.gauges if instant else (), axis)[0],
            axial=axial,
            sigma_axial=sigma,
            valid=instant.n_valid if instant else 0,
            zois=instant.n_zoi if instant else 0,
            latency_p95_s=vitals.latency_p95_s,
            disk_s=vitals.disk_s,
            alarms=self.alarms.texts,
            frames=self.ledger.as_dict(),
            instant=instant,
        )
