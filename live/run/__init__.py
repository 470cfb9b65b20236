"""The threads of a live test.

``live_run`` joins them: ``grabber`` drains the camera, ``recorder`` writes the session, ``load_thread``
drains the load cell, ``measuring`` measures what comes through ``feed`` and ``channels``, once
``reference_step`` has a reference and ``rehearsal`` has run everything once. ``outcome`` is what is left
behind.
"""

from live.run.live_run import LiveRun
from live.run.outcome import Outcome

__all__ = ["LiveRun", "Outcome"]
