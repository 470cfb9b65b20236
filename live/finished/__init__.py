"""A finished run, read back from its folder.

``run_folder`` ties results, recording and settings together, ``pictures`` finds the picture of a measured
instant, ``fields`` makes a strain field of its maps, ``added`` lays virtual gauges over them, ``display`` turns
numbers into the units and axes that are asked for.
"""

from live.finished.added import add_gauges
from live.finished.display import Display
from live.finished.pictures import Pictures
from live.finished.run_folder import GaugeTrack, RunFolder, open_run
from live.results import MEANS, UNITLESS, Quantity, quantity_of

__all__ = [
    "MEANS",
    "UNITLESS",
    "Display",
    "GaugeTrack",
    "Pictures",
    "Quantity",
    "RunFolder",
    "add_gauges",
    "open_run",
    "quantity_of",
]
