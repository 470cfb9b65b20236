"""Whether the measurement keeps up, and who goes first when the processor is short.

``judge`` watches the latency and names what holds it up, ``processor`` tells who uses the cores, ``priority`` makes
a thread nicer.
"""

from live.pace.judge import Lag, Pace
from live.pace.priority import LOAD, MEASURE, OUTPUT, yield_to_others

__all__ = ["LOAD", "MEASURE", "OUTPUT", "Lag", "Pace", "yield_to_others"]
