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

from acquire.errors import ConfigError
from acquire.events import Event, EventKind, EventSink
from live.config.channels import SYSTEM_CHANNELS, is_joint
from live.config.loading import Config
from live.config.sections import AlarmConfig
from live.pipeline.channel_values import ChannelValues
from live.pipeline.consumer import Consumer, Policy
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import ActiveAlarms
from live.run.strain_output import StrainOut

log = logging.getLogger(__name__)

EVERY_S = 0.2
"""The channels of the machine are checked at this interval."""
_STRAINS = ("axial", "exx", "eyy", "exy", "largest")
_TWO_CAMERAS = "a camera on each side: give --back"
_UNITS = {"_N": "N", "_MPa": "MPa", "_s": "s", "_min": "min", "_GL": "GL", "": ""}
_LABELS = {"silent_s": "no frame for", "load_silent_s": "no force for", "disk_min": "disk full in"}


@dataclass(frozen=True, slots=True)
class ActionMeans:
    """What actions act on.

    Attributes
    ----------
    bell : callable
        Rings the bell of the terminal.
    end : callable taking a str
        Ends the run for this reason.
    outs : sequence of StrainOut
    """

    bell: Callable[[], None]
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
        self.means.bell()


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
        raise ConfigError(f"strain_out.channels: {joint} needs {_TWO_CAMERAS}")
    missing = dict.fromkeys(("force_N", "stress_MPa", "load_silent_s"), "a load cell: give --load ADDRESS")
    if config.load.address != "none:":
        missing.clear()
    if config.specimen.area_m2 is None:
        missing.setdefault("stress_MPa", "the section: give --section W,T")
    if not config.record.enabled:
        missing["disk_min"] = "a recording: leave --no-record out"
    if not both_sides:
        missing |= {one.channel: _TWO_CAMERAS for one in config.alarm if is_joint(one.channel)}
    for number, alarm in enumerate(config.alarm, 1):
        if alarm.channel in missing:
            raise ConfigError(
                f"alarm {number} ({alarm.channel}) can never come: it needs {missing[alarm.channel]}, or take the"
                " alarm out of the configuration"
            )


def in_words(channel: str, value: float, limit: float) -> str:
    """A channel at its value beyond its limit, for a person: ``axial 4450 um/m, limit 4000``."""
    plain = channel
    for prefix in ("sigma_", "mean_", "bending_"):
        plain = plain.removeprefix(prefix)
    if plain in _STRAINS or plain.startswith("gauge_"):
        return f"{channel.replace('_', ' ')} {value * 1e6:.0f} µm/m, limit {limit * 1e6:.0f}"
    suffix = next((one for one in _UNITS if plain.endswith(one)), "")
    label = _LABELS.get(channel, channel.removesuffix(suffix).replace("_", " "))
    return f"{label} {value:.6g} {_UNITS[suffix]}".rstrip() + f", limit {limit:.6g}"


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
    on : bool
    """

    def __init__(self, config: AlarmConfig, actions: Sequence[Action] = ()) -> None:
        self.config, self.actions, self.on = config, actions, False
        c = config
        limit = f"above {c.above:g}" if c.above is not None else f"below {c.below:g}"
        self.name = c.name or f"{c.channel} {limit}"
        self._sign, self._limit = (1.0, c.above) if c.above is not None else (-1.0, c.below or 0.0)

    def check(self, value: float) -> bool:
        """Check a value; whether the alarm went on or off. A value that is not known changes nothing."""
        if math.isnan(value):
            return False
        beyond = self._sign * (value - self._limit)
        before = self.on
        self.on = beyond > 0 or (before and beyond > -self.config.hysteresis)
        return self.on is not before

    def lose(self) -> bool:
        """Go on because the channel can have no value; whether it did. Only one of two cameras does so."""
        before, self.on = self.on, self.on or is_joint(self.config.channel)
        return self.on is not before

    def message(self, value: float, lost: str = "") -> str:
        """Its text at ``value``, or where there is none because of ``lost``."""
        c = self.config
        named = f"{c.name}: " if c.name else ""
        words = f"{c.channel.replace('_', ' ')} is not known, {lost}" if lost else ""
        return named + (words or in_words(c.channel, value, self._limit))


def _is_due_by_itself(channel: str) -> bool:
    """Whether a channel changes without a measurement."""
    return channel in SYSTEM_CHANNELS or is_joint(channel)


class AlarmWatch(Consumer):
    """Checks the alarms with every measurement, and those on channels of the machine every ``EVERY_S``.

    Parameters
    ----------
    alarms : sequence of Alarm
    values : ChannelValues
    machine : callable
        The channels of the machine at a monotonic time.
    active : ActiveAlarms
    on_event : callable taking an Event
    clock : callable giving monotonic seconds
    lost : callable
        Why channels of two cameras have no value any more; empty while they have. Alarms on them then come.
    """

    name = "alarms"
    policy = Policy.NEWEST
    queue_size = 64

    def __init__(
        self,
        alarms: Sequence[Alarm],
        values: ChannelValues,
        machine: Callable[[float], Mapping[str, float]],
        active: ActiveAlarms,
        on_event: EventSink,
        clock: Callable[[], float] = time.monotonic,
        lost: Callable[[], str] = str,
    ) -> None:
        self._alarms, self._lost = alarms, lost
        self._values, self._machine, self._active = values, machine, active
        self._on_event, self._clock = on_event, clock
        self._count = 0

    def measurement(self, measurement: Measurement) -> None:
        """Check the channels of a measurement."""
        burst = measurement.burst
        stamp = math.nan if burst.clock == "nominal" else burst.t + burst.duration / 2
        self._check(self._values.read(measurement), stamp)

    def idle(self) -> float:
        """Check the channels of the machine, and whether those of two cameras still have values."""
        self._check(self._machine(self._clock()), math.nan)
        self._check_lost()
        return EVERY_S if any(_is_due_by_itself(alarm.config.channel) for alarm in self._alarms) else math.inf

    def end(self) -> str:
        """How often an alarm came on; a camera that has failed ends the test of its side, and may be why."""
        self._check_lost()
        return f"{self._count} came" if self._count else "none came"

    def _check(self, values: Mapping[str, float], stamp: float) -> None:
        for alarm in self._alarms:
            value = values.get(alarm.config.channel, math.nan)
            if alarm.check(value):
                self._changed(alarm, value, stamp, alarm.message(value))

    def _check_lost(self) -> None:
        why = self._lost()
        for alarm in self._alarms:
            if why and alarm.lose():
                self._changed(alarm, None, math.nan, alarm.message(math.nan, why))

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
            self._on_event(Event(now, EventKind.ALARM, "alarm", f"over: {text}", "info", data))
            return
        data |= {action.key: getattr(alarm.config, action.key) for action in alarm.actions if action.key}
        event = Event(now, EventKind.ALARM, "alarm", f"ALARM {text}", "warning", data)
        for action in alarm.actions:
            self._fire(action, event)
        self._on_event(event)

    def _fire(self, action: Action, event: Event) -> None:
        """One action; if it fails, the others and the event still follow."""
        try:
            action.fire(event)
        except Exception as error:
            log.exception("an action of an alarm failed")
            text = f"{type(action).__name__} of an alarm failed: {error!r}"
            self._on_event(Event(event.t, EventKind.ALARM, "alarm", text, "error"))
