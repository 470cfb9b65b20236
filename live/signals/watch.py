"""Looks at every measurement, and several times a second at what is silent; tells alarms that come and go."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from acquire.events import Event, EventKind, EventSink
from live.channels import MACHINE, Readings
from live.measure import Measurement
from live.outputs import Consumer, Policy
from live.signals.actions import Action
from live.signals.alarm import Alarm
from live.tell import AlarmBoard

log = logging.getLogger(__name__)

EVERY_S = 0.2
"""What is silent is looked at so often."""


class AlarmWatch(Consumer):
    """The alarms of a test.

    Parameters
    ----------
    alarms : sequence of Alarm
    readings : Readings
    machine : callable
        The channels of the machine at a monotonic time.
    board : AlarmBoard
    tell : callable taking an Event
    clock : callable giving monotonic seconds
    """

    name = "alarms"
    policy = Policy.NEWEST
    room = 64

    def __init__(
        self,
        alarms: Sequence[Alarm],
        readings: Readings,
        machine: Callable[[float], Mapping[str, float]],
        board: AlarmBoard,
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
        return EVERY_S if any(alarm.config.channel in MACHINE for alarm in self._alarms) else math.inf

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
