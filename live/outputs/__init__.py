"""Whatever takes frames, measurements, load samples and events.

``consumer`` is the contract, ``worker`` gives one a thread, queues and a guard, ``outputs`` passes
everything on to all of them; ``files`` (results) and ``watching`` (view, status card) are ours, and
``opening`` makes those of a configuration.
"""

from live.outputs.consumer import Consumer, Policy, Report
from live.outputs.opening import About, make_outputs
from live.outputs.outputs import Outputs

__all__ = ["About", "Consumer", "Outputs", "Policy", "Report", "make_outputs"]
