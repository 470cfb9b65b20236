"""The specimen before a test, free of terminal and page.

``region`` finds it in the picture, ``placing`` puts gauges on it, ``drawing`` shows it, ``proposal`` writes
the rig down. ``scale`` and ``board`` take the scale of the picture.
"""

from live.specimen.board import Board, from_board
from live.specimen.drawing import Overlay, snapshot
from live.specimen.placing import auto_gauges, with_auto_gauges
from live.specimen.proposal import Proposal, propose, rig_text
from live.specimen.region import (
    Look,
    Region,
    is_sought,
    look,
    mask_picture,
    placed_on,
    region_of,
    searched,
    troubles,
    with_mask_at,
)
from live.specimen.scale import OUT_OF_PLANE_MM, Scale, false_strain, from_points, from_width

__all__ = [
    "OUT_OF_PLANE_MM",
    "Board",
    "Look",
    "Overlay",
    "Proposal",
    "Region",
    "Scale",
    "auto_gauges",
    "false_strain",
    "from_board",
    "from_points",
    "from_width",
    "is_sought",
    "look",
    "mask_picture",
    "placed_on",
    "propose",
    "region_of",
    "rig_text",
    "searched",
    "snapshot",
    "troubles",
    "with_auto_gauges",
    "with_mask_at",
]
