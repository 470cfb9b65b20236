"""Signals to the outside: alarms.

``alarm`` is one of the configuration with its hysteresis, ``watch`` looks at every measurement, ``opening``
makes what a configuration asks for.
"""

from live.signals.alarm import Alarm
from live.signals.opening import signals_of
from live.signals.watch import AlarmWatch

__all__ = ["Alarm", "AlarmWatch", "signals_of"]
