"""Strain as colours over a picture: ``colours`` and their scale, ``display_filter`` for show, ``map`` as a
PNG.
"""

from live.maps.colours import MICROSTRAIN, AutoRange, Unit, colour, nice_above, number, ramp, ticks, unit_for
from live.maps.display_filter import PAPER_LOW_PASS, for_display
from live.maps.map import STATUS_COLOURS, Picture, draw, save

__all__ = [
    "MICROSTRAIN",
    "PAPER_LOW_PASS",
    "STATUS_COLOURS",
    "AutoRange",
    "Picture",
    "Unit",
    "colour",
    "draw",
    "for_display",
    "nice_above",
    "number",
    "ramp",
    "save",
    "ticks",
    "unit_for",
]
