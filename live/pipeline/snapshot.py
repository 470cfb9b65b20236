"""The state of a test at one time: what status line, status card, view and page show.

The values of the output channels, at a measurement or at any moment with the newest force, come from it too.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from acquire.clock import Clock
from acquire.text import Amount, Message, word
from live.config.figures import CYCLE_CHANNELS, FIGURES, LIVE, OF_SNAPSHOT, LiveFigure, attributes, figure_of
from live.pipeline.measurement import Measurement, TimeStep
from live.pipeline.timed.figure import FigureState, TimedFigure

_CHANNELS_OF_STEP, _OF_BURST = attributes("step", channel=True), attributes("burst", channel=True)
RATE_S = 1.0
"""The strain rate is the slope of the axial strain over this time."""


class StateOfTest(Protocol):
    """What gives the figures of a test at a time."""

    def snapshot(self, now: float, step: TimeStep | None = None, /) -> Snapshot: ...


class FurtherChannels(Protocol):
    """Channels of several cameras together (``live.results.sides.JointChannels``)."""

    @property
    def lost(self) -> str:
        """Why they have no value any more; empty while they have."""
        ...

    def read(self, start: float, /) -> Mapping[str, float]:
        """Their values; ``start`` is time zero, s, monotonic."""
        ...


class ChannelValues:
    """Computes the channels of one measurement after the other; each user has its own.

    Parameters
    ----------
    start : float, s
        Time zero, monotonic.
    state : StateOfTest
        A ``live.pipeline.run_state.RunState``.
    joint : FurtherChannels, optional
        Those of several cameras together.
    clock : callable giving monotonic seconds

    Attributes
    ----------
    now : Snapshot
        That of the last reading.
    """

    def __init__(
        self,
        start: float,
        state: StateOfTest,
        joint: FurtherChannels | None = None,
        clock: Clock = time.monotonic,
    ) -> None:
        self.start, self._state, self._joint, self._clock = start, state, joint, clock
        self._recent: deque[tuple[float, float]] = deque()
        self.now = Snapshot(math.nan)

    def read(self, measurement: Measurement | None = None) -> dict[str, float]:
        """All channels by name, NaN where one is not known; without a measurement those of this moment."""
        step = None if measurement is None else measurement.time_step
        self.now = now = self._state.snapshot(self._clock(), step)
        values = {one.name: getattr(now.figure(one.of), one.part) / one.one for one in OF_SNAPSHOT}
        values |= {"time_s": (now.t if step is None else step.t) - self.start, **now.cycles}
        if measurement is not None and step is not None:
            values |= {name: getattr(step, of) for name, of in _CHANNELS_OF_STEP.items()}
            values |= {name: getattr(measurement.burst, of) for name, of in _OF_BURST.items()}
            values["strain_rate"], values["sigma_strain_rate"] = self._rate(step.t, now.figure(AXIAL).value)
            for name in (f"gauge_{gauge}" for gauge in step.gauges):
                figure = now.figure(name)
                values |= {name: figure.value, f"sigma_{name}": figure.sigma}
        return values if self._joint is None else {**values, **self._joint.read(self.start)}

    @property
    def states(self) -> dict[str, str]:
        """The channels that are words, of the last reading."""
        return {"state": str(self.now.figure(AXIAL).state), "force_state": str(self.now.figure(FORCE).state)}

    def _rate(self, t: float, axial: float) -> tuple[float, float]:
        """The slope of the least-squares line through the last second, three points or more, and its sigma.

        Sigma is of the scatter about the line, so that a rate that changes within the second has a larger one.
        """
        if math.isnan(axial):
            return math.nan, math.nan
        if not self._recent or t > self._recent[-1][0]:
            self._recent.append((t, axial))
        while len(self._recent) > 3 and self._recent[0][0] < t - RATE_S:
            self._recent.popleft()
        if (n := len(self._recent)) < 3:
            return math.nan, math.nan
        mean_t, mean_e = (math.fsum(column) / n for column in zip(*self._recent, strict=True))
        spread = math.fsum((at - mean_t) ** 2 for at, _ in self._recent)
        slope = math.fsum((at - mean_t) * e for at, e in self._recent) / spread
        left = math.fsum((e - mean_e - slope * (at - mean_t)) ** 2 for at, e in self._recent)
        return slope, math.sqrt(left / (n - 2) / spread)


FORCE, STRESS, AXIAL, BURST, FPS, DISK = "force", "stress", "axial", "burst", "fps", "disk"
"""Names of figures; those of gauges and of the region are the names of their channels (``live.config.figures``)."""
_OF_STEP = {one.plain for one in LIVE}
_NO_FIGURE = TimedFigure()


@dataclass(frozen=True, slots=True)
class ShownFigure:
    """A figure of the table as it stands at one moment."""

    figure: LiveFigure
    now: TimedFigure

    @property
    def amount(self) -> Amount:
        """Its value and sigma; NaN where it is not live."""
        return Amount(self.figure.kind, self.now.value, self.now.sigma)

    @property
    def matters(self) -> bool:
        """Whether it is beyond what is usual."""
        return self.now.known and not self.figure.below <= self.now.value <= self.figure.above


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The state of a test at one time; NaN where a number is not known.

    Attributes
    ----------
    t : float, s
        Monotonic.
    state : str
        What is done with the frames: "REC", "ARMED" ...
    elapsed_s : float, s
        Since the test began.
    figures : mapping of str to TimedFigure
        Force in N, stress in Pa, ``AXIAL`` strain along the load, strains of the region and of gauges, frames per
        second, time until the disk is full in s; ``BURST``: the share of valid ZOIs of the newest burst.
    peak_N : float, N
        The force of largest magnitude so far, with its sign.
    axial_name : str
        What ``axial`` is: a gauge, "exx" or "eyy".
    axis : "x" or "y"
        Of the load.
    axis_assumed : bool
        It is neither given nor found yet.
    valid, zois : int
        ZOIs with a value, and all.
    area_share : float
        The smallest share of an area that the strains stand for (``TimeStep.least_share``).
    latency_p95_s : float, s
        Of the last seconds.
    alarms, faults : tuple of str
        Texts of the alarms that are on, and of errors that are not over.
    frames : mapping of str to int
        The counts of frames by name.
    time_step : TimeStep or None
        The last one measured.
    paused : bool
        The operator has paused measuring.
    cycles : mapping of str to float
        The channels of the last whole cycle of a cyclic test.
    at_cycle : callable
        Takes a channel and a number, gives the value in that cycle.
    """

    t: float
    state: str = ""
    elapsed_s: float = math.nan
    figures: Mapping[str, TimedFigure] = field(default_factory=dict)
    peak_N: float = math.nan
    axial_name: str = ""
    axis: str = "y"
    axis_assumed: bool = False
    valid: int = 0
    zois: int = 0
    area_share: float = 1.0
    latency_p95_s: float = math.nan
    alarms: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    frames: Mapping[str, int] = field(default_factory=dict)
    time_step: TimeStep | None = None
    paused: bool = False
    cycles: Mapping[str, float] = field(default_factory=lambda: dict.fromkeys(CYCLE_CHANNELS, math.nan))
    at_cycle: Callable[[str, int], float] = lambda channel, number: math.nan

    def figure(self, name: str) -> TimedFigure:
        """The figure of this name, of state "none" where there is no such source."""
        if name in self.figures:
            return self.figures[name]
        late = self.latency_p95_s if self.figures.get(BURST, _NO_FIGURE).known else math.nan
        counts = {**self.frames, **self.cycles, "lost_frames": self.lost, "delay": late}
        value = counts.get(name, math.nan)
        return TimedFigure.at(self.t, self.t, value) if math.isfinite(value) else _NO_FIGURE

    def rows(self, place: str) -> list[ShownFigure]:
        """The figures that are shown on "terminal", "page" or "display", in the order of the table."""
        found = (ShownFigure(one, self.figure(one.plain)) for one in FIGURES if getattr(one, place))
        return [
            row
            for row in found
            if row.now.state is not FigureState.NONE and (row.now.value or not row.figure.hidden)
        ]

    def of_channel(self, channel: str) -> TimedFigure:
        """The figure that a channel has its value from."""
        one = figure_of(channel)
        if one.channel in ("both", "machine"):
            return _NO_FIGURE
        return self.figure(one.of if one.of in self.figures and one.part != "age" else BURST)

    @property
    def doing(self) -> str:
        """What is done with the frames, and whether measuring is paused."""
        return Message("{state}, PAUSED", word(self.state)) if self.paused else word(self.state)

    @property
    def troubles(self) -> tuple[str, ...]:
        """Why the state of the test is not good: alarms, errors, and figures that are old, unknown or beyond."""
        names = {
            AXIAL: self.axial_name,
            FPS: Message("the frame rate"),
            DISK: Message("the room on the disk"),
        }
        lacking = (
            figure.trouble(names.get(name, name.removeprefix("gauge_")))
            for name, figure in self.figures.items()
            if name not in (STRESS, BURST, *_OF_STEP)
        )
        return tuple(dict.fromkeys(filter(None, (*self.alarms, *lacking, *self.faults))))

    @property
    def lost(self) -> int:
        """Frames that the camera lost, or that could not be recorded."""
        return self.frames.get("lost", 0) + self.frames.get("unrecorded", 0)


def peak_force(peak_N: float, force_N: float) -> float:
    """The force of larger magnitude, with its sign, N; ``peak_N`` is NaN before the first force."""
    if not math.isfinite(force_N) or abs(force_N) <= abs(peak_N):
        return peak_N
    return force_N
