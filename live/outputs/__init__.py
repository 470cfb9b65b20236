"""Whatever takes frames, measurements, load samples and events.

``consumer`` is the contract, ``outputs`` passes everything on to all of them, ``opening`` makes those of a
configuration.
"""

from live.outputs.opening import make_outputs, open_view
from live.outputs.outputs import Outputs

__all__ = ["Outputs", "make_outputs", "open_view"]
