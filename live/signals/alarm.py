"""One alarm: on beyond its limit, off when it is back by the hysteresis."""

from __future__ import annotations

import math
from collections.abc import Sequence

from live.setup import AlarmConfig
from live.signals.actions import Action


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
