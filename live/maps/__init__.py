"""Strain as colours over a picture: ``colours`` and their scale, ``display_filter`` for show, ``map`` as a
PNG.
"""

from live.maps.colours import MICROSTRAIN, AutoRange, Unit, colour, nice_above, number, ramp, ticks, unit_for
from live.maps.display_filter import PAPER_LOW_PASS, for_display

__all__ = [
    "MICROSTRAIN",
    "PAPER_LOW_PASS",
    "AutoRange",
    "Unit",
    "colour",
    "for_display",
    "nice_above",
    "number",
    "ramp",
    "ticks",
    "unit_for",
]
