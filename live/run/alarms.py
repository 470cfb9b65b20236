"""The alarms of a test: limits of channels with hysteresis, the actions of an alarm, and the consumer that checks them.

A new action is a class here, in ``ACTIONS``, and its key in ``AlarmConfig``.
"""

from __future__ import annotations

import logging
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from acquire.clock import Clock
from acquire.errors import ConfigError
from acquire.events import Event, EventKind
from acquire.text import Amount, Message, word
from live.config.figures import OF_LOAD, OF_SECTION, figure_of, is_joint
from live.config.loading import Config
from live.config.sections import AlarmConfig
from live.pipeline.consumer import Consumer, Policy, Screen
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import RunState
from live.pipeline.snapshot import BURST, ChannelValues, FurtherChannels
from live.pipeline.timed.figure import BEYOND, LACKING, FigureState, TimedFigure
from live.run.strain_output import StrainOut

log = logging.getLogger(__name__)

EVERY_S = 0.2
"""What changes without a measurement is checked at this interval."""
_TWO_CAMERAS = Message("a camera on each side: give --back")


@dataclass(frozen=True, slots=True)
class ActionMeans:
    """What actions act on.

    Attributes
    ----------
    screen : Screen
        Whose bell is rung.
    end : callable taking a str
        Ends the run for this reason.
    outs : sequence of StrainOut
    """

    screen: Screen
    end: Callable[[str], None]
    outs: Sequence[StrainOut] = ()


class Action(ABC):
    """One thing an alarm does when it comes on.

    Attributes
    ----------
    key : str
        Key in ``[[alarm]]`` that requests it; empty: every alarm does it.
    """

    key: ClassVar[str] = ""

    def __init__(self, config: AlarmConfig, means: ActionMeans) -> None:
        self.config, self.means = config, means

    @abstractmethod
    def fire(self, event: Event) -> None:
        """Do it, without blocking; ``event`` is that of the alarm, not yet passed on."""


class RingBell(Action):
    """Rings the bell of the terminal."""

    def fire(self, event: Event) -> None:
        """Ring."""
        self.means.screen.bell()


class SendLine(Action):
    """Sends a line to all strain outputs."""

    key = "line"

    def fire(self, event: Event) -> None:
        """Post the line to each output, which sends it with the event of the alarm."""
        for out in self.means.outs:
            out.post(self.config.line)


class EndRun(Action):
    """Ends the run."""

    key = "end"

    def fire(self, event: Event) -> None:
        """End it, with the alarm as the reason."""
        self.means.end(event.text)


ACTIONS: tuple[type[Action], ...] = (RingBell, SendLine, EndRun)


def actions_of(config: AlarmConfig, means: ActionMeans) -> list[Action]:
    """The actions that ``config`` requests, in the order of ``ACTIONS``."""
    return [kind(config, means) for kind in ACTIONS if not kind.key or getattr(config, kind.key)]


def check_alarms(config: Config, *, both_sides: bool = False) -> None:
    """Refuse alarms, and strain outputs of front and back, on channels that have no value in a test with ``config``.

    Raises
    ------
    ConfigError
        A force without a load cell, a stress without a section, a disk that nothing is written to, a mean of front and
        back where not ``both_sides`` are measured.
    """
    joint = next((one for one in config.strain_out.channels or () if is_joint(one)), "")
    if joint and not both_sides:
        raise ConfigError("strain_out.channels: {joint} needs {TWO_CAMERAS}", joint, _TWO_CAMERAS)
    missing = dict.fromkeys(OF_LOAD, Message("a load cell: give --load ADDRESS"))
    if config.load.address != "none:":
        missing.clear()
    if config.specimen.area_m2 is None:
        absolute = {alarm.channel for alarm in config.alarm if alarm.of_cycle is None}
        for channel in absolute & OF_SECTION:
            missing.setdefault(channel, Message("the section: give --section W,T"))
    if not config.record.enabled:
        missing["disk_min"] = Message("a recording: leave --no-record out")
    if not both_sides:
        missing |= {one.channel: _TWO_CAMERAS for one in config.alarm if is_joint(one.channel)}
    for number, alarm in enumerate(config.alarm, 1):
        if alarm.channel in missing:
            raise ConfigError(
                "alarm {number} ({channel}) can never come: it needs {missing}, or take the alarm out of the "
                "configuration",
                number,
                alarm.channel,
                missing[alarm.channel],
            )


