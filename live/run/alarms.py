"""One alarm: on beyond its limit, off when it is back by the hysteresis.

Looks at every measurement, and several times a second at what is silent; tells alarms that come and go.

What an alarm does when it comes. A new action is a class here, in ``ACTIONS``, and its key in ``AlarmConfig``.
"""

from __future__ import annotations

import logging
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from acquire.events import Event, EventKind, EventSink
from live.config.channels import SYSTEM_CHANNELS
from live.config.sections import AlarmConfig
from live.pipeline.channel_values import ChannelValues
from live.pipeline.consumer import Consumer, Policy
from live.pipeline.measurement import Measurement
from live.pipeline.run_state import ActiveAlarms
from live.run.strain_output import StrainOut


@dataclass(frozen=True, slots=True)
class ActionMeans:
    """What actions act on.

    Attributes
    ----------
    bell : callable
        Rings at the terminal.
    end : callable taking a str
        Ends the run for this reason.
    outs : sequence of StrainOut
    """

    bell: Callable[[], None]
    end: Callable[[str], None]
    outs: Sequence[StrainOut] = ()


class Action(ABC):
    """One thing an alarm does when it comes.

    Attributes
    ----------
    key : str
        Of ``[[alarm]]``, which asks for it; empty: every alarm does it.
    """

    key: ClassVar[str] = ""

    def __init__(self, config: AlarmConfig, means: ActionMeans) -> None:
        self.config, self.means = config, means

    @abstractmethod
    def fire(self, event: Event) -> None:
        """Do it, at once and without waiting; ``event`` is that of the alarm, not yet passed on."""


class RingBell(Action):
    """The terminal rings."""

    def fire(self, event: Event) -> None:
        """Ring."""
        self.means.bell()


class SendLine(Action):
    """A line goes out on all strain outputs."""

    key = "line"

    def fire(self, event: Event) -> None:
        """Leave the line with each output, which sends it with the event of the alarm."""
        for out in self.means.outs:
            out.post(self.config.line)


class EndRun(Action):
    """The run ends."""

    key = "end"

    def fire(self, event: Event) -> None:
        """End it, with the alarm as the reason."""
        self.means.end(event.text)


ACTIONS: tuple[type[Action], ...] = (RingBell, SendLine, EndRun)


def actions_of(config: AlarmConfig, means: ActionMeans) -> list[Action]:
    """Those that ``config`` asks for, in the order of ``ACTIONS``."""
    return [kind(config, means) for kind in ACTIONS if not kind.key or getattr(config, kind.key)]


class Alarm:
    """Follows one channel.

    Parameters
    ----------
    config : AlarmConfig
    actions : sequence of Action
        What it does when it comes.

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

    def look(self, value: float) -> bool:
        """Take note of a value; whether the alarm has come or gone. A value that is not known changes nothing."""
        if math.isnan(value):
            return False
        beyond = self._sign * (value - self._limit)
        before = self.on
        self.on = beyond > 0 or (before and beyond > -self.config.hysteresis)
        return self.on is not before

    def words(self, value: float) -> str:
        """What is told of it at ``value``."""
        return f"{self.name}: {self.config.channel} is {value:.6g}"


log = logging.getLogger(__name__)

EVERY_S = 0.2
"""What is silent is looked at so often."""


class AlarmWatch(Consumer):
    """The alarms of a test.

    Parameters
    ----------
    alarms : sequence of Alarm
    readings : ChannelValues
    machine : callable
        The channels of the machine at a monotonic time.
    board : ActiveAlarms
    tell : callable taking an Event
    clock : callable giving monotonic seconds
    """

    name = "alarms"
    policy = Policy.NEWEST
    room = 64

    def __init__(
        self,
        alarms: Sequence[Alarm],
        readings: ChannelValues,
        machine: Callable[[float], Mapping[str, float]],
        board: ActiveAlarms,
        tell: EventSink,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._alarms = alarms
        self._readings, self._machine, self._board = readings, machine, board
        self._tell, self._clock = tell, clock
        self._came = 0

    def measurement(self, measurement: Measurement) -> None:
        """Look at the channels of a measurement."""
        burst = measurement.burst
        stamp = math.nan if burst.clock == "nominal" else burst.t + burst.duration / 2
        self._look(self._readings.read(measurement), stamp)

    def idle(self) -> float:
        """Look at the channels of the machine."""
        self._look(self._machine(self._clock()), math.nan)
        return EVERY_S if any(alarm.config.channel in SYSTEM_CHANNELS for alarm in self._alarms) else math.inf

    def end(self) -> str:
        """How often an alarm came."""
        return f"{self._came} came" if self._came else "none came"

    def _look(self, values: Mapping[str, float], stamp: float) -> None:
        for alarm in self._alarms:
            value = values.get(alarm.config.channel, math.nan)
            if alarm.look(value):
                self._changed(alarm, value, stamp)

    def _changed(self, alarm: Alarm, value: float, stamp: float) -> None:
        now, words = self._clock(), alarm.words(value)
        if alarm.on:
            self._came += 1
            self._board.put(alarm.name, words)
        else:
            self._board.take_off(alarm.name)
        data: dict[str, Any] = {"alarm": alarm.name, "on": alarm.on, "value": value}
        if not math.isnan(stamp):
            data["after_s"] = now - stamp
        if not alarm.on:
            self._tell(Event(now, EventKind.ALARM, "alarm", f"over: {words}", "info", data))
            return
        data |= {action.key: getattr(alarm.config, action.key) for action in alarm.actions if action.key}
        event = Event(now, EventKind.ALARM, "alarm", f"ALARM {words}", "warning", data)
        for action in alarm.actions:
            self._fire(action, event)
        self._tell(event)

    def _fire(self, action: Action, event: Event) -> None:
        """One action; where it fails the others and the event go on."""
        try:
            action.fire(event)
        except Exception as error:
            log.exception("an action of an alarm failed")
            text = f"{type(action).__name__} of an alarm failed: {error!r}"
            self._tell(Event(event.t, EventKind.ALARM, "alarm", text, "error"))
