"""The threads of a live test.

``run_live`` opens everything: ``setting``, ``recorder`` behind its ``gate``, and a ``live_run`` that
joins the threads: ``grabber`` drains the camera, ``load_thread`` the load cell, ``measuring`` measures
what comes through ``feed`` and ``channels`` once ``reference_step`` has a reference. ``stopping`` is the
wish to end, ``outcome`` what is left behind.
"""

from live.run.live_run import INTERRUPTED, LiveRun, run_live
from live.run.outcome import Outcome
from live.run.stopping import Stop

__all__ = ["INTERRUPTED", "LiveRun", "Outcome", "Stop", "run_live"]