def in_words(channel: str, value: float, limit: float) -> str:
    """A channel at its value beyond its limit, for a person: ``axial 4 450 µm/m, limit 4 000 µm/m``."""
    one = figure_of(channel)
    if one.kind:
        value_of, limit_of = Amount(one.kind, value * one.one), Amount(one.kind, limit * one.one)
        return Message("{channel} {value}, limit {limit}", word(one.said), value_of, limit_of)
    return Message("{label} {value:.6g} {UNITS}", word(one.said), value, one.unit).rstrip() + Message(
        ", limit {limit:.6g}", limit
    )


class Alarm:
    """One alarm: on beyond its limit, off when the value is back by the hysteresis.

    Parameters
    ----------
    config : AlarmConfig
    actions : sequence of Action
        What it does when it comes on.

    Attributes
    ----------
    config : AlarmConfig
    name : str
        As configured, else the channel and its limit.
    on, unknown : bool
        Whether it is on, and whether it came because the value is not known.
    """

    def __init__(self, config: AlarmConfig, actions: Sequence[Action] = ()) -> None:
        self.config, self.on, self.unknown = config, False, False
        self._actions, c = actions, config
        limit = (
            Message("above {above:g}", c.above)
            if c.above is not None
            else Message("below {below:g}", c.below)
        )
        self.name = c.name or Message("{channel} {limit}", c.channel, limit)
        self._sign, self._limit = (1.0, c.above) if c.above is not None else (-1.0, c.below or 0.0)

    @property
    def actions(self) -> list[Action]:
        """What it does; a run is ended by a value, and only on demand by one that is not known."""
        ends = self.config.end_on_unknown or not self.unknown
        return [action for action in self._actions if ends or not isinstance(action, EndRun)]

    def check(self, value: float) -> bool:
        """Check a value; whether the alarm went on or off. A value that is not known changes nothing."""
        if math.isnan(value):
            return False
        beyond = self._sign * (value - self._limit)
        before = self.on, self.unknown
        held = self.on and not self.unknown and beyond > -self.config.hysteresis
        self.on, self.unknown = beyond > 0 or held, False
        return (self.on, self.unknown) != before

    def judge(self, figure: TimedFigure, value: float) -> bool:
        """Check the value of a figure, or what takes its place; whether the alarm went on or off.

        A figure that is old or unknown is no value within the limit. One beyond the range of its device is above a
        limit, or below one; paused or not yet there it is neither.
        """
        if figure.state in LACKING:
            return self.lose()
        if figure.state in BEYOND:
            beyond = math.inf if figure.state is FigureState.OVERLOAD else -math.inf
            return self.lose() if beyond < 0 < self._sign else self.check(beyond)
        if figure.known or figure.state is FigureState.NONE:
            return self.check(value)
        before, self.on, self.unknown = self.on, False, False
        return before

    def lose(self) -> bool:
        """Go on because the value is not known; whether it did."""
        before, self.on = self.on, True
        self.unknown = self.unknown or not before
        return not before

    def message(self, value: float, instead: str = "") -> str:
        """Its text at ``value``, or with what is there ``instead`` of one."""
        c = self.config
        named = Message("{name}: ", c.name) if c.name else ""
        if c.of_cycle and not instead:
            words = Message(
                "{channel} {share:.1%} of that in cycle {number}, limit {limit:.1%}",
                c.channel.replace("_", " "),
                value,
                c.of_cycle,
                self._limit,
            )
            return named + words
        return named + (instead or in_words(c.channel, value, self._limit))


