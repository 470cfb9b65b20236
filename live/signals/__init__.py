"""Signals to the outside: alarms, and strain out.

``alarm`` is one of the configuration with its hysteresis, ``actions`` what it does when it comes,
``watch`` looks at every measurement. ``lines`` writes
a measurement as a line, ``strain_out`` sends it to TCP clients, by UDP or to a serial port. ``opening`` makes what
a configuration asks for.
"""

from live.signals.alarm import Alarm
from live.signals.lines import Lines
from live.signals.opening import signals_of
from live.signals.strain_out import SerialOut, TcpOut, UdpOut
from live.signals.watch import AlarmWatch

__all__ = ["Alarm", "AlarmWatch", "Lines", "SerialOut", "TcpOut", "UdpOut", "signals_of"]
