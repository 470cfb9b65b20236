"""A pattern of known motion is measured before anything else is, and a machine that gets it wrong is refused.

A broken linear algebra library, or a loop that was compiled wrong, gives wrong numbers without an error.
``known`` renders the pattern in closed form, ``algebra`` has problems with whole numbers as solutions, ``machine``
says what is wrong and with which libraries. How to measure is a function that the caller gives.
"""

from analysis.self_test.known import Errors, Measure, Way
from analysis.self_test.machine import MachineError, check

__all__ = ["Errors", "MachineError", "Measure", "Way", "check"]