class AlarmWatch(Consumer):
    """Checks the alarms with every measurement, and every ``EVERY_S`` those on what changes without one.

    Parameters
    ----------
    alarms : sequence of Alarm
    values : ChannelValues
    run_state : RunState
    clock : callable giving monotonic seconds
    joint : FurtherChannels, optional
        Of two cameras. Alarms on them come too where they have no value any more.
    """

    name = "alarms"
    policy = Policy.NEWEST
    queue_size = 64

    def __init__(
        self,
        alarms: Sequence[Alarm],
        values: ChannelValues,
        run_state: RunState,
        clock: Clock = time.monotonic,
        joint: FurtherChannels | None = None,
    ) -> None:
        self._alarms, self._values, self._clock, self._joint = alarms, values, clock, joint
        self._health, self._active, self._on_event = run_state.health, run_state.alarms, run_state.event_log
        self._count = 0

    def measurement(self, measurement: Measurement) -> None:
        """Check the channels of a measurement."""
        burst = measurement.burst
        stamp = math.nan if burst.clock == "nominal" else burst.t + burst.duration / 2
        self._check(self._values.read(measurement), stamp)

    def event(self, event: Event) -> None:
        """Wake the thread: the first event comes before the first frame."""

    def idle(self) -> float:
        """Check what is due by itself: age, force, machine, and whether two cameras still have values."""
        values = {**self._values.read(), **self._health.channels(self._clock())}
        if self._joint is not None:
            values |= self._joint.read(self._values.start)
        if self._values.now.figure(BURST).state is not FigureState.ENDED:
            self._check(values, None)
        self._check_lost()
        return EVERY_S

    def end(self) -> str:
        """How often an alarm came on; a camera that has failed ends the test of its side, and may be why."""
        self._check_lost()
        return Message("{count} came", self._count) if self._count else Message("none came")

    def _check(self, values: Mapping[str, float], stamp: float | None) -> None:
        """Judge all; ``stamp`` is the time of what the values are from, None: of each figure."""
        for alarm in self._alarms:
            channel = alarm.config.channel
            value = values.get(channel, math.nan)
            if alarm.config.of_cycle is not None:
                value /= self._values.now.at_cycle(channel, alarm.config.of_cycle) or math.nan
            figure = self._values.now.of_channel(channel)
            changed, words = alarm.judge(figure, value), word(channel.replace("_", " "))
            instead = figure.trouble(word(figure_of(channel).said))
            if not (instead or figure.known or figure.state is FigureState.NONE):
                instead = Message("{words}: {state}", words, word(str(figure.state)))
            text = alarm.message(value, instead)
            if changed:
                t = self._clock() - figure.age if stamp is None and figure.known else stamp
                self._changed(alarm, None if instead else value, math.nan if t is None else t, text)
            elif alarm.on and instead:
                self._active.renew(alarm.name, text)

    def _check_lost(self) -> None:
        why = "" if self._joint is None else self._joint.lost
        for alarm in self._alarms:
            channel = alarm.config.channel
            if why and is_joint(channel) and alarm.lose():
                words = Message("{channel} is not known, {why}", word(channel.replace("_", " ")), why)
                self._changed(alarm, None, math.nan, alarm.message(math.nan, words))

    def _changed(self, alarm: Alarm, value: float | None, stamp: float, text: str) -> None:
        now = self._clock()
        if alarm.on:
            self._count += 1
            self._active.set(alarm.name, text)
        else:
            self._active.clear(alarm.name)
        data: dict[str, Any] = {"alarm": alarm.name, "on": alarm.on, "value": value}
        if not math.isnan(stamp):
            data["after_s"] = now - stamp
        if not alarm.on:
            self._on_event(Event(now, EventKind.ALARM, "alarm", Message("over: {text}", text), "info", data))
            return
        data |= {action.key: getattr(alarm.config, action.key) for action in alarm.actions if action.key}
        event = Event(now, EventKind.ALARM, "alarm", Message("ALARM {text}", text), "warning", data)
        for action in alarm.actions:
            self._fire(action, event)
        self._on_event(event)

    def _fire(self, action: Action, event: Event) -> None:
        """One action; if it fails, the others and the event still follow."""
        try:
            action.fire(event)
        except Exception as error:
            log.exception("an action of an alarm failed")
            text = Message("{name} of an alarm failed: {error}", type(action).__name__, repr(error))
            self._on_event(Event(event.t, EventKind.ALARM, "alarm", text, "error"))
