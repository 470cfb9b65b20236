"""Who goes first when the processor is short: the camera and the disk before the measurement.

Nice values by thread (Linux; elsewhere nothing happens). Recording must outrank measuring: with the
recorder at +5 hundreds of frames went unrecorded at 150 fps, at 0 none. Threads that a thread
starts inherit its value, so the pool of the compiled loops is at that of the measuring thread.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading

MEASURE, LOAD, OUTPUT = 3, 5, 10
"""Grabbing and recording stay at the value the program was started with."""


def yield_to_others(nice: int) -> None:
    """Make the calling thread nicer by ``nice``; it cannot be taken back without privileges."""
    if sys.platform != "linux":
        return
    thread = threading.get_native_id()
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, thread, os.getpriority(os.PRIO_PROCESS, thread) + nice)
