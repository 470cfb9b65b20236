"""The state of a run: events, frame counts, loads, history, active alarms and the health of the machine."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field, fields

from acquire.events import Event, EventKind
from acquire.load_cell import LoadLog
from acquire.text import Message, counts
from live.config.sections import SpecimenConfig
from live.pipeline.event_log import EventLog, sentence
from live.pipeline.history import History
from live.pipeline.measurement import TimeStep, strains_along
from live.pipeline.snapshot import FORCE, STRESS, Snapshot
from live.pipeline.timed.course import CycleWatch, ResponseWatch
from live.pipeline.timed.figure import FigureState, TimedFigure
from live.pipeline.timed.health import Health, force_at, strains_at


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
    without_force : int
        Measured bursts whose force is not known although there is a load cell.
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
    without_force: int = 0
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
        n = dict(zip(self.as_dict(), counts(*self.as_dict().values()), strict=True))
        load = Message(" / load samples lost {load_lost}", **n) * (self.load_lost > 0)
        load += Message(" / bursts without a force {without_force}", **n) * (self.without_force > 0)
        parts = {
            "share": f" ({self.skipped_share:.1%})" * (self.skipped > 0),
            "failed": Message(" / failed {failed}", **n) * (self.failed > 0),
            "load": load,
            "on_purpose": Message(" and {thinned} on purpose", **n) * (self.thinned > 0),
            "value": Message("every frame is accounted for")
            if self.adds_up
            else Message("NOT EVERY FRAME IS ACCOUNTED FOR"),
        }
        return Message(
            "grabbed {grabbed} / recorded {recorded} / measured {measured} / skipped {skipped}{share}{failed} / "
            "lost {lost}{load}  (reference {reference}, left over {left_out}, not recorded "
            "{unrecorded}{on_purpose}; {value})",
            **n | parts,
        )


class ActiveAlarms:
    """The alarms that are on, with their texts, until they end or are silenced; for any thread."""

    def __init__(self) -> None:
        self._on: dict[str, str] = {}
        self._lock = threading.Lock()

    def set(self, name: str, text: str) -> None:
        """An alarm comes on, or has a new text."""
        with self._lock:
            self._on[name] = text

    def renew(self, name: str, text: str) -> None:
        """A new text of an alarm, unless it was silenced."""
        with self._lock:
            if name in self._on:
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
    faults : ActiveAlarms
        Errors that are not over, by their source.
    health : Health
    specimen : SpecimenConfig
    with_load : bool
        There is a load cell, or recorded forces.
    cycles : CycleWatch
    response : ResponseWatch
    """

    event_log: EventLog
    frame_counts: FrameCounts
    loads: LoadLog
    history: History
    alarms: ActiveAlarms = field(default_factory=ActiveAlarms)
    faults: ActiveAlarms = field(default_factory=ActiveAlarms)
    health: Health = field(default_factory=Health)
    specimen: SpecimenConfig = field(default_factory=SpecimenConfig)
    with_load: bool = True
    cycles: CycleWatch = field(default_factory=CycleWatch)
    response: ResponseWatch = field(default_factory=ResponseWatch)

    @classmethod
    def new(
        cls,
        max_gap_s: float,
        lag_s: float = 0.0,
        specimen: SpecimenConfig | None = None,
        *,
        with_load: bool = True,
    ) -> RunState:
        """Empty ones; ``max_gap_s`` and ``lag_s`` (s) as for ``LoadLog``."""
        specimen = specimen or SpecimenConfig()
        loads, history = LoadLog(max_gap_s, lag_s), History(specimen.axis)
        found = cls(EventLog(), FrameCounts(), loads, history, specimen=specimen, with_load=with_load)
        found.event_log.add_listener(found.note)
        return found

    def add(self, step: TimeStep) -> None:
        """Keep what was measured."""
        self.history.add(step)
        axis, loaded = self.history.current_axis, self.with_load
        self.cycles.add(step, axis, self.loads, self.specimen.area_m2, loaded=loaded)

    def note(self, event: Event) -> None:
        """Keep an error until its source reports that it is over."""
        if event.level == "error":
            self.faults.set(event.source, sentence(event, self.event_log.names))
        elif event.level == "info" or event.kind is EventKind.RECORDER:
            self.faults.clear(event.source)
            if event.kind is EventKind.REFERENCE:
                self.faults.clear("reference")

    def snapshot(self, t: float, time_step: TimeStep | None = None) -> Snapshot:
        """The state of the test at ``t`` (s, monotonic), with ``time_step`` or else the last that was measured.

        The force is the newest of the load cell. In a replay, and of recorded pictures, now is the instant of the
        newest time step, and so is the force.
        """
        health, axis = self.health, self.history.current_axis
        step, ended = time_step, health.ended and time_step is None
        if step is None and self.history.time_steps:
            step = self.history.time_steps[-1]
        now = t if health.live or step is None else step.t
        figures = (
            health.machine(now) | {FORCE: self.force(now, step)} | strains_at(now, health, self.history, step)
        )
        if ended:
            there = (
                (name, figure) for name, figure in figures.items() if figure.state is not FigureState.NONE
            )
            figures = {name: figure.but(FigureState.ENDED) for name, figure in there}
        if self.specimen.area_m2 and FORCE in figures:
            figures[STRESS] = figures[FORCE].scaled(1 / self.specimen.area_m2)
        return Snapshot(
            t=now,
            state=Message("ENDED") if ended else health.state or Message("REPLAY"),
            paused=health.paused and not ended,
            elapsed_s=t - health.began_t,
            figures=figures,
            peak_N=health.peak_N,
            axial_name=strains_along(step.gauges if step else (), axis)[0],
            axis=axis,
            axis_assumed=self.history.axis_assumed,
            valid=step.n_valid if step else 0,
            zois=step.n_zoi if step else 0,
            area_share=step.least_share if step else 1.0,
            latency_p95_s=health.latency_p95_s,
            alarms=self.alarms.texts,
            faults=self.faults.texts,
            frames=self.frame_counts.as_dict(),
            time_step=step,
            cycles=self.cycles.channels,
            at_cycle=self.cycles.at,
        )

    def force(self, now: float, step: TimeStep | None = None) -> TimedFigure:
        """The force at ``now`` (s, monotonic): the newest of the load cell, of recorded pictures that of ``step``."""
        return force_at(now, self.health, self.loads, step) if self.with_load else TimedFigure()
