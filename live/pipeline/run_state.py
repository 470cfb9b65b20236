"""The state of a run: events, frame counts, loads, history, active alarms and the health of the machine."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass, field, fields

from acquire.load_cell import LoadLog
from live.config.sections import SpecimenConfig
from live.pipeline.event_log import EventLog
from live.pipeline.history import History
from live.pipeline.measurement import TimeStep, strains_along
from live.pipeline.snapshot import Snapshot, peak_force


@dataclass(slots=True)
class FrameCounts:
    """Counts of frames; ``add`` may be called from any thread.

    Attributes
    ----------
    grabbed : int
        Frames the camera handed out.
    recorded, unrecorded, thinned : int
        Written to the session; not written although they should be (a counted gap); left out on purpose: by
        the recording mode (only bursts, every K-th), or while recording was off.
    reference, measured, skipped, left_out : int
        Part of the reference burst; of a measured burst; of a burst that a newer one replaced or that
        came while measuring was paused; of no complete burst, or damaged.
    lost : int
        Frames that the camera or its connection lost, or that came damaged.
    load_samples, load_lost : int
        Samples of the load cell; samples that were missing when the test ended.
    failed : int
        Frames of bursts that could not be measured (``live.results.folder``).
    """

    grabbed: int = 0
    recorded: int = 0
    unrecorded: int = 0
    thinned: int = 0
    reference: int = 0
    measured: int = 0
    skipped: int = 0
    left_out: int = 0
    lost: int = 0
    load_samples: int = 0
    load_lost: int = 0
    failed: int = 0
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False, compare=False)

    def add(self, **counts: int) -> None:
        """Add to the named counts."""
        with self._lock:
            for name, count in counts.items():
                setattr(self, name, getattr(self, name) + count)

    def as_dict(self) -> dict[str, int]:
        """The counts by name."""
        return {f.name: getattr(self, f.name) for f in fields(self) if not f.name.startswith("_")}

    @property
    def adds_up(self) -> bool:
        """Whether every grabbed frame is counted once for measuring, and once for recording where that was on."""
        used = self.reference + self.measured + self.skipped + self.left_out + self.failed
        stored = self.recorded + self.unrecorded + self.thinned
        return used == self.grabbed and stored in (0, self.grabbed)

    @property
    def loss(self) -> bool:
        """Whether frames, or load samples at the end, are missing for good."""
        return max(self.lost, self.unrecorded, self.load_lost, self.failed) > 0

    @property
    def skipped_share(self) -> float:
        """Share of the frames after the reference that were not measured because measuring was late or paused."""
        return self.skipped / max(self.measured + self.skipped, 1)

    def line(self) -> str:
        """One line for a person."""
        on_purpose = f" and {self.thinned} on purpose" * (self.thinned > 0)
        share = f" ({self.skipped_share:.1%})" * (self.skipped > 0)
        load = f" / load samples lost {self.load_lost}" * (self.load_lost > 0)
        failed = f" / failed {self.failed}" * (self.failed > 0)
        return (
            f"grabbed {self.grabbed} / recorded {self.recorded} / measured {self.measured}"
            f" / skipped {self.skipped}{share}{failed} / lost {self.lost}{load}"
            f"  (reference {self.reference}, left over {self.left_out}, not recorded {self.unrecorded}"
            f"{on_purpose}; {'adds up' if self.adds_up else 'DOES NOT ADD UP'})"
        )


@dataclass(slots=True)
class Health:
    """Health values, each written in one assignment by the thread that measures it.

    Attributes
    ----------
    began_t, frame_t, load_t : float, s
        Times of the begin of the test, of the last frame and of the last load sample, monotonic; NaN before.
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
        Port of the view; None while there is none.
    camera_failed : bool
        The camera has ended with an error.
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
    camera_failed: bool = False

    def loaded(self, t: float, force_N: float) -> None:
        """Note a load sample that arrived at ``t`` (s, monotonic)."""
        self.load_t = t
        self.peak_N = peak_force(self.peak_N, force_N)

    def channels(self, now: float) -> dict[str, float]:
        """The channels of the machine (``live.config.channels``) at ``now``, monotonic s.

        Before the first frame or sample, the silence is that since the test began.
        """
        frame_t, load_t = (self.began_t if math.isnan(t) else t for t in (self.frame_t, self.load_t))
        return {
            "silent_s": now - frame_t,
            "load_silent_s": now - load_t,
            "disk_min": self.disk_s / 60,
        }


