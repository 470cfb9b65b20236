"""What other programs, alarms and the status line are told of a measurement: a number a name.

``names`` are the channels there are, ``readings`` their values.
"""

from live.channels.names import MACHINE, STANDARD, channel_names
from live.channels.readings import Readings

__all__ = ["MACHINE", "STANDARD", "Readings", "channel_names"]
