"""The health of a test, and its figures at one moment, each with its age."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from acquire.load_cell import LoadLog
from acquire.load_sample import LoadFlag
from acquire.text import Message
from live.pipeline.history import History
from live.pipeline.measurement import TimeStep
from live.pipeline.snapshot import AXIAL, BURST, DISK, FPS, peak_force
from live.pipeline.timed.figure import LACKING, Arrivals, FigureState, TimedFigure

DISK_EVERY_S = 5.0
"""The room on the disk is found again at this interval."""
_STATE_OF_FLAG = {LoadFlag.OVERLOAD: FigureState.OVERLOAD, LoadFlag.UNDERLOAD: FigureState.UNDERLOAD}


@dataclass(slots=True)
class Health:
    """Health values, each written in one assignment by the thread that measures it.

    Attributes
    ----------
    began_t, frame_t, load_t : float, s
        Times of the begin of the test, of the last frame and of the last load sample that tells a force, monotonic;
        NaN before.
    since_t : float, s
        End of the last pause or reference: a burst of before it is not the newest that can be had.
    frames, readings, rooms : Arrivals
        Of frames, of readings of the load cell, of what is known of the disk.
    fps : float, 1/s
        As frames come.
    disk_s, disk_t : float, s
        Until the disk is full, infinite where nothing is written; when that was found.
    without_force_s : float, s
        Time of the test whose bursts have no force.
    peak_N : float, N
        The force of largest magnitude so far, with its sign; NaN before the first.
    load_range_N : float, N
        Of the load cell; NaN where it is not known.
    latency_p95_s : float, s
        Of the last seconds (``live.pipeline``).
    state : str
        What a live run does with its frames; empty in a replay.
    view_port : int or None
        Port of the view; None while there is none.
    recorded : bool
        The pictures of a live run are recorded ones, and come when they are asked for.
    paused : bool
        Measuring is paused by the operator.
    camera_failed, camera_ended, ended : bool
        The camera has ended with an error; it gives no more frames; the test has ended.
    """

    began_t: float = math.nan
    frame_t: float = math.nan
    since_t: float = -math.inf
    frames: Arrivals = field(default_factory=Arrivals)
    readings: Arrivals = field(default_factory=Arrivals)
    rooms: Arrivals = field(default_factory=lambda: Arrivals(DISK_EVERY_S))
    fps: float = 0.0
    load_t: float = math.nan
    disk_s: float = math.inf
    disk_t: float = math.nan
    without_force_s: float = 0.0
    peak_N: float = math.nan
    load_range_N: float = math.nan
    latency_p95_s: float = math.nan
    state: str = ""
    view_port: int | None = None
    recorded: bool = False
    paused: bool = False
    camera_failed: bool = False
    camera_ended: bool = False
    ended: bool = False

    @property
    def live(self) -> bool:
        """Whether the figures have an age: those of a replay and of recorded pictures are of their own instant."""
        return bool(self.state) and not self.recorded

    def loaded(self, t: float, force_N: float, *, tells: bool = True) -> None:
        """Note a load sample that arrived at ``t`` (s, monotonic), which ``tells`` the force of now or does not."""
        if tells:
            self.load_t = t
            self.readings.add(t)
        self.peak_N = peak_force(self.peak_N, force_N)

    def framed(self, t: float, fps: float) -> None:
        """Note a frame that arrived at ``t`` (s, monotonic), and the rate."""
        self.frame_t, self.fps = t, fps
        self.frames.add(t)

    def room(self, t: float, disk_s: float) -> None:
        """Note the time until the disk is full, as found at ``t`` (s, monotonic)."""
        self.disk_t, self.disk_s = t, disk_s
        self.rooms.add(t)

    def channels(self, now: float) -> dict[str, float]:
        """The channels of the machine (``live.config.figures``) at ``now``, monotonic s.

        Before the first frame or sample, the silence is that since the test began.
        """
        frame_t, load_t = (self.began_t if math.isnan(t) else t for t in (self.frame_t, self.load_t))
        return {
            "silent_s": math.nan if self.camera_ended and not self.camera_failed else now - frame_t,
            "load_silent_s": now - load_t,
            "disk_min": self.disk_s / 60,
        }

    def machine(self, now: float) -> dict[str, TimedFigure]:
        """Frames per second, and the time until the disk is full."""
        t, disk_t = (self.frame_t, self.disk_t) if self.live else (now, now)
        fps = TimedFigure.at(now, t, self.fps, lasts_s=self.frames.lasts_s)
        if self.camera_failed:
            fps = fps.but(FigureState.UNKNOWN, Message("the camera has failed"))
        elif self.camera_ended:
            fps = fps.but(FigureState.ENDED)
        elif math.isnan(self.frame_t):
            fps = fps.but(FigureState.NOT_YET)
        if math.isinf(self.disk_s):
            return {FPS: fps}
        return {FPS: fps, DISK: TimedFigure.at(now, disk_t, self.disk_s, lasts_s=self.rooms.lasts_s)}


def force_at(now: float, health: Health, loads: LoadLog, step: TimeStep | None) -> TimedFigure:
    """The force at ``now`` (s, monotonic): the newest of the load cell, of recorded pictures that of ``step``."""
    if not health.live:
        return _force_of(step, loads)
    newest, latest, lasts_s = loads.telling, loads.latest, health.readings.lasts_s
    began = TimedFigure.at(now, health.began_t, math.nan, lasts_s=lasts_s, why=Message("nothing came yet"))
    if newest is None and began.state is not FigureState.OLD:
        return TimedFigure(state=FigureState.NOT_YET)
    found = began if newest is None else TimedFigure.at(now, newest.t, newest.force, lasts_s=lasts_s)
    beyond = (
        [] if newest is None else [state for flag, state in _STATE_OF_FLAG.items() if flag in newest.flags]
    )
    if found.state is not FigureState.OLD:
        return found.but(beyond[0]) if beyond else found
    if latest is None or now - latest.t > lasts_s:
        return found
    stale = LoadFlag.STALE in latest.flags
    why = (
        Message("the time of its readings is not known")
        if stale
        else Message("the lines of the load cell are no readings")
    )
    return found.but(FigureState.UNKNOWN, Message("{why}, for {age:.0f} s", why, found.age))


def _force_of(step: TimeStep | None, loads: LoadLog) -> TimedFigure:
    """The force at a time step of recorded pictures."""
    if step is None or (math.isnan(step.force) and not loads.covers(step.t)):
        return TimedFigure(state=FigureState.NOT_YET)
    return TimedFigure.at(step.t, step.t, step.force, why=Message("none is recorded at this time"))


def strains_at(now: float, health: Health, history: History, step: TimeStep | None) -> dict[str, TimedFigure]:
    """Strains of region and gauges; of a live test with their age."""
    lasts_s = history.arrivals.lasts_s
    if step is None:
        no_frames = health.machine(now)[FPS]
        lacks = no_frames.state in LACKING
        why = no_frames.why or Message("no frame for {age:.0f} s", no_frames.age)
        none = (
            TimedFigure(state=FigureState.UNKNOWN, why=why)
            if lacks
            else TimedFigure(state=FigureState.NOT_YET)
        )
        return dict.fromkeys((AXIAL, BURST), none)
    figures = {
        name: TimedFigure.at(now, step.t, value, sigma, lasts_s, why)
        for name, (value, sigma, why) in step.strains(history.current_axis).items()
    }
    if not health.live:
        return figures
    if health.paused:
        return {name: figure.but(FigureState.PAUSED) for name, figure in figures.items()}
    if step.t < health.since_t and now - health.since_t <= lasts_s:
        return {name: figure.but(FigureState.NOT_YET) for name, figure in figures.items()}
    return figures