class ActiveAlarms:
    """The alarms that are on, with their texts, until they end or are silenced; for any thread."""

    def __init__(self) -> None:
        self._on: dict[str, str] = {}
        self._lock = threading.Lock()

    def set(self, name: str, text: str) -> None:
        """An alarm comes on, or has a new text."""
        with self._lock:
            self._on[name] = text

    def clear(self, name: str) -> None:
        """An alarm goes off."""
        with self._lock:
            self._on.pop(name, None)

    def silence(self) -> tuple[str, ...]:
        """Remove all; their names. Each comes on again only when its value was within the limit in between."""
        with self._lock:
            names, self._on = tuple(self._on), {}
            return names

    @property
    def texts(self) -> tuple[str, ...]:
        """The texts of the alarms that are on, the oldest first."""
        with self._lock:
            return tuple(self._on.values())


@dataclass(frozen=True, slots=True, eq=False)
class RunState:
    """Events, frame counts, loads and means of a run, filled by its threads.

    Attributes
    ----------
    event_log : EventLog
    frame_counts : FrameCounts
    loads : LoadLog
    history : History
    alarms : ActiveAlarms
    health : Health
    specimen : SpecimenConfig
    """

    event_log: EventLog
    frame_counts: FrameCounts
    loads: LoadLog
    history: History
    alarms: ActiveAlarms = field(default_factory=ActiveAlarms)
    health: Health = field(default_factory=Health)
    specimen: SpecimenConfig = field(default_factory=SpecimenConfig)

    @classmethod
    def new(cls, max_gap_s: float, lag_s: float = 0.0, specimen: SpecimenConfig | None = None) -> RunState:
        """Empty ones; ``max_gap_s`` and ``lag_s`` (s) as for ``LoadLog``."""
        specimen = specimen or SpecimenConfig()
        loads, history = LoadLog(max_gap_s, lag_s), History(specimen.axis)
        return cls(EventLog(), FrameCounts(), loads, history, specimen=specimen)

    def snapshot(self, t: float, time_step: TimeStep | None = None) -> Snapshot:
        """The state of the test at ``t`` (s, monotonic), with ``time_step`` or else the last that was measured.

        The force is the newest of the load cell; in a replay, and before the first sample, that of the time step.
        """
        if time_step is None and self.history.time_steps:
            time_step = self.history.time_steps[-1]
        health, area, axis = self.health, self.specimen.area_m2, self.history.current_axis
        sample = self.loads.latest if health.state else None
        force = math.nan if time_step is None else time_step.force
        if sample is not None:
            force = sample.force
        axial, sigma = time_step.axial(axis) if time_step else (math.nan, math.nan)
        return Snapshot(
            t=t,
            state=health.state or "REPLAY",
            elapsed_s=t - health.began_t,
            fps=health.fps,
            force_N=force,
            stress_Pa=force / area if area else math.nan,
            peak_N=health.peak_N,
            axial_name=strains_along(time_step.gauges if time_step else (), axis)[0],
            axis=axis,
            axis_assumed=self.history.axis_assumed,
            axial=axial,
            sigma_axial=sigma,
            valid=time_step.n_valid if time_step else 0,
            zois=time_step.n_zoi if time_step else 0,
            area_share=time_step.least_share if time_step else 1.0,
            latency_p95_s=health.latency_p95_s,
            disk_s=health.disk_s,
            alarms=self.alarms.texts,
            frames=self.frame_counts.as_dict(),
            time_step=time_step,
        )
