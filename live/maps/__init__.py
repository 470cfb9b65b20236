"""Maps as colours over a picture: ``colours`` and ticks, the ``scale`` of a map, ``painting`` over pictures,
``field_maps`` while a test runs, ``display_filter`` for show, ``map`` as one picture.
"""

from live.maps.colours import MICROSTRAIN, Unit, nice_above, number, ramp, ticks, unit_for
from live.maps.display_filter import PAPER_LOW_PASS, for_display
from live.maps.field_maps import FIELD_MAPS, FieldMaps, Painted
from live.maps.map import Picture, draw, save
from live.maps.painting import Levels, Painter, caption, lay_cells
from live.maps.scale import ColourScale, status_colours, status_legend

__all__ = [
    "FIELD_MAPS",
    "MICROSTRAIN",
    "PAPER_LOW_PASS",
    "ColourScale",
    "FieldMaps",
    "Levels",
    "Painted",
    "Painter",
    "Picture",
    "Unit",
    "caption",
    "draw",
    "for_display",
    "lay_cells",
    "nice_above",
    "number",
    "ramp",
    "save",
    "status_colours",
    "status_legend",
    "ticks",
    "unit_for",
]
