"""Whatever takes frames, measurements, load samples and events.

``consumer`` is the contract, ``worker`` gives one a thread, queues and a guard, ``outputs`` passes
everything on to all of them; ``files`` writes the results. A command composes the consumers of a test.
"""

from live.outputs.consumer import About, Compose, Consumer, Policy, Report
from live.outputs.files import write_results
from live.outputs.outputs import Outputs

__all__ = ["About", "Compose", "Consumer", "Outputs", "Policy", "Report", "write_results"]
